#!/usr/bin/env python3
"""How often roomtex-align places photos that have neither a sparse model nor picks, each alone, and how far they are
off: the real sets of a folder `data` (kitchen, desk, iphone_floor) and simulated rooms with known truth, a laser's and
a depth camera's scan. Then the photos of one simulated room on the scans of others of the same plan, and on the mirror
image of their own: there nothing may be placed. A Markdown table.

  tests/benchmark/auto_align/photos_alone_table.py --bin build/bin --out DIR [--data DATA] [--first SEED] [--rooms N]
    [--kinds laser ...]
"""

import argparse
import json
import os
import subprocess
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "trust"))
from trust_table import errors_of, median, read_poses_binary, read_truth  # noqa: E402

# name: camera model, parameters, folder of the photos.
REAL = {
    "kitchen": ("SIMPLE_RADIAL", "525.9,320,240,-0.025", "images"),
    "desk": ("OPENCV", "524.544,523.949,318.603,255.33,0.0359359,0.00176108,-0.00554649,0.0025468", "photos"),
    "iphone_floor": ("PINHOLE", "1453.54,1453.54,973.7,715.2", "photos"),
}
CAPTURE = ["--photo_width", "640", "--photo_height", "480", "--photo_noise", "3", "--blur_px", "0.6"]
KINDS = {
    "laser": ["--scan_columns", "1600", "--scan_rows", "600"],
    "coarse laser": ["--scan_columns", "800", "--scan_rows", "340"],
    "depth camera": ["--scan_columns", "800", "--scan_rows", "340", "--depth_camera", "1"],
    # Photos held in any way, and nothing that says so.
    "rolled": ["--scan_columns", "1600", "--scan_rows", "600", "--roll_deg", "180"],
}


def real_cases(data):
    for name, (model, params, photos) in REAL.items():
        folder = os.path.join(data, name)
        if os.path.exists(folder):
            yield name, {
                "photos": os.path.join(folder, photos), "scan": os.path.join(folder, "scan.rtpi"),
                "azimuth": "counterclockwise", "model": model, "params": params,
                "truth": os.path.join(folder, "reference_poses.txt"),
                "scan_to_world": os.path.join(folder, "scan_to_world.txt")}


def simulated_case(args, seed, kind, num_photos=12):
    folder = os.path.join(args.out, "rooms", f"{kind.replace(' ', '_')}_{seed}")
    if not os.path.exists(os.path.join(folder, "truth")):
        subprocess.run([os.path.join(args.bin, "roomtex-simulate"), "--output_path", folder, "--quiet", "1",
                        "--random_seed", str(seed), "--num_photos", str(num_photos), *CAPTURE, *KINDS[kind]],
                       check=True, stdout=subprocess.DEVNULL)
    words = open(os.path.join(folder, "cameras.txt")).read().splitlines()[-1].split()
    return {"photos": os.path.join(folder, "photos"), "scan": os.path.join(folder, "scan.rtpi"), "azimuth": "clockwise",
            "model": words[1], "params": ",".join(words[4:]), "truth": os.path.join(folder, "truth", "images.txt")}


def align(args, name, case, scan=None, azimuth=None, camera=True):
    out = os.path.join(args.out, "aligned", name.replace(" ", "_").replace(",", ""))
    for folder in (out, out + ".untrusted"):
        for stale in ("alignment.json", "images.bin"):
            if os.path.exists(os.path.join(folder, stale)):
                os.remove(os.path.join(folder, stale))
    os.makedirs(out, exist_ok=True)
    command = [os.path.join(args.bin, "roomtex-align"), "--image_path", case["photos"], "--scan_path",
               scan or case["scan"], "--azimuth", azimuth or case["azimuth"], "--output_path", out, "--quiet", "1"]
    if camera:
        command += ["--camera_model", case["model"], "--camera_params", case["params"]]
    code = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
    return code, json.load(open(os.path.join(out, "alignment.json"))), out


def row(args, name, case, **how):
    code, report, out = align(args, name, case, **how)
    photos = report["search"]["photos"]
    others = sorted((p for p in photos if not p["placed"]), key=lambda p: -p["num_cells"])
    least = min((p["share"] for p in photos if p["placed"]), default=None)
    fewest = min((p["num_cells"] for p in photos if p["placed"]), default=None)
    placed = [p["name"] for p in photos if p["placed"]]
    off, turn, said = [], [], []
    if placed and not how.get("scan") and not how.get("azimuth"):
        truth, found = read_truth(case), read_poses_binary(os.path.join(out, "images.bin"))
        sigma = {one["name"]: one["position_sigma_mm"] for one in report["images"]}
        for photo in placed:
            if photo in truth:
                error = errors_of(found[photo], truth[photo])
                off.append(1000 * error[0])
                turn.append(error[1])
                said.append(sigma[photo])
    below = [sum(o < k * s for o, s in zip(off, said)) for k in (1, 2, 3)]
    print("| {} | {} of {} | {} | {} | {:.0f} / {:.0f} | {:.1f} | {:.0f} | {} | {} |".format(
        name, len(placed), len(photos), f"{fewest}, {100 * least:.0f} %" if placed else "",
        ", ".join(f"{p['num_cells']} ({100 * p['share']:.0f} %)" for p in others[:2]),
        median(off), max(off, default=float("nan")), median(turn), median(said), ", ".join(map(str, below)), code))
    sys.stdout.flush()
    return len(placed), len(photos)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--out", required=True)
    parser.add_argument("--data", default="")
    parser.add_argument("--first", type=int, default=171)
    parser.add_argument("--rooms", type=int, default=3)
    parser.add_argument("--kinds", nargs="*", default=list(KINDS), choices=list(KINDS))
    args = parser.parse_args()
    print("| case | placed | fewest cells, least share | most cells left out | off, median / worst, mm | degrees | said, mm "
          "| < 1, 2, 3 x | exit |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, case in real_cases(args.data):
        row(args, name, case)
    seeds = range(args.first, args.first + args.rooms)
    for kind in args.kinds:
        for seed in seeds:
            row(args, f"{kind}, {seed}", simulated_case(args, seed, kind))
    wrong = [0, 0]
    for kind in args.kinds:
        for seed in seeds:
            case = simulated_case(args, seed, kind)
            scans = [(f"on {other}", {"scan": simulated_case(args, other, kind)["scan"]})
                     for other in seeds if other != seed]
            for title, how in [("mirrored", {"azimuth": "counterclockwise"}), *scans]:
                placed, photos = row(args, f"{kind}, {seed} {title}", case, **how)
                wrong = [wrong[0] + placed, wrong[1] + photos]
    for name, case in real_cases(args.data):
        placed, photos = row(args, f"{name} mirrored", case, azimuth="clockwise")
        wrong = [wrong[0] + placed, wrong[1] + photos]
    print(f"\nOf {wrong[1]} photos on scans that are not of their room {wrong[0]} were placed.")


if __name__ == "__main__":
    main()
