#!/usr/bin/env python3
"""What the list of roomtex-pairs loses and saves on photos of several rooms, as a Markdown table (docs/pairs.md).

  tests/benchmark/scale/pairs_table.py --bin build/bin FOLDER --photos 100 200 400 --exhaustive 100

25 simulated photos in each room, all rooms with the same furniture at the same places; the smaller sets are the first
rooms of the largest. Beside the list: the photos of each room with each other, which only the truth can tell (all that
matching all pairs could find there), and, up to --exhaustive photos, all with all. COLMAP's mapper makes its models of
the first two; a photo counts where most photos of its model are of its room. What was measured before
(FOLDER/pairs.json) is not run again.

--same_walls 1: of two rooms each walls, floor and ceiling are the same to the last fibre, too; the truth knows the
poses of the first alone. roomtex-mapper makes the models then.
"""

import argparse
import collections
import json
import os
import shutil
import sqlite3
import statistics

from measurements import Measurements

PHOTOS_OF_A_ROOM = 25
FIXED_LENS = [f"--Mapper.ba_refine_{part}" for part in ("focal_length", "principal_point", "extra_params")]


def room_of(name):
    return name.split("_")[0]


def read_names(model):
    """Names of the photos of a model in COLMAP's text format."""
    with open(os.path.join(model, "images.txt")) as stream:
        lines = [line for line in stream if not line.startswith("#")]
    return [line.split()[9] for line in lines[::2] if line.strip()]


class Bench(Measurements):
    def __init__(self, arguments):
        super().__init__(arguments.folder, arguments.bin, "pairs.json")
        self.arguments = arguments

    def seconds(self, *line):
        return self.call(list(line))["cpu"]

    def rooms(self, photos):
        first = self.arguments.first_seed
        return [f"room{seed}" for seed in range(first, first + photos // PHOTOS_OF_A_ROOM)]

    def simulate(self, photos):
        """Every room by itself, and the photos of all under names of their own in one folder."""
        a = self.arguments
        os.makedirs(self.at("photos"), exist_ok=True)
        rooms = self.rooms(photos)
        for room, twin in zip(rooms[::2], rooms[1::2]) if a.same_walls else ((room, None) for room in rooms):
            if not os.path.exists(self.at(room, "README.txt")):
                self.seconds("roomtex-simulate", "--quiet", "1", "--seed", room[4:], "--num_photos",
                             str(PHOTOS_OF_A_ROOM), "--photo_width", str(a.width), "--photo_height",
                             str(a.width * 2 // 3), "--scan_columns", "400", "--scan_rows", "150", "--output_path",
                             self.at(room), "--similar_room", str(PHOTOS_OF_A_ROOM if twin else 0))
                truth = self.at(room, "truth", "images.txt")
                with open(truth) as stream:
                    text = stream.read()
                with open(truth, "w") as stream:
                    stream.write(text.replace(" photo_", f" {room}_photo_"))
            for number, name in enumerate(sorted(os.listdir(self.at(room, "photos")))):
                link = self.at("photos", f"{room if number < PHOTOS_OF_A_ROOM else twin}_{name}")
                if not os.path.exists(link):
                    os.link(self.at(room, "photos", name), link)

    def match(self, photos, kind, pairs):
        """CPU seconds of COLMAP for the pairs of a file on a copy of the features, or for all pairs."""
        threads = ["--SiftMatching.num_threads", "2", "--SiftMatching.use_gpu", "0"]
        database = self.at(f"{kind}_{photos}.db")

        def run():
            shutil.copy(self.at(f"features_{photos}.db"), database)
            if pairs is None:
                return self.seconds("colmap", "exhaustive_matcher", "--database_path", database, *threads)
            return self.seconds("colmap", "matches_importer", "--database_path", database, "--match_list_path", pairs,
                                "--match_type", "pairs", *threads)

        return self.once(f"matches of {kind} {photos}", run)

    def models(self, photos, kind):
        """COLMAP's models: the room of most photos, how many are of it, how many are not, how far they are off."""
        def run():
            sparse = self.at(f"{kind}_{photos}")
            shutil.rmtree(sparse, ignore_errors=True)
            os.makedirs(sparse)
            paths = ["--database_path", self.at(f"{kind}_{photos}.db"), "--image_path", self.at("photos"),
                     "--output_path", sparse]
            if self.arguments.same_walls:
                cpu = self.call(["roomtex-mapper", "--quiet", "1", *paths], (0, 4))["cpu"]
            else:
                lens = [word for option in FIXED_LENS for word in (option, "0")]
                cpu = self.seconds("colmap", "mapper", *paths, *lens)
            found = {"cpu": cpu, "models": []}
            for number in sorted((name for name in os.listdir(sparse) if name.isdigit()), key=int):
                model = os.path.join(sparse, number)
                self.seconds("colmap", "model_converter", "--input_path", model, "--output_path", model,
                             "--output_type", "TXT")
                names = read_names(model)
                room, own = collections.Counter(map(room_of, names)).most_common(1)[0]
                off = None
                truth = self.at(room, "truth")
                if own == len(names) and os.path.exists(truth):  # of others the truth knows nothing
                    report = os.path.join(model, "evaluate.json")
                    self.seconds("roomtex-evaluate", "--quiet", "1", "--truth_path", truth,
                                 "--input_path", model, "--fit_similarity", "1", "--report_path", report)
                    off = json.load(open(report))["poses"]["position_median_mm"]
                found["models"].append({"room": room, "own": own, "others": len(names) - own, "off_mm": off})
            return found

        return self.once(f"models of {kind} {photos}", run)

    def features(self, photos):
        """Of the largest set by COLMAP, of the others copies of theirs."""
        most, features = max(self.arguments.photos), self.at(f"features_{photos}.db")
        if photos == most:
            camera = open(self.at(self.rooms(most)[0], "camera_options.txt")).read().split()
            self.once(f"features {most}", lambda: self.seconds(
                "colmap", "feature_extractor", "--database_path", features, "--image_path", self.at("photos"),
                "--SiftExtraction.use_gpu", "0", "--SiftExtraction.max_num_features", str(self.arguments.features),
                *camera))
        elif not os.path.exists(features):
            shutil.copy(self.at(f"features_{most}.db"), features + ".new")
            database = sqlite3.connect(features + ".new")
            with database:
                database.execute("DELETE FROM images WHERE substr(name, 1, instr(name, '_') - 1) NOT IN (%s)" %
                                 ", ".join(f"'{room}'" for room in self.rooms(photos)))
                for table in ("keypoints", "descriptors"):
                    database.execute(f"DELETE FROM {table} WHERE image_id NOT IN (SELECT image_id FROM images)")
            database.close()
            os.rename(features + ".new", features)

    def measure(self, photos):
        self.features(photos)
        pairs = self.at(f"pairs_{photos}.txt")
        self.once(f"the list {photos}", lambda: self.seconds(
            "roomtex-pairs", "--quiet", "1", "--database_path", self.at(f"features_{photos}.db"), "--output_path",
            pairs))
        self.once(f"pairs listed {photos}", lambda: sum(1 for line in open(pairs) if line.strip()))
        self.match(photos, "list", pairs)
        self.models(photos, "list")
        if photos <= self.arguments.exhaustive:
            self.match(photos, "all", None)

    def measure_rooms(self, photos):
        rooms, names = self.at("rooms.txt"), sorted(os.listdir(self.at("photos")))
        with open(rooms, "w") as stream:
            for i, first in enumerate(names):
                for second in names[i + 1:]:
                    if room_of(first) == room_of(second):
                        stream.write(f"{first} {second}\n")
        self.match(photos, "rooms", rooms)
        self.models(photos, "rooms")

    def table(self):
        sizes = self.arguments.photos
        known = lambda what, size: self.known.get(f"{what} {size}")
        of_rooms = (known("models of rooms", max(sizes)) or {"models": []})["models"]
        row = lambda name, value: print(f"| {name} | " + " | ".join(value(size) for size in sizes) + " |")
        cpu = lambda what: lambda size: "" if known(what, size) is None else f"{known(what, size):.0f}"
        share = lambda size: 100 * (known("the list", size) + known("matches of list", size)) / known(
            "matches of all", size)
        row("photos (rooms)", lambda size: f"{size} ({size // PHOTOS_OF_A_ROOM})")
        print("|---" * (len(sizes) + 1) + "|")
        row("pairs, all", lambda size: str(size * (size - 1) // 2))
        row("listed", lambda size: str(known("pairs listed", size)))
        row("CPU s: the list", cpu("the list"))
        row("CPU s: matching the list", cpu("matches of list"))
        mapper = "roomtex-mapper" if self.arguments.same_walls else "colmap mapper"
        row(f"CPU s: {mapper}", lambda size: f"{known('models of list', size)['cpu']:.0f}")
        row("CPU s: matching all", cpu("matches of all"))
        row("both, of matching all", lambda size: f"{share(size):.0f} %" if known("matches of all", size) else "")
        for kind, models in (("list", lambda size: known("models of list", size)["models"]),
                             ("rooms", lambda size: [x for x in of_rooms if x["room"] in self.rooms(size)])):
            off = lambda size: [x["off_mm"] for x in models(size) if x["off_mm"] is not None] or [float("nan")]
            if kind == "rooms" and not of_rooms:
                continue
            row(f"{kind}: models", lambda size: str(len(models(size))))
            row(f"{kind}: photos registered", lambda size: str(sum(x["own"] for x in models(size))))
            row(f"{kind}: photos in another room's model", lambda size: str(sum(x["others"] for x in models(size))))
            row(f"{kind}: off, mean and worst of the rooms, mm", lambda size: "%.2f, %.2f" % (
                statistics.mean(off(size)), max(off(size))))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--photos", type=int, nargs="*", default=[100, 200, 400], help="numbers of photos, 25 a room")
    parser.add_argument("--width", type=int, default=960, help="of the photos, pixels")
    parser.add_argument("--features", type=int, default=1500, help="per photo, for COLMAP")
    parser.add_argument("--exhaustive", type=int, default=100, help="all pairs are matched, too, up to so many photos")
    parser.add_argument("--first_seed", type=int, default=101, help="of the rooms")
    parser.add_argument("--same_walls", type=int, default=0, help="1 = of two rooms each")
    parser.add_argument("--rooms", type=int, default=1, help="0 = not the pairs of each room beside the list")
    arguments = parser.parse_args()
    if arguments.same_walls and any(photos % (2 * PHOTOS_OF_A_ROOM) for photos in arguments.photos):
        parser.error(f"--same_walls takes multiples of {2 * PHOTOS_OF_A_ROOM} --photos")
    bench = Bench(arguments)
    most = max(bench.arguments.photos)
    bench.simulate(most)
    bench.features(most)
    for photos in bench.arguments.photos:
        bench.measure(photos)
    if bench.arguments.rooms:
        bench.measure_rooms(most)
    bench.table()


if __name__ == "__main__":
    main()
