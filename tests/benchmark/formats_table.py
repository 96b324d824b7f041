#!/usr/bin/env python3
"""The table of docs/formats.md, measured: what roomtex-import reads and writes of each format.

    tests/benchmark/formats_table.py --bin build/bin

A simulated scan is written in every format and read back: points kept, largest distance from where
they were, whether in the same order (a cloud whose grid is rebuilt begins at another azimuth), intensity
kept, and what the reader takes it for. Then the file is cut off at 20 places
and has bytes changed, 20 times: each must be read or refused with exit 3 and a sentence.
"""

import argparse
import os
import random
import struct
import subprocess
import sys
import tempfile

DAMAGES = 20  # of each kind
FORMATS = ["rtpi", "ptx", "e57", "pcd", "ply", "las", "xyz", "pts", "csv", "obj"]
CUBE = 0.01  # metres; a point that comes back lies in the same cube or beside it


def run(command, *arguments):
    return subprocess.run([command, "--quiet", *arguments], capture_output=True, text=True,
                          errors="replace", timeout=120)


def read_ply(path):
    """Vertices (x, y, z, intensity) of a binary PLY of roomtex-import, and its number of faces."""
    data = open(path, "rb").read()
    end = data.index(b"end_header\n") + 11
    header = data[:end].decode("latin1").splitlines()
    count = faces = 0
    kinds, in_vertex = "", False
    for words in (line.split() for line in header):
        if words[:2] == ["element", "vertex"]:
            count, in_vertex = int(words[2]), True
        elif words[:1] == ["element"]:
            in_vertex = False
            faces = int(words[2]) if words[1] == "face" else faces
        elif words[:1] == ["property"] and in_vertex:
            kinds += {"float": "f", "double": "d", "uchar": "B"}[words[1]]
    record = struct.Struct("<" + kinds)
    return [record.unpack_from(data, end + i * record.size) for i in range(count)], faces


def turned_back(points, kind):
    """E57 has z up, the simulated scan y: (x, y, z) was written as (x, -z, y)."""
    if kind != "e57":
        return points
    return [(p[0], p[2], -p[1], *p[3:]) for p in points]


def distance(a, b):
    return max(abs(a[k] - b[k]) for k in range(3))


def paired(points, truth):
    """Every point of `truth` with the one that stands for it, and whether they come in the same order."""
    if all(distance(a, b) < CUBE for a, b in zip(points, truth)):
        return list(zip(points, truth)), True
    cubes = {}
    for point in points:
        cubes.setdefault(tuple(int(c // CUBE) for c in point[:3]), []).append(point)
    around = [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)]
    pairs = []
    for b in truth:
        cube = [int(c // CUBE) for c in b[:3]]
        near = [a for d in around for a in cubes.get(tuple(c + e for c, e in zip(cube, d)), [])]
        pairs.append((min(near, key=lambda a: distance(a, b), default=points[0]), b))
    return pairs, False


def write(importer, scan, kind, folder):
    """The scan as a file of that format; those that are only read (OBJ) are written here."""
    path = os.path.join(folder, "scan." + kind)
    if kind == "obj":
        ply = os.path.join(folder, "for_" + kind + ".ply")
        run(importer, "--input_path", scan, "--output_path", ply)
        vertices, _ = read_ply(ply)
        with open(path, "w") as file:
            file.writelines("v %.6f %.6f %.6f\n" % v[:3] for v in vertices)
            data = open(ply, "rb").read()
            at = data.index(b"end_header\n") + 11 + 16 * len(vertices)
            for i in range((len(data) - at) // 13):
                a, b, c = struct.unpack_from("<iii", data, at + 13 * i + 1)
                file.write("f %d %d %d\n" % (a + 1, b + 1, c + 1))
        return path, False
    result = run(importer, "--input_path", scan, "--output_path", path)
    if result.returncode != 0:
        sys.exit(result.stderr)
    return path, True


def malformed(importer, path, folder, seed):
    """(refused in a sentence, read, anything else) of damaged copies."""
    data = open(path, "rb").read()
    chance = random.Random(seed)
    refused = read = wrong = 0
    target = os.path.join(folder, "damaged." + path.rsplit(".", 1)[1])
    for i in range(2 * DAMAGES):
        if i < DAMAGES:
            damaged = data[: chance.randrange(len(data))]
        else:
            damaged = bytearray(data)
            for _ in range(8):  # half of them where headers are
                limit = 600 if chance.random() < 0.5 else len(data)
                damaged[chance.randrange(min(limit, len(data)))] = chance.randrange(256)
        with open(target, "wb") as file:
            file.write(damaged)
        result = run(importer, "--input_path", target, "--output_path", os.path.join(folder, "d.ply"))
        if result.returncode == 0:
            read += 1
        elif result.returncode == 3 and target in result.stderr and result.stderr.count("\n") <= 3:
            refused += 1
        else:
            wrong += 1
            print(f"{path}: exit {result.returncode}: {result.stderr[:300]}", file=sys.stderr)
    return refused, read, wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", default="build/bin", help="folder of the commands")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    importer = os.path.join(options.bin, "roomtex-import")
    failed = False
    print("| format | writes | read again | points | off by at most | order | intensity | damaged: "
          "refused, read, wrong |")
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        capture = os.path.join(folder, "capture")
        run(os.path.join(options.bin, "roomtex-simulate"), "--output_path", capture, "--seed", "1",
            "--num_photos", "2", "--photo_width", "320", "--photo_height", "214",
            "--scan_columns", "240", "--scan_rows", "120")
        scan = os.path.join(capture, "scan.rtpi")
        reference = os.path.join(folder, "reference.ply")
        result = run(importer, "--input_path", scan, "--output_path", reference)
        if result.returncode != 0:
            sys.exit(result.stderr)
        truth, num_faces = read_ply(reference)
        for kind in FORMATS:
            path, is_written = write(importer, scan, kind, folder)
            again = os.path.join(folder, "again.ply")
            result = run(importer, "--input_path", path, "--output_path", again)
            if result.returncode != 0:
                sys.exit(result.stderr)
            points, faces = read_ply(again)
            points = turned_back(points, kind)
            off, same = 0.0, True
            pairs, in_order = paired(points, truth)
            for a, b in pairs:
                off = max(off, distance(a, b))
                same = same and abs(a[3] - b[3]) <= 1e-3 * max(1, abs(b[3]))
            refused, read, wrong = malformed(importer, path, folder, options.seed)
            failed = failed or wrong > 0 or len(points) != len(truth)
            what = "grid or mesh" if faces == num_faces else "mesh" if faces else "cloud"
            print(f"| {kind} | {'yes' if is_written else '-'} | {what} | {len(points)} of {len(truth)} | "
                  f"{1e6 * off:.0f} µm | {'same' if in_order else 'another'} | "
                  f"{'same' if same else 'other unit or none'} | {refused}, {read}, {wrong} |", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
