"""A small simulated room with everything that the commands read, and what every answer must keep."""

import hashlib
import math
import os
import pathlib
import random
import resource
import shutil
import signal
import sqlite3
import struct
import subprocess
import sys
import tempfile
import zlib

KEEP_SENTENCES = ("terminate called", "std::", "Assertion", "AddressSanitizer", "runtime error:",
                  "Traceback", "internal error", "vector::", "basic_string", "basic_filebuf",
                  "filesystem error", "exception.", ". .", "..\n")
SECONDS = 120


class Answer:
    def __init__(self, code, out, err):
        self.code, self.out, self.err = code, out, err

    def problem(self, codes):
        """Why this is not how a command ends, or ""."""
        if self.code not in codes:
            return f"exit {self.code}, expected {sorted(codes)}: {self.err.strip()[-300:]}"
        for word in KEEP_SENTENCES:
            if word in self.err:
                return f"says \"{word}\": {self.err.strip()[-300:]}"
        if self.code not in (0, 4) and not self.err.strip():
            return "says nothing"
        return ""


class Scene:
    """A folder with a capture; commands run in it with relative paths."""

    def __init__(self, programs, folder=None):
        self.programs = pathlib.Path(programs).resolve()
        self.temporary = tempfile.TemporaryDirectory(prefix="roomtex-hostile-")
        self.root = pathlib.Path(folder or self.temporary.name)

    def make(self, num_photos=6, scan_columns=160):
        answer = self.run(f"roomtex-simulate --output_path . --num_photos {num_photos} --photo_width 240 "
                          f"--photo_height 160 --scan_columns {scan_columns} "
                          f"--scan_rows {scan_columns // 2} --furnished 0 --distortion 0")
        assert answer.code == 0, answer.err
        write_sparse_model(self.root)
        write_database(self.root / "database.db", self.root)
        (self.root / "project.ini").write_text("num_threads=2\n")
        return self

    def copy(self):
        scene = Scene(self.programs)
        shutil.copytree(self.root, scene.root, dirs_exist_ok=True, symlinks=True)
        return scene

    def run(self, line, **how):
        """A command of ours; see run_program()."""
        arguments = line.split() if isinstance(line, str) else list(line)
        arguments[0] = str(self.programs / arguments[0])
        return self.run_program(arguments, **how)

    def run_program(self, arguments, limits=(), environment=None, seconds=SECONDS, stdin=None,
                    prepare=None, where=""):
        """prepare: called in the process before the program is. where: the folder to work in."""
        def limit():
            for what, value in limits:
                resource.setrlimit(what, (value, value))
            if prepare:
                prepare()

        (self.root / where).mkdir(exist_ok=True)
        process = subprocess.Popen(
            arguments, cwd=self.root / where, stdin=stdin or subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, preexec_fn=limit, start_new_session=True,
            env={**os.environ, **(environment or {})})
        try:
            out, err = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return Answer("timeout", "", f"still running after {seconds} s")
        return Answer(process.returncode, out.decode(errors="replace"),
                      err.decode(errors="replace"))

    def state(self, skip=()):
        """Path to content of everything below the folder; links by where they lead."""
        files = {}
        for path in sorted(self.root.rglob("*")):
            name = path.relative_to(self.root).as_posix()
            if any(name == s or name.startswith(s + "/") for s in skip):
                continue
            if path.is_symlink():
                files[name] = "link " + os.readlink(path)
            elif path.is_file():
                files[name] = hashlib.sha256(path.read_bytes()).hexdigest()
        return files

    def leftovers(self):
        return [p.name for p in self.root.rglob(".roomtex-partial-*")]

    def harm(self, before, skip=()):
        """What became of the files of an earlier state(), or was left half done; or ""."""
        after = self.state(skip)
        changed = [name for name, content in before.items() if after.get(name) != content]
        if changed:
            return f"changed {changed[:3]}"
        return f"leaves {self.leftovers()}" if self.leftovers() else ""


def rotated(quaternion, point):
    w, x, y, z = quaternion
    a, b, c = point
    u, v, t = y * c - z * b, z * a - x * c, x * b - y * a
    return (a + 2 * (w * u + y * t - z * v), b + 2 * (w * v + z * u - x * t),
            c + 2 * (w * t + x * v - y * u))


def write_sparse_model(root):
    """The true poses, with points of the scan: the room is empty, so every photo sees all that lies
    before it."""
    (root / "sparse").mkdir()
    shutil.copy(root / "truth/cameras.txt", root / "sparse")
    camera = [line.split() for line in (root / "truth/cameras.txt").read_text().splitlines()
              if line and line[0] != "#"][0]
    width, height, fx, fy, cx, cy = (float(value) for value in camera[2:8])
    data = (root / "truth/true_colors.ply").read_bytes()
    end = data.index(b"end_header\n") + 11
    header = data[:end].decode().split("\n")
    count = next(int(line.split()[2]) for line in header if line.startswith("element vertex"))
    stride = (len(data) - end) // count
    points = [struct.unpack_from("<3f", data, end + stride * i) for i in range(0, count, 17)]
    lines = [line for line in (root / "truth/images.txt").read_text().split("\n")
             if line and line[0] != "#"]
    tracks, images = [[] for _ in points], []
    for line in (line for line in lines if len(line.split()) == 10):
        fields = line.split()
        quaternion, shift = [float(v) for v in fields[1:5]], [float(v) for v in fields[5:8]]
        seen = []
        for i, point in enumerate(points):
            x, y, z = (r + t for r, t in zip(rotated(quaternion, point), shift))
            if z < 0.1:
                continue
            u, v = fx * x / z + cx, fy * y / z + cy
            if 0 < u < width and 0 < v < height:
                tracks[i].append((fields[0], len(seen)))
                seen.append(f"{u} {v} {i + 1}")
        images.append((fields, seen))
    good = {i + 1 for i, track in enumerate(tracks) if len(track) > 1}
    text = ""
    for fields, seen in images:
        seen = [s if int(s.split()[2]) in good else " ".join(s.split()[:2]) + " -1" for s in seen]
        text += " ".join(fields) + "\n" + " ".join(seen) + "\n"
    (root / "sparse/images.txt").write_text(text)
    picks = "image_name,x,y,scan_x,scan_y,scan_z\n"
    for fields, seen in images[:2]:
        for entry in seen[:: max(1, len(seen) // 8)]:
            u, v, i = entry.split()
            picks += ",".join([fields[9], u, v] + [str(c) for c in points[int(i) - 1]]) + "\n"
    (root / "picks.csv").write_text(picks)
    (root / "sparse/points3D.txt").write_text("".join(
        f"{i + 1} {p[0]} {p[1]} {p[2]} 90 90 90 0.5 " +
        " ".join(f"{image} {index}" for image, index in tracks[i]) + "\n"
        for i, p in enumerate(points) if i + 1 in good))


def text_model(folder):
    """Cameras, images (fields and keypoints) and points of a COLMAP text model."""
    lines = {name: [line for line in (folder / name).read_text().split("\n")
                    if not line.startswith("#")]
             for name in ("cameras.txt", "images.txt", "points3D.txt")}
    cameras = [line.split() for line in lines["cameras.txt"] if line]
    images = [(lines["images.txt"][i].split(), lines["images.txt"][i + 1].split())
              for i in range(0, len(lines["images.txt"]) - 1, 2)]
    points = [line.split() for line in lines["points3D.txt"] if line]
    return cameras, images, points


MODELS = {"SIMPLE_PINHOLE": 0, "PINHOLE": 1, "SIMPLE_RADIAL": 2, "RADIAL": 3, "OPENCV": 4}


def write_binary_model(folder, names, params=None):
    """The text model of the folder as .bin instead; names: old name to new one; params: of the
    camera, instead of its own."""
    cameras, images, points = text_model(folder)
    out = struct.pack("<Q", len(cameras))
    for camera in cameras:
        values = params or [float(value) for value in camera[4:]]
        out += struct.pack("<IiQQ", int(camera[0]), MODELS[camera[1]], int(camera[2]),
                           int(camera[3])) + struct.pack(f"<{len(values)}d", *values)
    (folder / "cameras.bin").write_bytes(out)
    out = struct.pack("<Q", len(images))
    for fields, seen in images:
        out += struct.pack("<I7dI", int(fields[0]), *(float(v) for v in fields[1:8]),
                           int(fields[8]))
        out += names.get(fields[9], fields[9]).encode() + b"\0"
        out += struct.pack("<Q", len(seen) // 3)
        for i in range(0, len(seen), 3):
            out += struct.pack("<2dq", float(seen[i]), float(seen[i + 1]), int(seen[i + 2]))
    (folder / "images.bin").write_bytes(out)
    out = struct.pack("<Q", len(points))
    for point in points:
        track = [int(value) for value in point[8:]]
        out += struct.pack("<Q3d3BdQ", int(point[0]), *(float(v) for v in point[1:4]),
                           *(int(v) for v in point[4:7]), float(point[7]), len(track) // 2)
        out += struct.pack(f"<{len(track)}I", *track)
    (folder / "points3D.bin").write_bytes(out)
    for name in ("cameras.txt", "images.txt", "points3D.txt"):
        (folder / name).unlink()


def rename_in_database(path, old, new):
    database = sqlite3.connect(path)
    database.execute("UPDATE images SET name = ? WHERE name = ?", (new, old))
    database.commit()
    database.close()


def write_database(path, root):
    """COLMAP 3.8's tables with the cameras and images of the scene, without features."""
    camera = [line.split() for line in (root / "cameras.txt").read_text().splitlines()
              if line and line[0] != "#"][0]
    values = [float(value) for value in camera[4:]]
    params = struct.pack(f"<{len(values)}d", *values)
    database = sqlite3.connect(path)
    database.executescript("""
        CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER
          NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB,
          prior_focal_length INTEGER NOT NULL);
        CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL
          UNIQUE, camera_id INTEGER NOT NULL, prior_qw REAL, prior_qx REAL, prior_qy REAL,
          prior_qz REAL, prior_tx REAL, prior_ty REAL, prior_tz REAL);
        CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols
          INTEGER NOT NULL, data BLOB);
        CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols
          INTEGER NOT NULL, data BLOB);
        CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols
          INTEGER NOT NULL, data BLOB);
        CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT
          NULL, cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB,
          qvec BLOB, tvec BLOB);""")
    database.execute("INSERT INTO cameras VALUES (1, ?, ?, ?, ?, 1)",
                     (MODELS[camera[1]], int(camera[2]), int(camera[3]), params))
    for i, photo in enumerate(sorted((root / "photos").iterdir())):
        database.execute("INSERT INTO images (image_id, name, camera_id) VALUES (?, ?, 1)",
                         (i + 1, photo.name))
    database.commit()
    database.close()


def write_matches(root):
    """Keypoints and verified matches in the database: what the photos of the sparse model share."""
    _, images, _ = text_model(root / "sparse")
    database = sqlite3.connect(root / "database.db")
    ids = dict(database.execute("SELECT name, image_id FROM images"))
    seen = {}
    for fields, observed in images:
        name = fields[9]
        image = ids[name]
        data = b"".join(struct.pack("<2f", float(observed[i]), float(observed[i + 1]))
                        for i in range(0, len(observed), 3))
        database.execute("INSERT INTO keypoints VALUES (?, ?, 2, ?)",
                         (image, len(observed) // 3, data))
        # Of a point the same in all photos, SIFT's length.
        data = b"".join(random.Random(f"{name if point == '-1' else ''} {i if point == '-1' else point}")
                        .randbytes(128) for i, point in enumerate(observed[2::3]))
        database.execute("INSERT INTO descriptors VALUES (?, ?, 128, ?)",
                         (image, len(observed) // 3, data))
        seen[image] = {observed[i + 2]: i // 3 for i in range(0, len(observed), 3)
                       if observed[i + 2] != "-1"}
    for first in sorted(seen):
        for second in (image for image in sorted(seen) if image > first):
            shared = [point for point in seen[first] if point in seen[second]]
            data = b"".join(struct.pack("<2I", seen[first][point], seen[second][point])
                            for point in shared)
            database.execute("INSERT INTO two_view_geometries (pair_id, rows, cols, data, config) "
                             "VALUES (?, ?, 2, ?, 2)",
                             (2147483647 * first + second, len(shared), data))
    database.commit()
    database.close()


def write_png(path, width, height, grey):
    """grey(x, y) gives 0 to 255."""
    rows = b"".join(b"\0" + bytes(grey(x, y) for x in range(width)) for y in range(height))
    chunk = lambda kind, data: (struct.pack(">I", len(data)) + kind + data +
                                struct.pack(">I", zlib.crc32(kind + data)))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" +
                     chunk(b"IHDR", struct.pack(">2I5B", width, height, 8, 0, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def write_stations(root):
    """other.rtpi, a second scan, and poses.txt for both."""
    shutil.copy(root / "scan.rtpi", root / "other.rtpi")
    pose = " 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"
    (root / "poses.txt").write_text("scan.rtpi" + pose + "other.rtpi" + pose)


def write_boards(folder):
    """Photos of a checkerboard with 6x4 inner corners, for roomtex-calibrate."""
    folder.mkdir()
    width, height, focal = 240, 160, 220.0
    for number in range(4):
        turn, tilt = 0.5 * math.sin(2.1 * number), 0.5 * math.cos(1.7 * number)
        ct, st, cn, sn = math.cos(turn), math.sin(turn), math.cos(tilt), math.sin(tilt)
        (r0, r1, r2), (d0, d1, d2) = (ct, st * sn, -st * cn), (0.0, cn, sn)
        n0, n1, n2 = r1 * d2 - r2 * d1, r2 * d0 - r0 * d2, r0 * d1 - r1 * d0
        c0, c1, c2 = 0.8 * math.sin(number), 0.5 * math.cos(3 * number), 9.0 + number % 3
        distance = n0 * c0 + n1 * c1 + n2 * c2
        left, up = r0 * c0 + r1 * c1 + r2 * c2 - 3.5, d0 * c0 + d1 * c1 + d2 * c2 - 2.5

        def grey(x, y):
            total = 0
            for dx, dy in ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)):
                a, b = (x + dx - width / 2) / focal, (y + dy - height / 2) / focal
                depth = distance / (n0 * a + n1 * b + n2)
                u = depth * (r0 * a + r1 * b + r2) - left
                v = depth * (d0 * a + d1 * b + d2) - up
                total += 20 if 0 <= u < 7 and 0 <= v < 5 and (int(u) + int(v)) % 2 == 0 else 230
            return total // 4

        write_png(folder / f"board_{number}.png", width, height, grey)


ALIGN = "roomtex-align --quiet --input_path sparse --scan_path scan.rtpi --picks_path picks.csv"
TEXTURE = ("roomtex-texture --quiet --input_path sparse --image_path photos --scan_path scan.rtpi "
           "--database_path database.db --Texture.scale 1")


def main(tables):
    """Runs the tables named on the command line: PROGRAMS TABLE...; the exit code is for ctest."""
    programs, names = sys.argv[1], sys.argv[2:]
    failures = []
    with_scene = Scene(programs).make()
    for name in names or tables:
        for title, problem in tables[name](with_scene):
            print(("FAILED " if problem else "ok     ") + name + ": " + title, flush=True)
            if problem:
                print("       " + problem, flush=True)
                failures.append(title)
    print(f"{len(failures)} failed")
    sys.exit(1 if failures else 0)
