#!/usr/bin/env python3
"""How far the trust of roomtex-align can be trusted: every case of trust_sets.py is aligned, compared with its truth
or reference, and printed as a row of a Markdown table (docs/real-rooms.md); last, in how many photos the true error
lay below one, two and three times the expected one.

  tests/benchmark/trust/trust_sets.py --bin build/bin SETS --data DATA   # captures, databases, models (an hour)
  tests/benchmark/trust/trust_table.py --bin build/bin SETS [NAME...]
"""

import argparse
import json
import math
import os
import struct
import subprocess
import sys


def multiply(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(len(b))) for j in range(len(b[0]))] for i in range(len(a))]


def rotation_of(w, x, y, z):
    n = math.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / n, x / n, y / n, z / n
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def pose_of(numbers):
    """cam_from_frame as a 4x4 matrix of seven numbers: quaternion w x y z, translation."""
    r = rotation_of(*numbers[:4])
    return [r[i] + [numbers[4 + i]] for i in range(3)] + [[0, 0, 0, 1]]


def read_poses_text(path):
    poses = {}
    for line in open(path):
        words = line.split()
        if len(words) == 10 and not line.startswith("#"):
            poses[words[9]] = pose_of([float(w) for w in words[1:8]])
    return poses


def read_poses_binary(path):
    data = open(path, "rb").read()
    (count,), at = struct.unpack_from("<Q", data), 8
    poses = {}
    for _ in range(count):
        numbers = struct.unpack_from("<7d", data, at + 4)
        at += 64
        end = data.index(b"\0", at)
        name = data[at:end].decode()
        (points,) = struct.unpack_from("<Q", data, end + 1)
        at = end + 9 + 24 * points
        poses[name] = pose_of(numbers)
    return poses


def centre_of(pose):
    return [-sum(pose[k][i] * pose[k][3] for k in range(3)) for i in range(3)]


def read_truth(case):
    """cam_from_scan of every photo by name."""
    poses = read_poses_text(case["truth"])
    if "scan_to_world" in case:
        rows = [line.split() for line in open(case["scan_to_world"]) if not line.startswith("#")]
        world_from_scan = [[float(w) for w in row] for row in rows if len(row) == 4]
        poses = {name: multiply(pose, world_from_scan) for name, pose in poses.items()}
    return poses


def errors_of(found, true):
    """Metres and degrees."""
    a, b = centre_of(found), centre_of(true)
    trace = sum(found[i][k] * true[i][k] for i in range(3) for k in range(3))
    return math.dist(a, b), math.degrees(math.acos(max(-1.0, min(1.0, (trace - 1) / 2))))


def median(values):
    values = sorted(values)
    return values[len(values) // 2] if values else float("nan")


def align(case, args, out):
    command = [os.path.join(args.bin, "roomtex-align"), "--output_path", out]
    for model in case["model"] if isinstance(case["model"], list) else [case["model"]]:
        command += ["--input_path", model]
    for scan in case["scans"]:
        command += ["--scan_path", scan]
    if not args.without_picks:
        command += ["--picks_path", case["picks"]]
    command += ["--image_path", case["photos"], "--quiet", "1"]
    if "database" in case:
        command += ["--database_path", case["database"]]
    command += ["--num_threads", "1"] + case.get("options", []) + args.option
    for stale in ("alignment.json", "images.bin"):
        for folder in (out, out + ".untrusted"):
            if os.path.exists(os.path.join(folder, stale)):
                os.remove(os.path.join(folder, stale))
    run = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if not os.path.exists(os.path.join(out, "alignment.json")) and os.path.exists(out + ".untrusted"):
        out += ".untrusted"
    report = {}
    if os.path.exists(os.path.join(out, "alignment.json")):
        report = json.load(open(os.path.join(out, "alignment.json")))
    return run.returncode, report, out, run.stderr.strip()


def score(case, args):
    name = case["name"]
    out = os.path.join(args.out, name)
    os.makedirs(out, exist_ok=True)
    code, report, folder, message = align(case, args, out)
    row = {"name": name, "exit": code, "reason": report.get("reason") or message, "limit": case["right_mm"]}
    row["warnings"] = report.get("warnings", [])
    if not os.path.exists(os.path.join(folder, "images.bin")):
        return row
    truth = read_truth(case)
    found = read_poses_binary(os.path.join(folder, "images.bin"))
    sigmas = {one["name"]: one for one in report.get("images", [])}
    row["photos"] = []
    for photo, pose in found.items():
        if photo not in truth:
            continue
        off, turn = errors_of(pose, truth[photo])
        sigma = sigmas.get(photo, {})
        expected = sigma.get("position_sigma_mm")
        if expected is None:
            expected = report["expected_error"]["at_cameras_mm"]
        row["photos"].append((photo, 1000 * off, turn, expected))
    row["said"] = report["expected_error"]["at_cameras_mm"]
    row["registered"] = len(found)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--out", default="/tmp/trust_table")
    parser.add_argument("--without_picks", action="store_true", help="align automatically")
    parser.add_argument("--option", action="append", default=[], help="passed on to roomtex-align")
    parser.add_argument("--photos", action="store_true", help="a line per photo as well")
    parser.add_argument("sets", help="folder of trust_sets.py")
    parser.add_argument("names", nargs="*", help="cases to run; none = all")
    args = parser.parse_args()
    cases = []
    for file in sorted(os.listdir(args.sets)):
        if file.endswith(".case.json"):
            cases.append(json.load(open(os.path.join(args.sets, file))))
    cases = [c for c in cases if not args.names or any(c["name"].startswith(n) for n in args.names)]
    print("| case | registered | off, median / worst, mm | degrees | expected, mm | exit | right | < 1, 2, 3 x | why |")
    print("|---|---|---|---|---|---|---|---|---|")
    below, photos, wrong, judged = [0, 0, 0], 0, 0, 0
    for case in cases:
        row = score(case, args)
        told = row.get("photos", [])
        off = median([p[1] for p in told])
        # Any other exit is no verdict: a file that is missing, photos that are not in the model.
        is_judged = bool(told) and row["exit"] in (0, 4)
        is_right = (off <= row["limit"]) == (row["exit"] == 0)
        judged += is_judged
        wrong += is_judged and not is_right
        shares = [sum(p[3] is not None and p[1] < k * p[3] for p in told) for k in (1, 2, 3)]
        if row["exit"] == 0:
            below = [b + s for b, s in zip(below, shares)]
            photos += len(told)
        said = row.get("said")
        print("| {} | {} | {:.1f} / {:.1f} | {:.2f} | {} | {} | {} | {} of {} | {} |".format(
            row["name"], row.get("registered", 0), off, max([p[1] for p in told], default=float("nan")),
            median([p[2] for p in told]), "-" if said is None else round(said, 1), row["exit"],
            ("yes" if is_right else "**NO**") if is_judged else "-", ", ".join(map(str, shares)), len(told),
            (row["reason"] or "; ".join(row["warnings"])).replace("\n", " ")[:400]))
        if args.photos:
            for p in row.get("photos", []):
                print("  {} {:.1f} mm {:.2f} deg, expected {}".format(*p))
        sys.stdout.flush()
    if photos:
        print("\nTrusted photos: {}; below 1, 2, 3 times the expected error: {} %.".format(
            photos, ", ".join(str(round(100 * b / photos)) for b in below)))
    print("\nWrong verdicts: {} of {}; cases without one: {}.".format(wrong, judged, len(cases) - judged))


if __name__ == "__main__":
    main()
