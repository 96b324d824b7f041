#!/usr/bin/env python3
"""What every step costs against the number of photos and of samples: CPU seconds and peak memory of the programs, as
Markdown tables (docs/scale.md), with the slope from the first column to the last one (1 = linear, 2 = square).

  tests/benchmark/scale/scale_table.py --bin build/bin FOLDER --photos 20 40 80 --samples 1 4 10

One simulated room; the sets of photos are every n-th photo of the largest set, under their own names. Steps that were
measured before (FOLDER/measured.json) are not run again.
"""

import argparse
import math
import os
import shutil
import struct

from measurements import Measurements

SMALL_DENSE = ["--max_image_size", "240"]


class Bench(Measurements):
    def __init__(self, arguments):
        super().__init__(arguments.folder, arguments.bin, "measured.json")
        self.arguments = arguments

    def run(self, curve, step, size, line, fine=(0,)):
        """Runs a program unless it was measured."""
        self.once(f"{curve} {step} {size}", lambda: self.call(line, fine))

    def simulate(self, name, photos, samples, stations=1):
        a = self.arguments
        rows = round(1000 * math.sqrt(samples / 2))
        if not os.path.exists(self.at(name, "README.txt")):
            self.call(["roomtex-simulate", "--quiet", "--seed", "7", "--output_path", self.at(name), "--num_photos",
                       str(photos), "--photo_width", str(a.width), "--photo_height", str(a.width * 2 // 3),
                       "--scan_columns", str(2 * rows), "--scan_rows", str(rows), "--num_stations", str(stations)])

    def photo_curve(self):
        a = self.arguments
        most = max(a.photos)
        self.simulate("capture", most, 2)
        names = sorted(os.listdir(self.at("capture", "photos")))
        picked = names.index(open(self.at("capture", "picks.csv")).read().split("\n")[2].split(",")[0])
        camera = open(self.at("capture", "camera_options.txt")).read().split()
        for count in a.photos:
            place = lambda *parts: self.at(f"photos_{count}", *parts)
            os.makedirs(place("photos"), exist_ok=True)
            for i in range(count):
                name = names[(picked + i * most // count) % most]
                if not os.path.exists(place("photos", name)):
                    os.link(self.at("capture", "photos", name), place("photos", name))
            threads = ["--SiftMatching.num_threads", "2", "--SiftMatching.use_gpu", "0"]
            self.run("photos", "features", count, [
                "colmap", "feature_extractor", "--database_path", place("database.db"), "--image_path", place("photos"),
                "--SiftExtraction.use_gpu", "0", "--SiftExtraction.max_num_features", str(a.features)] + camera)
            self.run("photos", "pairs", count, [
                "roomtex-pairs", "--quiet", "--database_path", place("database.db"), "--output_path",
                place("pairs.txt")])
            if count <= a.exhaustive:
                if not os.path.exists(place("all.db")):
                    shutil.copy(place("database.db"), place("all.db"))
                self.run("photos", "all pairs instead", count, [
                    "colmap", "exhaustive_matcher", "--database_path", place("all.db")] + threads)
            self.run("photos", "matches of the pairs", count, [
                "colmap", "matches_importer", "--database_path", place("database.db"), "--match_list_path",
                place("pairs.txt"), "--match_type", "pairs"] + threads)
            self.run("photos", "mapper", count, [
                "roomtex-mapper", "--quiet", "--database_path", place("database.db"), "--image_path", place("photos"),
                "--output_path", place("sparse"), "--report_path", place("mapper.json")], (0, 4))
            self.run("photos", "align", count, [
                "roomtex-align", "--quiet", "--input_path", place("sparse", "0"), "--scan_path",
                self.at("capture", "scan.rtpi"), "--picks_path", self.at("capture", "picks.csv"), "--image_path",
                self.at("capture", "photos"), "--output_path", place("aligned")], (0, 4))
            self.run("photos", "texture", count, [
                "roomtex-texture", "--quiet", "--input_path", place("aligned"), "--image_path", place("photos"),
                "--accept_untrusted", "1", "--Texture.scale", "1", "--output_path", place("textured")], (0, 4))
            self.run("photos", "pictures", count, [
                "roomtex-render", "--quiet", "--ply_path", place("textured", "model.ply"), "--input_path",
                place("aligned"), "--image_path", place("photos"), "--folder_path", place("pictures")])
            for command, options in (("export", []), ("dense", SMALL_DENSE)):
                self.run("photos", command, count, [
                    f"roomtex-{command}", "--quiet", "--input_path", place("aligned"), "--image_path", place("photos"),
                    "--accept_untrusted", "1", "--output_path", place(command)] + options, (0, 4))
                shutil.rmtree(place(command), ignore_errors=True)

    def sample_curve(self):
        for millions in self.arguments.samples:
            name = f"samples_{millions}"
            self.simulate(name, 10, millions)
            place = lambda *parts: self.at(name, *parts)
            self.run("samples", "RTPI to PLY", millions, [
                "roomtex-import", "--quiet", "--input_path", place("scan.rtpi"), "--output_path", place("scan.ply")])
            self.run("samples", "RTPI to E57", millions, [
                "roomtex-import", "--quiet", "--input_path", place("scan.rtpi"), "--output_path", place("scan.e57")])
            self.run("samples", "E57 to PNG", millions, [
                "roomtex-import", "--quiet", "--input_path", place("scan.e57"), "--output_path", place("scan.png")])
            self.texture(millions, "texture, grid", place, "scan.rtpi", [])
            self.texture(millions, "texture, cloud", place, *self.cloud(place))
            self.beside_texture(millions, "export", place, [])
            self.beside_texture(millions, "dense", place, SMALL_DENSE)
            self.run("samples", "align", millions, [
                "roomtex-align", "--quiet", "--input_path", place("truth"), "--scan_path", place("scan.rtpi"),
                "--picks_path", place("picks.csv"), "--image_path", place("photos"), "--output_path",
                place("aligned")], (0, 4))

    def texture(self, millions, step, place, scan, options):
        self.run("samples", step, millions, [
            "roomtex-texture", "--quiet", "--input_path", place("truth"), "--image_path", place("photos"),
            "--scan_path", place(scan), "--Texture.scale", "1", "--output_path", place("textured")] + options, (0, 4))
        shutil.rmtree(place("textured"), ignore_errors=True)

    def beside_texture(self, millions, command, place, options):
        self.run("samples", command, millions, [
            f"roomtex-{command}", "--quiet", "--input_path", place("truth"), "--image_path", place("photos"),
            "--scan_path", place("scan.rtpi"), "--accept_untrusted", "1", "--output_path", place(command)] + options,
            (0, 4))
        shutil.rmtree(place(command), ignore_errors=True)

    def cloud(self, place):
        """The samples as a LAS a metre off their station, so that their angles show no grid; how to put it back."""
        if not os.path.exists(place("cloud.las")):
            self.call(["roomtex-import", "--quiet", "--input_path", place("scan.rtpi"), "--output_path",
                       place("new.las")])
            with open(place("new.las"), "r+b") as stream:
                for at in (155, 179, 187):  # offset, greatest and least of x in the header
                    stream.seek(at)
                    (x,) = struct.unpack("<d", stream.read(8))
                    stream.seek(at)
                    stream.write(struct.pack("<d", x + 1))
            os.rename(place("new.las"), place("cloud.las"))
            with open(place("cloud.txt"), "w") as stream:
                stream.write("cloud.las 1 0 0 0 -1 0 0\n")
        return "cloud.las", ["--scan_poses", place("cloud.txt")]

    def station_poses(self):
        """Rotation and translation of eight stations simulated in one room; COLMAP's model of its photos."""
        self.simulate("site", 16, self.arguments.station_samples, 8)
        if not os.path.exists(self.at("site", "sparse", "0")):
            place = lambda *parts: self.at("site", *parts)
            camera = open(place("camera_options.txt")).read().split()
            self.call(["colmap", "feature_extractor", "--database_path", place("database.db"), "--image_path",
                       place("photos"), "--SiftExtraction.use_gpu", "0", "--SiftExtraction.max_num_features",
                       str(self.arguments.features)] + camera)
            self.call(["colmap", "exhaustive_matcher", "--database_path", place("database.db"),
                       "--SiftMatching.use_gpu", "0"])
            self.call(["roomtex-mapper", "--quiet", "--database_path", place("database.db"), "--image_path",
                       place("photos"), "--output_path", place("sparse")], (0, 4))
        return [line.split()[1:] for line in open(self.at("site", "scan_poses.txt")) if line.startswith("scan")]

    def stations(self, name, poses):
        """Options of a command: so many scans, those of the eight stations again and again under other names."""
        place = lambda *parts: self.at(name, *parts)
        os.makedirs(place(), exist_ok=True)
        scans = ["--scan_poses", place("poses.txt"), "--max_samples", str(round(1e6 * self.arguments.held_samples))]
        with open(place("poses.txt"), "w") as stream:
            for k, (station, pose) in enumerate(poses):
                stream.write(f"station{k}.rtpi {' '.join(pose)}\n")
                if not os.path.exists(place(f"station{k}.rtpi")):
                    scan = f"scan_{station}.rtpi" if station else "scan.rtpi"
                    os.link(self.at("site", scan), place(f"station{k}.rtpi"))
                scans += ["--scan_path", place(f"station{k}.rtpi")]
        return scans

    def align_stations(self, curve, count, scans):
        self.run(curve, "align", count, [
            "roomtex-align", "--quiet", "--input_path", self.at("site", "sparse", "0"), "--picks_path",
            self.at("site", "picks.csv"), "--output_path", self.at(f"{curve}_{count}", "aligned"), "--image_path",
            self.at("site", "photos"), "--report_path", self.at(f"{curve}_{count}", "align.json")] + scans, (0, 4))

    def station_curve(self):
        """All in one room, where each is compared with each."""
        poses = self.station_poses()
        for count in self.arguments.stations:
            scans = self.stations(f"stations_{count}", [(k % 8, poses[k % 8]) for k in range(count)])
            self.align_stations("stations", count, scans)
            textured = self.at(f"stations_{count}", "textured")
            self.run("stations", "texture", count, [
                "roomtex-texture", "--quiet", "--input_path", self.at("site", "truth"), "--Texture.scale", "1",
                "--output_path", textured, "--image_path", self.at("site", "photos")] + scans, (0, 4))
            shutil.rmtree(textured, ignore_errors=True)

    def row_curve(self):
        """Rooms of two stations each, one behind the other."""
        poses = self.station_poses()
        for count in self.arguments.row:
            moved = [(k % 2, poses[k % 2][:4] + [str(float(poses[k % 2][4]) + 20 * (k // 2))] + poses[k % 2][5:])
                     for k in range(count)]
            self.align_stations("row", count, self.stations(f"row_{count}", moved))

    def table(self, curve, sizes, unit, key, digits):
        steps = []
        for name in self.known:
            kind, rest = name.split(" ", 1)
            step = rest.rsplit(" ", 1)[0]
            if kind == curve and step not in steps:
                steps.append(step)
        print(f"| {unit} | " + " | ".join(str(size) for size in sizes) + " | slope |")
        print("|---" * (len(sizes) + 2) + "|")
        for step in steps:
            found = [(size, self.known[f"{curve} {step} {size}"][key]) for size in sizes
                     if f"{curve} {step} {size}" in self.known]
            values = dict(found)
            slope = "" if len(found) < 2 else "%.1f" % (
                math.log(found[-1][1] / found[0][1]) / math.log(found[-1][0] / found[0][0]))
            print(f"| {step} | " + " | ".join(f"{values[s]:.{digits}f}" if s in values else "" for s in sizes) +
                  f" | {slope} |")
        print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--photos", type=int, nargs="*", default=[20, 40, 80, 160], help="numbers of photos")
    parser.add_argument("--samples", type=float, nargs="*", default=[1, 4, 10], help="millions of samples")
    parser.add_argument("--stations", type=int, nargs="*", default=[4, 8, 16], help="numbers of stations")
    parser.add_argument("--row", type=int, nargs="*", default=[],
                        help="numbers of stations, two in each of a row of rooms")
    parser.add_argument("--station_samples", type=float, default=0.5, help="millions, of each station")
    parser.add_argument("--held_samples", type=float, default=1, help="millions, --max_samples of the commands")
    parser.add_argument("--width", type=int, default=960, help="of the photos, pixels")
    parser.add_argument("--features", type=int, default=2048, help="per photo, for COLMAP")
    parser.add_argument("--exhaustive", type=int, default=40, help="all pairs are matched, too, up to so many photos")
    arguments = parser.parse_args()
    arguments.samples = [int(s) if s == int(s) else s for s in arguments.samples]
    bench = Bench(arguments)
    if arguments.photos:
        bench.photo_curve()
    if arguments.samples:
        bench.sample_curve()
    if arguments.stations:
        bench.station_curve()
    if arguments.row:
        bench.row_curve()
    for curve, sizes, unit in (("photos", arguments.photos, "photos"), ("samples", arguments.samples, "M samples"),
                               ("stations", arguments.stations, "stations"),
                               ("row", arguments.row, "stations in rooms")):
        if not sizes:
            continue
        bench.table(curve, sizes, unit + ": CPU s", "cpu", 1)
        bench.table(curve, sizes, unit + ": peak MB", "peak", 0)


if __name__ == "__main__":
    main()
