#!/usr/bin/env python3
"""roomtex-align by picks, where the scan is of another room of the same plan and furniture: do the photos tell?

Takes simulated sets of trust_sets.py, of rooms of one size: the model of each, with picks of one of its photos on the
scan of each other one, where the photo has them; first each on its own scan, by its own picks. Prints a row for each:
exit code, `shown_share` and `share` of the report's agreement.gradient_shift, and how far model and scan differ in shape.

  tests/benchmark/trust/rooms_of_one_plan.py --bin build/bin SETS bent shaken strangers

With --captures, SETS is the folder of random_captures.py and the names are its seeds: the model of each on its own
first scan and on those of --others more rooms of its plan, which are simulated; also without picks.

  tests/benchmark/trust/rooms_of_one_plan.py --bin build/bin --captures 1 FOLDER 120 220
"""

import argparse
import json
import os
import re
import subprocess

from trust_sets import full_opencv, make_picks
from trust_table import align, multiply, read_poses_text, rotation_of


def read_rigid(path):
    """Of a line of scale, quaternion and translation, the scale left out: a 4x4 matrix."""
    numbers = [float(word) for line in open(path) if not line.startswith("#") for word in line.split()]
    r = rotation_of(*numbers[1:5])
    return [r[i] + [numbers[5 + i]] for i in range(3)] + [[0, 0, 0, 1]]


def inverse(m):
    r = [[m[j][i] for j in range(3)] for i in range(3)]
    return [r[i] + [-sum(r[i][k] * m[k][3] for k in range(3))] for i in range(3)] + [[0, 0, 0, 1]]


def picks_on(sets, tools, case, other, path):
    """Picks of the photo that the capture's own are of, on the scan of the set `other`."""
    capture, there = os.path.dirname(case["picks"]), os.path.join(sets, other, "capture")
    ply = os.path.join(sets, other, "scan.ply")
    if not os.path.exists(ply):
        subprocess.run([os.path.join(tools, "roomtex-import"), "--quiet", "1", "--input_path", there + "/scan.rtpi",
                        "--output_path", ply], check=True, stdout=subprocess.DEVNULL)
    photo = next(line for line in open(case["picks"]) if line.startswith("photo")).split(",")[0]
    words = next(line for line in open(capture + "/cameras.txt") if not line.startswith("#")).split()
    size, camera = [int(word) for word in words[2:4]], full_opencv(words[1], [float(word) for word in words[4:]])
    own_from_other = multiply(read_rigid(capture + "/truth/scan_from_room.txt"),
                              inverse(read_rigid(there + "/truth/scan_from_room.txt")))
    pose = multiply(read_poses_text(case["truth"])[photo], own_from_other)
    make_picks(path, ply, pose, photo, camera, size, seed=1)


def capture_case(sets, seed):
    folder = os.path.join(sets, seed)
    capture = os.path.join(folder, "capture")
    return {"model": os.path.join(folder, "result", "sparse", "0"), "photos": capture + "/photos",
            "picks": capture + "/picks.csv", "truth": capture + "/truth/images.txt", "scans": [capture + "/scan.rtpi"]}


def simulate_other(sets, tools, seed, number):
    """The scan of another room of a random capture's plan: its name as one of the sets."""
    name = os.path.join("plan", f"{seed}_{number}")
    capture = os.path.join(sets, name, "capture")
    if not os.path.exists(capture + "/scan.rtpi"):
        log = open(os.path.join(sets, seed, "log.txt"), errors="replace").read()
        words = re.search(r"roomtex-simulate (.*)", log).group(1).split()
        options = dict(zip(words[0::2], words[1::2]))
        options.update({"--output_path": capture, "--random_seed": str(1000 * number + int(seed)), "--num_photos": "3",
                        "--photo_width": "300", "--photo_height": "200", "--quiet": "1"})
        os.makedirs(os.path.join(sets, name), exist_ok=True)
        subprocess.run([os.path.join(tools, "roomtex-simulate")] + [word for pair in options.items() for word in pair],
                       check=True, stdout=subprocess.DEVNULL)
    return name


def number(value, digits):
    return "-" if value is None else f"{value:.{digits}f}"


def align_on(sets, case, name, scan, without_picks, args):
    out = os.path.join(args.out, f"{name}_on_{scan}".replace("/", "_"))
    os.makedirs(out, exist_ok=True)
    case = dict(case)
    if scan != name:
        picks = out + ".csv"
        picks_on(sets, args.bin, case, scan, picks)
        case.update(picks=picks, scans=[os.path.join(sets, scan, "capture", "scan.rtpi")])
    args.without_picks = without_picks
    code, report, _, message = align(case, args, out)
    shift = (report.get("agreement") or {}).get("gradient_shift", {})
    shape = (report.get("expected_error") or {}).get("disagreement_mm")
    print(f"| {name} | {scan} | {'no' if without_picks else 'yes'} | {code} | {number(shift.get('shown_share'), 3)} | "
          f"{number(shift.get('share'), 3)} | {shift.get('num_patches', '-')} | {number(shape, 1)} | "
          f"{(report.get('reason') or message)[:120]} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--out", default="/tmp/rooms_of_one_plan")
    parser.add_argument("--captures", type=int, default=0)
    parser.add_argument("--others", type=int, default=4, help="rooms of the plan of each capture")
    parser.add_argument("sets", help="folder of trust_sets.py")
    parser.add_argument("names", nargs="+", help="sets")
    args = parser.parse_args()
    args.without_picks, args.option = False, []
    sets = os.path.abspath(args.sets)
    print("| model | scan | picks | exit | shown | share | corners | differ in shape, mm | why |\n" + "|---" * 9 + "|")
    if args.captures:
        for seed in args.names:
            case = capture_case(sets, seed)
            scans = [simulate_other(sets, args.bin, seed, k + 1) for k in range(args.others)]
            for scan in [seed] + scans:
                for without_picks in (False, True):
                    align_on(sets, case, seed, scan, without_picks, args)
        return
    cases = {name: json.load(open(os.path.join(sets, name + ".case.json"))) for name in args.names}
    for name, scan in sorted(((a, b) for a in cases for b in cases), key=lambda pair: (pair[0] != pair[1], pair)):
        align_on(sets, cases[name], name, scan, False, args)


if __name__ == "__main__":
    main()
