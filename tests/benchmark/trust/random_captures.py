#!/usr/bin/env python3
"""Captures as people make them, drawn at random: rooms, lenses, hands, exposures, scanners and file formats, told to
roomtex-auto with or without a lens and clicks. A row of a Markdown table for each: what was drawn, how it ended, how
far the photos are off and what was said, and the colours. What a folder holds already is not made again.

  tests/benchmark/trust/random_captures.py --bin build/bin FOLDER --first 1 --count 10 [--until align]
"""

import argparse
import json
import os
import random
import subprocess
import sys
import time

SIZES = [(1200, 800), (1500, 1000), (1280, 960), (960, 1280), (1440, 1080)]
LENSES = ["SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV"]
FORMATS = [".rtpi", ".e57", ".ptx", ".ply", ".las", ".pts"]


def draw(seed, layouts):
    """The options of roomtex-simulate, and how the user calls roomtex-auto."""
    draws = random.Random(seed)
    chance = draws.random
    width, height = draws.choice(SIZES)
    options = {
        "random_seed": seed, "room_width": round(draws.uniform(4.6, 9), 1), "room_depth": round(draws.uniform(3.8, 8), 1),
        "room_height": round(draws.uniform(2.5, 3.6), 1), "num_photos": draws.randint(10, 32), "photo_width": width,
        "photo_height": height, "field_of_view_deg": round(draws.uniform(50, 80) * (0.8 if width < height else 1)),
        "camera_model": draws.choice(LENSES), "roll_deg": draws.choice([0, 5, 20, 60]), "shading": int(chance() < 0.7),
        "gloss": draws.choice([0, 0, 0.03, 0.06]), "finest_detail": draws.choice([0, 0, 0.01]),
        "exposure_range_ev": draws.choice([0, 1, 2]), "exif": int(chance() < 0.5),
        "photo_noise": draws.choice([1, 3, 6]), "blur_px": draws.choice([0, 0.7, 1.5]),
        "response": draws.choice(["srgb", "film"]), "vignetting": draws.choice([0, 0.2, 0.4]),
        "white_balance_ev": draws.choice([0, 0.2]), "strangers": draws.choice([0, 0, 0, 0.2]),
        "scan_columns": draws.choice([1000, 1600, 2400]), "range_noise": draws.choice([0.001, 0.002, 0.004]),
        "num_stations": draws.choice([1, 1, 2, 3]),
    }
    options["scan_rows"] = int(options["scan_columns"] * 0.375)
    if chance() < 0.3:
        options.update(motion_px=draws.choice([2, 5]), blurred=0.3)
    if width >= height and chance() < 0.4:
        options["rolling_shutter_ms"] = draws.choice([10, 20, 30])
    if chance() < 0.15:
        options["bare_walls"] = 1
    kind = chance()
    if kind < 0.25:
        options.update(depth_camera=1, num_stations=1, scan_columns=800, scan_rows=340, range_noise=0.002)
    elif kind < 0.4:
        options.update(bend=0.003, azimuth_drift_deg=0.2)
    told = draws.choice(["lens", "exif", "nothing"])
    if told == "exif":
        options.update(exif=1, exif_lens=1)
    if layouts:
        options["layout_seed"] = seed
    return options, told, draws.random() < 0.5, draws.choice(FORMATS)


def run(folder, tools, *words, codes=(0,)):
    with open(os.path.join(folder, "log.txt"), "a") as log:
        log.write("$ " + " ".join(words) + "\n")
        log.flush()
        code = subprocess.run([os.path.join(tools, words[0]), *words[1:]], stdout=log, stderr=log).returncode
    if codes is not None and code not in codes:
        sys.exit("%s ended with %d, see %s/log.txt" % (words[0], code, folder))
    return code


def scans_of(folder, tools, extension):
    """The capture's scans, in another format if that is asked for; --scan_poses where there are several."""
    capture = os.path.join(folder, "capture")
    scans = sorted(name for name in os.listdir(capture) if name.endswith(".rtpi"))
    if extension == ".rtpi" or len(scans) > 1:
        poses = os.path.join(capture, "scan_poses.txt")
        return [os.path.join(capture, name) for name in scans], poses if os.path.exists(poses) else None
    path = os.path.join(folder, "scan" + extension)
    if not os.path.exists(path):
        run(folder, tools, "roomtex-import", "--input_path", os.path.join(capture, scans[0]), "--output_path", path)
    if extension != ".e57":
        return [path], None
    # An E57 has its z up; the truth is in the frame of the capture.
    poses = os.path.join(folder, "poses.txt")
    with open(poses, "w") as file:
        file.write("scan.e57 1 0 0 0  0 0 1 0  0 -1 0 0  0 0 0 1\n")
    return [path], poses


def measure(folder, tools, seed, until, layouts):
    options, told, clicks, extension = draw(seed, layouts)
    capture, result = os.path.join(folder, "capture"), os.path.join(folder, "result")
    os.makedirs(folder, exist_ok=True)
    if not os.path.exists(os.path.join(capture, "truth")):
        run(folder, tools, "roomtex-simulate", "--output_path", capture,
            *[word for name, value in options.items() for word in ("--" + name, str(value))])
    scans, poses = scans_of(folder, tools, extension)
    words = ["--image_path", os.path.join(capture, "photos"), "--output_path", result, "--quality", "low"]
    words += [word for scan in scans for word in ("--scan_path", scan)]
    words += ["--scan_poses", poses] if poses else []
    words += ["--cameras_path", os.path.join(capture, "cameras.txt")] if told == "lens" else []
    words += ["--picks_path", os.path.join(capture, "picks.csv")] if clicks else []
    words += ["--until", until] if until else []
    start = time.time()
    code = run(folder, tools, "roomtex-auto", *words, codes=None)
    seconds = time.time() - start
    drawn = "%d photos %dx%d %s, %s, %s, %s" % (
        options["num_photos"], options["photo_width"], options["photo_height"], options["camera_model"],
        {"lens": "told", "exif": "by EXIF", "nothing": "not told"}[told], "clicks" if clicks else "no clicks",
        "depth camera" if "depth_camera" in options else "laser x %d" % options["num_stations"])
    drawn += "".join(", " + word for word in ("bend", "bare_walls", "rolling_shutter_ms", "motion_px") if word in options)
    drawn += ", strangers" if options["strangers"] else ""
    drawn += ", EXIF" if options["exif"] else ""
    drawn += ", " + os.path.splitext(scans[0])[1][1:]
    aligned = os.path.join(result, "aligned")
    off, said, color = "–", "–", "–"
    model = os.path.join(result, "textured", "model.ply")
    if os.path.exists(os.path.join(aligned, "images.bin")):
        words = [os.path.join(tools, "roomtex-evaluate"), "--truth_path", os.path.join(capture, "truth"),
                 "--input_path", aligned]
        colors = ["--ply_path", model] if os.path.exists(model) else []
        answer = subprocess.run(words + colors, capture_output=True, text=True)
        if answer.returncode != 0:  # formats without a grid may have fewer samples
            answer = subprocess.run(words, capture_output=True, text=True)
        if answer.returncode == 0:
            answer = json.loads(answer.stdout)
            off = "%.1f / %.1f, %d" % (answer["poses"]["position_median_mm"], answer["poses"]["position_max_mm"],
                                       answer["poses"]["num_registered"])
            # Colours are compared vertex by vertex, which formats without a grid may have in another order.
            same_order = answer.get("color", {}).get("vertex_distance_max_m", 1) < 0.01
            color = "%.1f" % answer["color"]["psnr_db"] if same_order else "–"
        else:
            off = answer.stderr.strip()[:100]
        report = json.load(open(os.path.join(aligned, "alignment.json")))
        said = "%.1f" % report["expected_error"]["at_cameras_mm"] if report.get("expected_error") else "–"
    reason = ""
    if os.path.exists(os.path.join(result, "report.json")):
        verdict = json.load(open(os.path.join(result, "report.json")))["verdict"]
        reason = verdict["state"] + ": " + " ".join(verdict["sentences"])[:160]
    return "| %d | %s | %d | %s | %s | %s | %.0f | %s |" % (seed, drawn, code, off, said, color, seconds, reason)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--until", default="")
    parser.add_argument("--layouts", type=int, default=0, help="1: furniture, places of photos and scanners are drawn, too")
    args = parser.parse_args()
    os.environ["QT_QPA_PLATFORM"] = "offscreen"
    print("| seed | drawn | exit | off, median / worst, mm, photos | said, mm | PSNR, dB | seconds | verdict |")
    print("|---|---|---|---|---|---|---|---|")
    for seed in range(args.first, args.first + args.count):
        try:
            print(measure(os.path.join(os.path.abspath(args.folder), str(seed)), os.path.abspath(args.bin), seed,
                          args.until, args.layouts), flush=True)
        except SystemExit as failure:
            print("| %d | %s |" % (seed, failure), flush=True)


if __name__ == "__main__":
    main()
