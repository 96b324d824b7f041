"""Photos of any name go through every command, and their names come out as they went in."""

import json

import scene as s

NAMES = {
    "a blank": "my photo.jpg",
    "blanks at the ends": " photo .jpg ",
    "a line end": "two\nlines.jpg",
    "a tab": "tab\there.jpg",
    "UTF-8": "Fläche_部屋_🏠.jpg",
    "a comma": "a,b.jpg",
    "quotes": "say \"cheese\" 'now'.jpg",
    "a leading dash": "-rf.jpg",
    "a comment's sign": "#1.jpg",
    "200 characters": "n" * 196 + ".jpg",
    "a folder": "left/upper/photo.jpg",
    "a percent sign": "100%s%n.jpg",
    "a backslash": "a\\b.jpg",
    "a semicolon and a dollar": "a;$(true)`b`.jpg",
}
OUTSIDE = ["../outside.jpg", "sub/../../outside.jpg", "/etc/hostname"]


def quoted(name):
    return '"' + name.replace('"', '""') + '"'


def with_name(base, name, exists=True):
    """A copy of the scene whose first photo has this name, as COLMAP's binary model."""
    here = base.copy()
    old = here.root / "photos/photo_000.jpg"
    if exists:
        new = here.root / "photos" / name
        new.parent.mkdir(parents=True, exist_ok=True)
        old.rename(new)
    s.write_binary_model(here.root / "sparse", {"photo_000.jpg": name})
    picks = (here.root / "picks.csv").read_text()
    (here.root / "picks.csv").write_text(picks.replace("photo_000.jpg", quoted(name)))
    s.rename_in_database(here.root / "database.db", "photo_000.jpg", name)
    return here


def run(base):
    for title, name in NAMES.items():
        here = with_name(base, name)
        problem = ""
        answer = here.run(s.ALIGN + " --image_path photos --output_path aligned --overlays 6 "
                          "--report_path align.json")
        problem = answer.problem({0, 4})
        if not problem:
            if name.encode() + b"\0" not in (here.root / "aligned/images.bin").read_bytes():
                problem = "the aligned model has another name"
            report = json.loads((here.root / "align.json").read_text())
            if len(report["overlays"]) != 6 or report["photos_left_out"]:
                problem = "align leaves photos out"
        if not problem:
            answer = here.run(s.TEXTURE.replace("--input_path sparse", "--input_path aligned")
                              + " --output_path textured --accept_untrusted 1")
            problem = answer.problem({0, 4})
        if not problem:
            report = json.loads((here.root / "textured/report.json").read_text())
            if report["photos_left_out"] or name not in json.dumps(report, ensure_ascii=False):
                problem = problem or ("" if not report["photos_left_out"] else
                                      "texture leaves photos out")
        if not problem:
            answer = here.run("roomtex-associate --quiet --database_path database.db "
                              "--image_path photos --output_path pairs.csv --links_path links")
            problem = answer.problem({0, 4})
        if not problem:
            answer = here.run("roomtex-mapper --quiet --database_path database.db --image_path "
                              "photos --output_path mapped")
            problem = answer.problem({3})  # no matches
        yield title, problem


def outside(base):
    """A name that leads out of --image_path is no photo, whatever lies there."""
    for name in OUTSIDE:
        here = with_name(base, name, exists=False)
        photo = (here.root / "photos/photo_001.jpg").read_bytes()
        (here.root / "outside.jpg").write_bytes(photo)
        answer = here.run("roomtex-texture --quiet --input_path sparse --image_path photos "
                          "--scan_path scan.rtpi --output_path textured --Texture.scale 1")
        problem = answer.problem({0, 4})
        if not problem:
            left_out = json.loads((here.root / "textured/report.json").read_text())[
                "photos_left_out"]
            if [one["name"] for one in left_out] != [name]:
                problem = f"texture uses it: left out are {left_out}"
        yield f"model names {name}", problem
        if name != OUTSIDE[0]:
            continue  # there is no such file below photos
        here = base.copy()
        (here.root / "outside.jpg").write_bytes(photo)
        (here.root / "pairs.csv").write_text(
            "patterned_image,plain_image,offset_px,brightness_ratio\n"
            f"photo_000.jpg,{name},0,1\nphoto_001.jpg,photo_002.jpg,0,1\n")
        answer = here.run("roomtex-texture --quiet --input_path sparse --image_path photos "
                          "--scan_path scan.rtpi --output_path textured --Texture.scale 1 "
                          "--associations_path pairs.csv")
        problem = answer.problem({0, 4})
        if not problem:
            left_out = json.loads((here.root / "textured/report.json").read_text())[
                "photos_left_out"]
            if not any("leads out" in one["reason"] for one in left_out):
                problem = f"texture uses it: left out are {left_out}"
        yield f"associations name {name}", problem


if __name__ == "__main__":
    s.main({"names": run, "outside": outside})
