#!/usr/bin/env python3
"""Two rooms with an open door between them, each registered by itself with the photos taken on the way through the
door, then joined: how far off the second room lies in the frame of the first, as a row of a Markdown table
(docs/site.md).

  tests/benchmark/scale/doorway.py --bin build/bin FOLDER [--seeds 3 4 5] [--num_photos 16]
"""

import argparse
import json
import math
import os
import shutil
import subprocess
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "trust"))
from trust_table import multiply, pose_of  # noqa: E402

SIZES = ["--photo_width", "960", "--photo_height", "640", "--scan_columns", "1200", "--scan_rows", "500"]


def run(folder, tools, *words):
    with open(os.path.join(folder, "log.txt"), "a") as log:
        return subprocess.run([os.path.join(tools, words[0]), *words[1:], "--quiet", "1"], stdout=log, stderr=log).returncode


def inverse(pose):
    rotation = [[pose[k][i] for k in range(3)] for i in range(3)]
    moved = [-sum(rotation[i][k] * pose[k][3] for k in range(3)) for i in range(3)]
    return [rotation[i] + [moved[i]] for i in range(3)] + [[0, 0, 0, 1]]


def place_of_second_scan(capture):
    """scan_from_station of the second scan, as it truly is."""
    for line in open(os.path.join(capture, "scan_poses.txt")):
        words = line.split()
        if words[0] == "scan_1.rtpi":
            return pose_of([float(w) for w in words[1:8]])


def door_in_first_scan(capture, width):
    """A point in the doorway, 1 m above the floor."""
    numbers = [float(w) for w in open(os.path.join(capture, "truth", "scan_from_room.txt")).read().split()[-8:]]
    return multiply(pose_of(numbers[1:]), [[width - 0.75], [-0.075], [1], [1]])


def measure(folder, tools, seed, num_photos):
    os.makedirs(folder, exist_ok=True)
    capture = os.path.join(folder, "capture")
    if not os.path.exists(capture):
        run(folder, tools, "roomtex-simulate", "--second_room", "1", "--num_photos", str(num_photos), "--random_seed",
            str(seed), "--output_path", capture, *SIZES)
    names = sorted(os.listdir(os.path.join(capture, "photos")))
    rooms = {"first": ("scan.rtpi", "picks.csv", names[:num_photos]),
             "second": ("scan_1.rtpi", "second_room_picks.csv", names[num_photos:2 * num_photos])}
    said = []
    for room, (scan, picks, photos) in rooms.items():
        images, result = os.path.join(folder, "photos_" + room), os.path.join(folder, room)
        shutil.rmtree(images, ignore_errors=True)
        os.makedirs(images)
        for name in photos + names[2 * num_photos:]:
            os.link(os.path.join(capture, "photos", name), os.path.join(images, name))
        run(folder, tools, "roomtex-auto", "--image_path", images, "--scan_path", os.path.join(capture, scan),
            "--picks_path", os.path.join(capture, picks), "--cameras_path", os.path.join(capture, "cameras.txt"),
            "--quality", "low", "--until", "align", "--output_path", result)
        report = json.load(open(os.path.join(result, "aligned", "alignment.json")))
        said.append("%s %.1f" % ("trusted," if report["trusted"] else "refused,",
                                 report["expected_error"]["at_cameras_mm"]))
    joined = os.path.join(folder, "joined")
    shutil.rmtree(joined, ignore_errors=True)
    code = run(folder, tools, "roomtex-join", "--input_path", os.path.join(folder, "first", "aligned"), "--input_path",
               os.path.join(folder, "second", "aligned"), "--output_path", joined)
    report = json.load(open(os.path.join(joined, "joined.json")))
    found = report["rooms"][1]["site_from_room"]
    row = "| %d | %s | %s |" % (seed, said[0], said[1])
    if not report["links"] or found is None:
        return row + " – | – | no | exit %s |" % code
    link = report["links"][0]
    truth = place_of_second_scan(capture)
    off = multiply(found, inverse(truth))
    door = door_in_first_scan(capture, 5.0)
    moved = multiply(off, door)
    distance = 1000 * math.dist([x[0] for x in moved[:3]], [x[0] for x in door[:3]])
    turn = math.degrees(math.acos(max(-1, min(1, (off[0][0] + off[1][1] + off[2][2] - 1) / 2))))
    return row + " %d of %d | %.1f mm, %.2f degrees | %s | %s |" % (
        link["num_agreeing"], link["num_photos"], distance, turn, "yes" if report["trusted"] else "no",
        ", ".join(view["name"] for view in link["views"] if not view["agrees"]) or "–")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--seeds", nargs="+", type=int, default=[3, 4, 5])
    parser.add_argument("--num_photos", type=int, default=16)
    args = parser.parse_args()
    os.environ["QT_QPA_PLATFORM"] = "offscreen"
    print("| seed | first room, said, mm | second room | photos that agree, of those in both | off at the door | trusted "
          "| photos named as wrong in one of the rooms |")
    print("|---|---|---|---|---|---|---|")
    for seed in args.seeds:
        print(measure(os.path.join(os.path.abspath(args.folder), str(seed)), os.path.abspath(args.bin), seed,
                      args.num_photos), flush=True)


if __name__ == "__main__":
    main()
