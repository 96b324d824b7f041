#!/usr/bin/env python3
"""roomtex-align without clicks, where the scan is not of the photos' room: nothing may be trusted.

Takes the sets of trust_sets.py: models of the kitchen (all cases called kitchen* without picks of their own) on the
scans of other sets and mirrored, simulated models on the kitchen's scan, and models that are blurred, bent or have a
wrong lens on scans of rooms of the same plan and of similar size, which it simulates. Prints a line for each, and how
many starts were drawn to the photos is not told apart: the verdict is what counts.

  tests/benchmark/trust/wrong_rooms.py --bin build/bin SETS

With --captures, FOLDER is that of random_captures.py: every model on the scans of the next captures, --neighbours of
them, and on its own scan mirrored where that is one .rtpi.

  tests/benchmark/trust/wrong_rooms.py --bin build/bin --captures FOLDER
"""

import argparse
import json
import os
import subprocess

from trust_table import align

OTHERS = ("s2", "big", "bent", "desk", "floor")
ON_KITCHEN = ("s2", "big", "bent", "blur")
# Rooms of the same plan, or of similar size (the models' are 5.0 x 4.0 m).
NEIGHBOURS = {
    "p1": ["--random_seed", "1006"],
    "p2": ["--random_seed", "2006"],
    "p3": ["--random_seed", "3006", "--room_width", "5.2", "--room_depth", "4.1"],
    "q1": ["--random_seed", "1009", "--bend", "0.005"],
    "q2": ["--random_seed", "2009", "--bend", "0.005"],
    "q3": ["--random_seed", "3009", "--bend", "0.008", "--room_width", "5.2"],
}
ON_NEIGHBOURS = {"p": ("blur", "s2_long3", "s2_each"), "q": ("bent", "blur")}


def simulate(sets, tools):
    scans = {}
    for name, options in NEIGHBOURS.items():
        folder = os.path.join(sets, "wrong", name)
        scans[name] = os.path.join(folder, "scan.rtpi")
        if not os.path.exists(scans[name]):
            os.makedirs(folder, exist_ok=True)
            subprocess.run([os.path.join(tools, "roomtex-simulate"), "--output_path", folder, "--quiet", "1",
                            "--num_photos", "3", "--photo_width", "300", "--photo_height", "200", *options],
                           check=True, stdout=subprocess.DEVNULL)
    return scans


def pairs(cases, neighbours):
    """title, case, scans and options that are not its own."""
    wanted = {*OTHERS, *ON_KITCHEN, *(name for names in ON_NEIGHBOURS.values() for name in names), "kitchen"}
    for missing in sorted(wanted - set(cases)):
        print(f"no set {missing}: its pairs are left out")
    kitchens = [n for n in cases if n.startswith("kitchen") and "picks" not in n]
    for kitchen in kitchens:
        for other in filter(cases.get, OTHERS):
            yield f"{kitchen} on {other}", cases[kitchen], cases[other]["scans"][:1], []
        yield f"{kitchen} mirrored", cases[kitchen], cases[kitchen]["scans"], ["--azimuth", "clockwise"]
    for name in filter(cases.get, ON_KITCHEN if "kitchen" in cases else ()):
        yield f"{name} on kitchen", cases[name], cases["kitchen"]["scans"], []
    for room, scan in neighbours.items():
        for name in filter(cases.get, ON_NEIGHBOURS[room[0]]):
            yield f"{name} on {room}", cases[name], [scan], []


def capture_cases(folder):
    """The first model of every capture that has one, with its photos and scans."""
    cases = []
    for seed in sorted((name for name in os.listdir(folder) if name.isdigit()), key=int):
        capture = os.path.join(folder, seed, "capture")
        model = os.path.join(folder, seed, "result", "sparse", "0")
        if not os.path.exists(os.path.join(model, "images.bin")):
            continue
        scans = sorted(name for name in os.listdir(capture) if name.endswith(".rtpi"))
        poses = os.path.join(capture, "scan_poses.txt")
        cases.append({"name": seed, "model": model, "photos": os.path.join(capture, "photos"),
                      "scans": [os.path.join(capture, name) for name in scans],
                      "poses": ["--scan_poses", poses] if len(scans) > 1 else []})
    return cases


def capture_pairs(cases, neighbours):
    for i, case in enumerate(cases):
        for k in range(1, neighbours + 1):
            other = cases[(i + k) % len(cases)]
            yield f"{case['name']} on {other['name']}", case, other["scans"], other["poses"]
        if not case["poses"]:
            yield f"{case['name']} mirrored", case, case["scans"], ["--azimuth", "counterclockwise"]


def pairs_of(args):
    if args.captures:
        return capture_pairs(capture_cases(args.captures), args.neighbours)
    cases = {}
    for file in sorted(os.listdir(args.sets)):
        if file.endswith(".case.json"):
            case = json.load(open(os.path.join(args.sets, file)))
            cases[case["name"]] = case
    return pairs(cases, simulate(args.sets, args.bin))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--out", default="/tmp/wrong_rooms")
    parser.add_argument("--captures", help="folder of random_captures.py, instead of sets")
    parser.add_argument("--neighbours", type=int, default=1, help="captures on whose scans each model is tried")
    parser.add_argument("sets", nargs="?", help="folder of trust_sets.py")
    args = parser.parse_args()
    if not args.captures and not args.sets:
        parser.error("a folder is needed: that of trust_sets.py, or --captures FOLDER")
    args.without_picks, args.option = True, []
    num, trusted, unasked = 0, 0, 0
    for title, case, scans, options in pairs_of(args):
        out = os.path.join(args.out, title.replace(" ", "_"))
        os.makedirs(out, exist_ok=True)
        code, report, _, message = align({**case, "scans": scans, "options": options}, args, out)
        search = report.get("search") or {}
        num += 1
        trusted += code == 0
        unasked += code not in (0, 4)
        print(f"{title}: exit {code}, {search.get('verdict', message)}, {search.get('ratio', 0):.2f} times the next",
              flush=True)
    # Not refused but not asked: a file that is missing, an option that is gone.
    print(f"{num} wrong rooms, {trusted} trusted, {unasked} without a verdict (exit neither 0 nor 4)")


if __name__ == "__main__":
    main()
