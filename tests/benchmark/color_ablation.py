#!/usr/bin/env python3
"""What each part of the colouring contributes: roomtex-texture with one switch changed at a time,
judged by roomtex-evaluate on simulated captures. Prints a Markdown table per capture and poses.

  roomtex-simulate --seed 1 --reachable 1 --output_path capture
  tests/benchmark/color_ablation.py --bin build/bin capture capture/truth
  tests/benchmark/color_ablation.py --bin build/bin capture aligned
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile

THESIS = (
    "--Occlusion.depth_tolerance 0.008 --Occlusion.shadows 0 --Blend.angle_weight 0 "
    "--Blend.resolution_weight 0 --Blend.sharpness_weight 0 --Blend.outlier 0 --Blend.detail 1 "
    "--Surface.reduce_range_noise 0 --Exposure.mode exif --Registration.mode none"
)

ROWS = [
    ("default", ""),
    ("thesis throughout", THESIS),
    ("thesis without detail", THESIS.replace("--Blend.detail 1", "--Blend.detail 0")),
    ("measured points (no reduce_range_noise)", "--Surface.reduce_range_noise 0"),
    ("depth_tolerance 0.008", "--Occlusion.depth_tolerance 0.008"),
    ("no shadows and fringes", "--Occlusion.shadows 0"),
    ("no depth-boundary band (boundary_px 0)", "--Occlusion.boundary_px 0"),
    ("wide band (boundary_px 4)", "--Occlusion.boundary_px 4"),
    ("boundary_jump 0.02", "--Occlusion.boundary_jump 0.02"),
    ("poses corrected", "--Registration.mode pose"),
    ("no angle_weight", "--Blend.angle_weight 0"),
    ("no resolution_weight", "--Blend.resolution_weight 0"),
    ("no outlier rejection", "--Blend.outlier 0"),
    ("detail of the dominant photo", "--Blend.detail 1"),
    ("averaged over the cell (footprint 1)", "--Blend.footprint 1"),
    ("3 photos a sample", "--Blend.max_views 3"),
    ("exposure by EXIF alone", "--Exposure.mode exif"),
    ("exposure as photographed", "--Exposure.mode none"),
]


def run(words):
    """Runs a command, gives its stdout and its CPU seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(words, stdout=subprocess.PIPE, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.stdout, cpu


def judge(args, ply):
    scan = os.path.join(args.capture, "scan.rtpi")
    out, _ = run([os.path.join(args.bin, "roomtex-evaluate"), "--quiet", "--truth_path",
                  os.path.join(args.capture, "truth"), "--scan_path", scan, "--ply_path", ply])
    return json.loads(out)


def line(name, answer, cpu):
    c = answer["color"]
    print("| {} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.3f} / {:.3f} | {:.4f} | {:.2f} | {} |".format(
        name, c["psnr_db"], answer["color_of_cells"]["psnr_db"], 100 * c["share_wrong"],
        100 * c["edge_share_wrong"], c["detail_slope"], c["detail_correlation"],
        c["low_frequency_error"], 100 * c["coverage_of_seen"],
        "" if cpu is None else "{:.1f}".format(cpu)))
    sys.stdout.flush()


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", default="build/bin", help="folder of the built commands")
    parser.add_argument("--rows", default="", help="only rows whose name holds this")
    parser.add_argument("capture", help="folder of roomtex-simulate, with truth/")
    parser.add_argument("model", help="COLMAP model in the scan frame, e.g. capture/truth")
    args = parser.parse_args()
    print("| | PSNR dB | of cells | wrong % | near edges % | detail slope / corr. | low | "
          "seen % | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|")
    reachable = os.path.join(args.capture, "truth", "reachable.ply")
    if os.path.exists(reachable):
        line("reachable: true places, visibility, exposure, plain mean", judge(args, reachable), None)
    for name, options in ROWS:
        if args.rows not in name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            _, cpu = run([os.path.join(args.bin, "roomtex-texture"), "--quiet", "--input_path",
                          args.model, "--image_path", os.path.join(args.capture, "photos"),
                          "--scan_path", os.path.join(args.capture, "scan.rtpi"), "--output_path",
                          folder, "--Texture.scale", "1"] + options.split())
            line(name + (" `" + options + "`" if options and name[:6] != "thesis" else ""),
                 judge(args, os.path.join(folder, "model.ply")), cpu)


if __name__ == "__main__":
    main()
