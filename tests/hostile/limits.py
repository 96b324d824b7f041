"""Too little memory, too few threads, numbers at the ends of their range, files without end."""

import math
import os
import random
import resource
import struct
import time

import scene as s
from commands import LINES, prepared

FEW_THREADS = os.environ.get("ROOMTEX_FEW_THREADS", "")
ONLY = os.environ.get("ROOMTEX_CASES", "")  # in the title


def memory(base):
    base = prepared(base)
    for one in LINES:
        title, line = one.title, one.line
        if ONLY not in title:
            continue
        problem, refused = "", 0
        for megabytes in (150, 200, 250, 300, 350, 400, 500, 600, 800, 1200):
            limits = [(resource.RLIMIT_AS, megabytes << 20)]
            program = line.split()[0]
            if base.run(program + " --version", limits=limits).code != 0:
                continue  # not even loaded
            here = base.copy()
            before = here.state()
            answer = here.run(line, limits=limits)
            refused += answer.code == 3
            problem = answer.problem({0, 3, 4}) or here.harm(before)
            if problem:
                problem = f"{megabytes} MB: {problem}"
                break
        yield f"{title} with little memory, {refused} times refused", problem


def threads(base):
    base = prepared(base)
    for one in LINES:
        title, line = one.title, one.line
        if ONLY not in title:
            continue
        expected = base.copy()
        code = expected.run(line).code
        for at_most in (0, 1, 3):
            here = base.copy()
            answer = here.run(line + " --num_threads 8", environment={
                "LD_PRELOAD": FEW_THREADS, "THREADS_AT_MOST": str(at_most)})
            # COLMAP aborts without a thread; what it said is quoted.
            is_colmap = answer.code == 3 and "COLMAP's own failure" in answer.err
            yield (f"{title} with {at_most} threads more",
                   "" if is_colmap else answer.problem({code}))
        here = base.copy()
        yield f"{title} --num_threads 100000", here.run(line + " --num_threads 100000").problem(
            {code})


def cameras(base):
    count = len([line for line in (base.root / "sparse/cameras.txt").read_text().splitlines()
                 if line and line[0] != "#"][0].split()) - 4
    for value in (1e6, 1e9, 1e30, 1e300, 1e-300, -1e300, 5e4, 2e4):
        for place in range(4):
            params = [200.0, 200.0, 120.0, 80.0] + [0.0] * (count - 4)
            params[place] = value
            here = base.copy()
            s.write_binary_model(here.root / "sparse", {}, params)
            for title, line in (
                    ("align", s.ALIGN + " --image_path photos --output_path aligned"),
                    ("texture", s.TEXTURE.replace("--database_path database.db ", "")
                     + " --output_path textured")):
                started = time.time()
                answer = here.run(line, limits=[(resource.RLIMIT_AS, 3 << 30)], seconds=60)
                yield (f"{title}, camera parameter {place} is {value:g}, "
                       f"{time.time() - started:.1f} s", answer.problem({0, 3, 4}))


def poses(base):
    for value in ("1e18", "1e25", "1e38", "1e200", "-1e300"):
        here = base.copy()
        lines = (here.root / "sparse/images.txt").read_text().split("\n")
        for i, line in enumerate(lines):
            fields = line.split()
            if len(fields) == 10 and fields[0] in ("1", "2"):
                fields[5 + int(fields[0])] = value
                lines[i] = " ".join(fields)
        (here.root / "sparse/images.txt").write_text("\n".join(lines))
        for title, line in (("align", s.ALIGN + " --image_path photos --output_path aligned"),
                            ("texture", s.TEXTURE + " --output_path textured")):
            yield f"{title}, photos {value} m away", here.run(line, seconds=60).problem({0, 3, 4})


def triangle_mesh(triangles):
    """A PLY of triangles, given by their corners; equal ones are one vertex."""
    numbers = {}
    faces = b"".join(struct.pack("<B3i", 3, *(numbers.setdefault(tuple(corner), len(numbers))
                                              for corner in t)) for t in triangles)
    vertices = b"".join(struct.pack("<3f", *corner) for corner in numbers)
    return (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(numbers)}\n"
            "property float x\nproperty float y\nproperty float z\n"
            f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
            ).encode() + vertices + faces


def geometry(base):
    """Meshes of random triangles and of needles cost about what ordinary ones of as many do."""
    generator = random.Random(1)

    def scattered(reach):
        corners = [[generator.uniform(-3, 3) for _ in range(3)] for _ in range(4000)]
        return [[[c + generator.uniform(-reach, reach) for c in corner] for _ in range(3)]
                for corner in corners]

    def strips():
        """Three needles each, edge to edge across the room: charts of large boxes, next to empty."""
        points = [[[generator.uniform(-3, 3), generator.uniform(-3, 3), 0.5] for _ in range(5)]
                  for _ in range(1500)]
        return [five[k:k + 3] for five in points for k in range(3)]

    fan = [[[0, 0, 0.5]] + [[3 * math.cos(angle / 3000), 3 * math.sin(angle / 3000), 0.5]
                            for angle in (k, k + 1)] for k in range(18849)]
    ordinary = scattered(0.05)
    pinhole = (base.root / "sparse/cameras.txt").read_text()
    panorama = "1 EQUIRECTANGULAR 240 160 240 160\n"
    for camera, scale in ((pinhole, "1"), (pinhole, "auto"), (panorama, "1")):
        seconds = {}
        for kind, triangles in (("ordinary", ordinary), ("random", scattered(5)), ("fan", fan),
                                ("strips", strips())):
            here = base.copy()
            (here.root / "mesh.ply").write_bytes(triangle_mesh(triangles))
            (here.root / "sparse/cameras.txt").write_text(camera)
            started = time.time()
            answer = here.run("roomtex-texture --quiet --input_path sparse --image_path photos "
                              "--scan_path mesh.ply --output_path textured --Texture.scale " +
                              scale + (" --Texture.atlas 1" if scale == "auto" else ""),
                              seconds=120)
            seconds[kind] = time.time() - started
            problem = answer.problem({0, 3, 4})
            if not problem and seconds[kind] > 15 * seconds["ordinary"] + 2:
                problem = f"{seconds[kind]:.1f} s instead of {seconds['ordinary']:.1f}"
            yield (f"texture with scale {scale} on {kind} triangles"
                   f"{' in panoramas' if camera == panorama else ''}, {seconds[kind]:.1f} s", problem)


def endless(base):
    """Files of 200 GB (without a byte on the disk), pipes and devices in the place of each input."""
    align = s.ALIGN + " --image_path photos --output_path aligned"
    lines = {
        "scan.rtpi": (align, s.TEXTURE + " --output_path textured",
                      "roomtex-import --quiet --input_path scan.rtpi --output_path room.ply"),
        "picks.csv": (align,),
        "database.db": (s.TEXTURE + " --output_path textured",
                        "roomtex-mapper --quiet --database_path database.db --image_path photos "
                        "--output_path mapped"),
        "sparse/images.txt": (align, s.TEXTURE + " --output_path textured"),
        "photos/photo_000.jpg": (align, s.TEXTURE + " --output_path textured"),
        "project.ini": (align + " --project_path project.ini",),
        "sparse/cameras.txt": ("roomtex-export --quiet --input_path sparse --image_path photos --scan_path "
                               "scan.rtpi --output_path exported",),
        "sparse/points3D.txt": ("roomtex-dense --quiet --input_path sparse --image_path photos --scan_path "
                                "scan.rtpi --output_path dense",),
        "house.json": ("roomtex-outline --quiet --outline_path house.json --output_path outline.json",),
        "pairs.csv": (s.TEXTURE + " --output_path textured --associations_path pairs.csv",),
        "model.ply": ("roomtex-view --quiet --input_path model.ply --output_path page",
                      "roomtex-render --quiet --ply_path model.ply --input_path sparse --num_photos 1 "
                      "--output_path picture.png"),
    }
    for name, using in lines.items():
        for kind in ("200 GB of nothing", "a pipe", "/dev/zero"):
            for line in using:
                here = base.copy()
                path = here.root / name
                path.unlink(missing_ok=True)
                if kind == "a pipe":
                    os.mkfifo(path)
                elif kind == "/dev/zero":
                    path.symlink_to("/dev/zero")
                else:
                    path.touch()
                    os.truncate(path, 200 << 30)
                answer = here.run(line, limits=[(resource.RLIMIT_AS, 3 << 30)], seconds=60)
                good = {0, 3, 4} if name.startswith("photos") else {3}
                yield f"{name} is {kind}: {line.split()[0]}", answer.problem(good)
    here = base.copy()
    program = here.root / "colmap"
    program.write_text("#!/bin/sh\nhead -c 3000000000 /dev/zero | tr '\\0' x\nexit 1\n")
    program.chmod(0o755)
    answer = here.run("roomtex-mapper --quiet --database_path database.db --image_path photos "
                      "--output_path mapped --colmap ./colmap", limits=[(resource.RLIMIT_AS, 1 << 30)])
    log = sum(path.stat().st_size for path in here.root.rglob("*.log"))
    yield "colmap prints a line of 3 GB: roomtex-mapper", answer.problem({3}) or (
        f"keeps {log} bytes of it" if log > 1 << 20 or len(answer.err) > 1 << 16 else "")


if __name__ == "__main__":
    s.main({"memory": memory, "threads": threads, "cameras": cameras, "poses": poses,
            "geometry": geometry, "endless": endless})
