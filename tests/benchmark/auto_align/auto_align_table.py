#!/usr/bin/env python3
"""Tables of what auto_align wrote: how many rooms were right and trusted, and, for each that was not, why.

  build/bin/auto_align --output_path rooms.csv --set check --rooms 16
  tests/benchmark/auto_align/auto_align_table.py rooms.csv [MORE.csv ...]

Right: 5 mm and 0.1 degrees at the median over the photos. The right place: 5 cm and 1 degree; the expected error of the
report says how exact. Everything else is wrong, and so is every answer to a room that has none.
"""

import argparse
import csv
import math
import statistics

RIGHT = (0.005, 0.1)
RIGHT_PLACE = (0.05, 1.0)
COLUMNS = ["right, trusted", "right place, trusted", "right place, refused", "wrong, refused", "wrong, trusted"]
SUPPORT = {"0": "none", "1": "faint", "2": "clear"}


def is_within(room, limits):
    return (
        room["has_answer"] == "1" and float(room["position_m"]) <= limits[0] and float(room["turn_deg"]) <= limits[1]
    )


def column_of(room):
    trusted = room["trusted"] == "1"
    if is_within(room, RIGHT_PLACE):
        if not trusted:
            return COLUMNS[2]
        return COLUMNS[0] if is_within(room, RIGHT) else COLUMNS[1]
    return COLUMNS[4] if trusted else COLUMNS[3]


def most_wrong(wrong, number):
    """Largest share that gives so few wrong ones in one of twenty series (Clopper and Pearson 1934)."""
    if number == 0:
        return 1.0
    low, high = wrong / number, 1.0
    for _ in range(60):
        share = (low + high) / 2
        as_few = sum(math.comb(number, k) * share**k * (1 - share) ** (number - k) for k in range(wrong + 1))
        low, high = (share, high) if as_few > 0.05 else (low, share)
    return high


def print_rooms(rooms):
    print("| rooms | number | " + " | ".join(COLUMNS) + " |\n" + "|---" * (len(COLUMNS) + 2) + "|")
    kinds = sorted({room["kind"] for room in rooms}, key=lambda kind: [r["kind"] for r in rooms].index(kind))
    for has_answer in "1", "0":
        some = [room for room in rooms if room["has_answer"] == has_answer]
        for kind in [k for k in kinds if any(r["kind"] == k for r in some)] + [None]:
            of_kind = [room for room in some if kind in (None, room["kind"])]
            counts = [sum(column_of(room) == column for room in of_kind) for column in COLUMNS]
            name = kind or ("**all with an answer**" if has_answer == "1" else "**all to be refused**")
            print(f"| {name} | {len(of_kind)} | " + " | ".join(map(str, counts)) + " |")


def print_failures(rooms):
    print("\n| seed | rooms | column | off, mm | degrees | why |\n|---|---|---|---|---|---|")
    for room in rooms:
        column = column_of(room)
        if column == COLUMNS[0] or (column == COLUMNS[3] and room["has_answer"] == "0"):
            continue
        off, turn = 1000 * float(room["position_m"]), float(room["turn_deg"])
        why = f"{room['verdict']}; photos {room['share']} of {room['num_patches']}; " + room["reason"][:120]
        print(f"| {room['seed']} | {room['kind']} | {column} | {off:.1f} | {turn:.2f} | {why} |")


def print_evidence(rooms):
    print("\n| what the photos say of the best place | answers | wrong | of 1000, at most (95 %) |\n|---|---|---|---|")
    for support, name in SUPPORT.items():
        some = [room for room in rooms if room["support"] == support]
        wrong = sum(not is_within(room, RIGHT_PLACE) for room in some)
        print(f"| {name} | {len(some)} | {wrong} | {1000 * most_wrong(wrong, len(some)):.0f} |")
    trusted = [room for room in rooms if room["trusted"] == "1"]
    wrong = sum(not is_within(room, RIGHT_PLACE) for room in trusted)
    print(f"| trusted | {len(trusted)} | {wrong} | {1000 * most_wrong(wrong, len(trusted)):.0f} |")


def print_costs(rooms):
    right = [room for room in rooms if column_of(room) == COLUMNS[0]]
    for name, unit, scale in (("position_m", "mm", 1000), ("turn_deg", "degrees", 1)):
        errors = sorted(scale * float(room[name]) for room in right)
        if errors:
            print(f"\nright and trusted: {statistics.median(errors):.2f} {unit} (median), {errors[-1]:.2f} (largest)")
    cpu = [float(room["cpu_s"]) for room in rooms]
    print(f"\n{statistics.median(cpu):.1f} CPU-s each (median), {max(cpu):.1f} (largest); ", end="")
    print(f"{max(float(room['peak_mb']) for room in rooms):.0f} MB at most, with the room itself")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="+", help="what auto_align wrote")
    rooms = []
    for path in parser.parse_args().paths:
        with open(path, newline="", encoding="utf-8") as stream:
            rooms += csv.DictReader(stream)
    rooms.sort(key=lambda room: int(room["seed"]))
    print_rooms(rooms)
    print_failures(rooms)
    print_evidence(rooms)
    print_costs(rooms)


if __name__ == "__main__":
    main()
