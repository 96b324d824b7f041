#!/usr/bin/env python3
"""roomtex-align by picks, where the scan is of another room of the same plan and furniture: do the photos tell?

Takes simulated sets of trust_sets.py, of rooms of one size: the model of each, with picks of one of its photos on the
scan of each other one, where the photo has them; first each on its own scan, by its own picks. Prints a row for each:
exit code, `shown_share` and `share` of the report's agreement.gradient_shift, and how far model and scan differ in shape.

  tests/benchmark/trust/rooms_of_one_plan.py --bin build/bin SETS bent shaken strangers
"""

import argparse
import json
import os
import subprocess

from trust_sets import make_picks
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
    size, camera = [int(word) for word in words[2:4]], [float(word) for word in words[4:12]]
    own_from_other = multiply(read_rigid(capture + "/truth/scan_from_room.txt"),
                              inverse(read_rigid(there + "/truth/scan_from_room.txt")))
    pose = multiply(read_poses_text(case["truth"])[photo], own_from_other)
    make_picks(path, ply, pose, photo, camera, size, seed=1)


def number(value, digits):
    return "-" if value is None else f"{value:.{digits}f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--out", default="/tmp/rooms_of_one_plan")
    parser.add_argument("sets", help="folder of trust_sets.py")
    parser.add_argument("names", nargs="+", help="sets")
    args = parser.parse_args()
    args.without_picks, args.option = False, []
    sets = os.path.abspath(args.sets)
    cases = {name: json.load(open(os.path.join(sets, name + ".case.json"))) for name in args.names}
    print("| model | scan | exit | shown | share | differ in shape, mm | why |\n|---|---|---|---|---|---|---|")
    for name, scan in sorted(((a, b) for a in cases for b in cases), key=lambda pair: (pair[0] != pair[1], pair)):
        case = dict(cases[name])
        out = os.path.join(args.out, f"{name}_on_{scan}")
        os.makedirs(out, exist_ok=True)
        if scan != name:
            picks = os.path.join(args.out, f"{name}_on_{scan}.csv")
            picks_on(sets, args.bin, case, scan, picks)
            case.update(picks=picks, scans=cases[scan]["scans"])
        code, report, _, message = align(case, args, out)
        shift = (report.get("agreement") or {}).get("gradient_shift", {})
        shape = (report.get("expected_error") or {}).get("disagreement_mm")
        print(f"| {name} | {scan} | {code} | {number(shift.get('shown_share'), 3)} | {number(shift.get('share'), 3)} | "
              f"{number(shape, 1)} | {(report.get('reason') or message)[:120]} |", flush=True)


if __name__ == "__main__":
    main()
