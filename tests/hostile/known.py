"""Models that are handed to roomtex-mapper as --known_path: broken, foreign, absurd and contradicting ones. Each is
used, left aside with a warning, distrusted (4) or refused in a sentence, and no input is changed."""

import os
import shutil
import struct

import scene as s

MAPPER = ("roomtex-mapper --quiet --database_path database.db --image_path photos --output_path mapped "
          "--known_path known")
PHOTOS, KNOWN = 16, 3


def prepared(programs):
    """A scene whose photos can all be mapped, with matches, and three of them as the model of another program."""
    base = s.Scene(programs).make(num_photos=PHOTOS)
    s.write_matches(base.root)
    shutil.copytree(base.root / "sparse", base.root / "known")
    change(poses=lambda i, fields: fields if i % (PHOTOS // KNOWN) == 0 and i < PHOTOS - 1 else None)(base.root)
    (base.root / "known/points3D.txt").write_text("")
    return base


def change(poses=None, camera=None):
    """The known model with other poses (of the i-th photo: its fields in images.txt) or another camera."""
    def run(root):
        cameras, images, _ = s.text_model(root / "known")
        if poses:
            lines = [poses(i, fields) for i, (fields, _) in enumerate(images)]
            (root / "known/images.txt").write_text("".join(" ".join(f) + "\n\n" for f in lines if f))
        if camera:
            (root / "known/cameras.txt").write_text(" ".join(camera(cameras[0])) + "\n")
    return run


def pose(which, first, values):
    """These fields of one photo's pose, or of all (None)."""
    def other(i, fields):
        if which is None or i == which:
            fields[first:first + len(values)] = values
        return fields
    return change(poses=other)


def centre_at(place_of):
    """Photos that look as they did, from elsewhere."""
    def other(i, fields):
        q = [float(value) for value in fields[1:5]]
        fields[5:8] = [repr(-c) for c in s.rotated(q, place_of(i))]
        return fields
    return change(poses=other)


def binary(edit):
    """As .bin, one file of which is edited: name and bytes to bytes."""
    def run(root):
        s.write_binary_model(root / "known", {})
        for name in ("cameras.bin", "images.bin", "points3D.bin"):
            path = root / "known" / name
            path.write_bytes(edit(name, path.read_bytes()))
    return run


def emptied(root):
    shutil.rmtree(root / "known")
    (root / "known").mkdir()


def as_file(root):
    shutil.rmtree(root / "known")
    (root / "known").write_text("a file")


def as_fifo(root):
    (root / "known/images.txt").unlink()
    os.mkfifo(root / "known/images.txt")


def without_file(name):
    return lambda root: (root / "known" / name).unlink()


def is_output(root):
    (root / "mapped").mkdir()
    shutil.move(root / "known", root / "mapped/0")


def as_linked_output(root):
    is_output(root)
    os.symlink("mapped/0", root / "known")


def cases():
    """Title, what is changed, the command line, exit codes, what stderr says."""
    nothing = lambda root: None
    fine = {0, 4}
    warns = MAPPER.replace("--quiet ", "")  # which leaves warnings to the report
    yield "three photos as they were taken", nothing, MAPPER, {0}, ""
    yield "a folder that is not there", nothing, MAPPER + "/no", {2, 3}, "known"
    yield "an empty folder", emptied, MAPPER, {3}, "known"
    yield "a file", as_file, MAPPER, {2, 3}, "known"
    yield "images.txt is a pipe", as_fifo, MAPPER, {3}, "images.txt"
    for name in ("cameras.txt", "images.txt"):
        yield f"without {name}", without_file(name), MAPPER, {3}, "known"
    yield "the scan instead", nothing, MAPPER.replace(" known", " scan.rtpi"), {2, 3}, "scan.rtpi"
    yield "the photos instead", nothing, MAPPER.replace(" known", " photos"), {3}, "photos"
    yield "it is the output", is_output, MAPPER.replace(" known", " mapped/0"), {2}, "mapped/0"
    yield "it is the output through a link", as_linked_output, MAPPER, {2}, "known"

    for share in (0, 0.1, 0.5, 0.9, 0.99):
        for cut in ("cameras.bin", "images.bin"):
            yield (f"{cut} cut at {share}",
                   binary(lambda name, data: data[:int(share * len(data))] if name == cut else data), MAPPER, {3}, cut)
    for count in (0, 1 << 20, 1 << 40, (1 << 64) - 1):
        for which in ("cameras.bin", "images.bin"):
            yield (f"{which} says {count} entries",
                   binary(lambda name, data: struct.pack("<Q", count) + data[8:] if name == which else data),
                   MAPPER, {3}, "known")
    for value in ("nan", "inf", "-inf", "1e999", "word"):
        yield f"a quaternion of {value}", pose(0, 1, [value]), MAPPER, {3}, "images.txt"
        yield f"a translation of {value}", pose(1, 5, [value]), MAPPER, {3}, "images.txt"
    yield "a quaternion of zeros", pose(0, 1, ["0"] * 4), MAPPER, {3}, "images.txt"
    yield "a quaternion of length 1000", pose(0, 1, ["1000", "0", "0", "0"]), MAPPER, fine | {3}, ""
    yield "a camera that is not there", pose(0, 8, ["77"]), MAPPER, {3}, "77"
    for title, fields in (("no size", ["1", "PINHOLE", "0", "0", "200", "200", "1", "1"]),
                          ("a negative size", ["1", "PINHOLE", "-240", "160", "200", "200", "1", "1"]),
                          ("no focal length", ["1", "PINHOLE", "240", "160", "0", "0", "120", "80"]),
                          ("a negative focal length", ["1", "PINHOLE", "240", "160", "-200", "-200", "120", "80"]),
                          ("a focal length of nan", ["1", "PINHOLE", "240", "160", "nan", "200", "120", "80"]),
                          ("too few numbers", ["1", "PINHOLE", "240", "160", "200"]),
                          ("an unknown model", ["1", "FISH", "240", "160", "200", "120", "80"]),
                          ("a panorama", ["1", "EQUIRECTANGULAR", "240", "160", "240", "160"]),
                          ("another size", ["1", "PINHOLE", "480", "320", "400", "400", "240", "160"])):
        yield f"a camera of {title}", change(camera=lambda _: fields), MAPPER, {3}, "known"
    for focal in ("1", "1e9"):
        yield (f"a camera of focal length {focal}",
               change(camera=lambda _: ["1", "PINHOLE", "240", "160", focal, focal, "120", "80"]), MAPPER, fine | {3},
               "")

    for name in ("", "../photo_000.jpg", "/photo_000.jpg", "no.jpg", "photo_000.jpg/", "n" * 5000):
        yield (f"every photo is called {name[:30]!r}",
               change(poses=lambda i, fields: fields[:9] + [name] if i == 0 or not name else None), MAPPER, {3},
               "known")
    yield ("two photos of one name",
           change(poses=lambda i, fields: fields[:9] + ["photo_000.jpg"] if i < 2 else fields), MAPPER, fine | {3}, "")
    yield ("one photo alone", change(poses=lambda i, fields: fields if i == 0 else None), warns, fine,
           "Fewer than two")

    yield "all at one place", centre_at(lambda i: (1.0, 1.2, 0.5)), MAPPER, {4}, "contradict"
    yield "all with the same pose", pose(None, 1, ["1", "0", "0", "0", "0", "0", "0"]), MAPPER, {4}, "contradict"
    yield "every one elsewhere", centre_at(lambda i: (7.0 * i, i * i, -3.0 * i)), MAPPER, {4}, "contradict"
    yield "turned over", pose(None, 1, ["0", "1", "0", "0"]), MAPPER, {4}, "contradict"
    for metres in ("1e30", "1e200", "1e300"):
        yield f"{metres} m away, alike", pose(None, 5, [metres] * 3), MAPPER, {3, 4}, ""
    yield "one of them 1e300 m away", pose(2, 5, ["1e300", "0", "0"]), MAPPER, fine | {3}, ""
    yield "one of them turned over", pose(2, 1, ["0", "1", "0", "0"]), warns, {0}, "were not taken where"


def known(base):
    base = prepared(base.programs)
    for title, prepare, line, codes, says in cases():
        here = base.copy()
        prepare(here.root)
        before = here.state(skip=("mapped/roomtex-mapper.log",))
        answer = here.run(line)
        problem = answer.problem(codes) or here.harm(before, skip=("mapped/roomtex-mapper.log",))
        if not problem and says not in answer.err:
            problem = f"does not say \"{says}\": {answer.err.strip()[-300:]}"
        yield f"{title} ({answer.code})", problem


if __name__ == "__main__":
    s.main({"known": known})
