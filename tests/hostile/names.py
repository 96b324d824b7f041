"""Photos of any name go through every command, and their names come out as they went in."""

import json
import os
import shutil

import scene as s

ONLY = os.environ.get("ROOMTEX_CASES", "")  # in the title
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
    """A copy of the scene whose first photo has this name, as COLMAP's binary model, with matches."""
    here = base.copy()
    old = here.root / "photos/photo_000.jpg"
    if exists:
        new = here.root / "photos" / name
        new.parent.mkdir(parents=True, exist_ok=True)
        old.rename(new)
    s.write_matches(here.root)
    s.write_binary_model(here.root / "sparse", {"photo_000.jpg": name})
    picks = (here.root / "picks.csv").read_text()
    (here.root / "picks.csv").write_text(picks.replace("photo_000.jpg", quoted(name)))
    s.rename_in_database(here.root / "database.db", "photo_000.jpg", name)
    shutil.copy(here.root / "database.db", here.root / "part.db")
    return here


def holds(name, path):
    return "" if name.encode() + b"\0" in path.read_bytes() else f"{path.name} has another name"


def report_of(path):
    return json.loads(path.read_text())


def pairs_are_ours(here, name):
    """Two names a line, of the database; COLMAP has no other way to write them."""
    known = {name} | {photo.name for photo in (here.root / "photos").glob("photo_*.jpg")}
    lines = (here.root / "pairs.txt").read_text().splitlines()
    wrong = [line for line in lines if not set(line.split(" ")) <= known]
    return f"no pair of names: {wrong[:2]}" if wrong else ""


TALE = "--quiet --input_path aligned --image_path photos --accept_untrusted 1 "


def steps(here, name):
    """Title, command, codes, and what must be so afterwards."""
    root = here.root
    yield ("align", s.ALIGN + " --image_path photos --output_path aligned --overlays 6 --report_path "
           "align.json", {0, 4}, lambda: holds(name, root / "aligned/images.bin") or
           ("" if len(report_of(root / "align.json")["overlays"]) == 6 and
            not report_of(root / "align.json")["photos_left_out"] else "photos are left out"))
    yield ("texture", s.TEXTURE.replace("--input_path sparse", "--input_path aligned") +
           " --output_path textured --accept_untrusted 1 --E57.images 1", {0, 4},
           lambda: "photos are left out" if report_of(root / "textured/report.json")["photos_left_out"]
           else "")
    yield ("import", "roomtex-import --quiet --input_path textured/model.e57 --images_path taken "
           "--E57.picks 1", {0}, lambda: "" if len([p for p in (root / "taken").rglob("*.jpg")]) == 6
           else "photos are missing")
    yield ("export", "roomtex-export " + TALE + "--output_path exported", {0, 4},
           lambda: holds(name, root / "exported/sparse/0/images.bin") or
           ("" if (root / "exported/images" / name).is_file() else "the photo is missing"))
    yield ("dense", "roomtex-dense " + TALE + "--output_path dense --max_image_size 64", {0, 4},
           lambda: holds(name, root / "dense/sparse/images.bin"))
    yield ("view", "roomtex-view --quiet --input_path textured --aligned aligned --image_path photos "
           "--output_path page", {0}, lambda: "" if (root / "page/data/photo.id-5.max-256.js").exists()
           else "a photo is missing")
    yield ("render", ["roomtex-render", "--quiet", "--ply_path", "textured/model.ply", "--input_path",
                      "aligned", "--image_path", "photos", "--image_name=" + name, "--width", "40",
                      "--output_path", "picture.png"], {0}, None)
    yield ("associate", "roomtex-associate --quiet --database_path database.db --image_path photos "
           "--output_path associated.csv --links_path links", {0, 4}, None)
    yield ("mapper", "roomtex-mapper --quiet --database_path database.db --image_path photos "
           "--output_path mapped", {0, 4}, lambda: "")
    # A name with a blank cannot stand in COLMAP's list of pairs.
    yield ("pairs", "roomtex-pairs --quiet --database_path database.db --output_path pairs.txt",
           {0, 4} | ({3} if set(name) & set(" \n\t") else set()),
           lambda: pairs_are_ours(here, name) if (root / "pairs.txt").exists() else "")
    yield ("merge", "roomtex-merge --quiet --database_path database.db --copy_path part.db "
           "--output_path merged.db", {0, 4}, None)
    yield ("auto", "roomtex-auto --quiet --image_path photos --scan_path scan.rtpi --output_path "
           "result --dry_run", {0}, None)


def run(base):
    for title, name in NAMES.items():
        if ONLY not in title:
            continue
        here = with_name(base, name)
        for step, line, codes, check in steps(here, name):
            problem = here.run(line).problem(codes) or (check() if check else "")
            yield f"{title}: {step}", problem
    yield from rooms(base)


def rooms(base):
    """Folders of these names as rooms of a site and of roomtex-join."""
    made = base.copy()
    for line in (s.ALIGN + " --image_path photos --output_path room",):
        assert not made.run(line).problem({0, 4})
    for title, name in NAMES.items():
        if ONLY not in title or "/" in name:
            continue
        here = made.copy()
        shutil.copytree(here.root / "room", here.root / "rooms" / name)
        (here.root / "rooms" / name / "steps.json").write_text('{"steps": {}}')
        answer = here.run(["roomtex-site", "--quiet", "--input_path", "rooms", "--output_path",
                           "site.html"])
        problem = answer.problem({0, 4})
        if not problem and json.dumps(name) not in json.dumps(report_of(here.root / "site.json")):
            problem = "site.json has another name"
        yield f"{title}: site", problem
        answer = here.run(["roomtex-join", "--quiet", "--input_path", "room", "--input_path",
                           "rooms/" + name, "--output_path", "joined", "--accept_untrusted", "1"])
        yield f"{title}: join", answer.problem({0, 4})


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
        yield f"model names {name}: texture", problem
        room = "--quiet --input_path sparse --image_path photos --scan_path scan.rtpi "
        for title, line in (
                ("export", "roomtex-export " + room + "--output_path new"),
                ("dense", "roomtex-dense " + room + "--max_image_size 64 --output_path new"),
                ("view", "roomtex-view --quiet --input_path textured --aligned sparse --image_path "
                 "photos --output_path new"),
                ("render", "roomtex-render --quiet --ply_path textured/model.ply --input_path sparse "
                 f"--image_path photos --image_name {name} --width 40 --output_path picture.png"),
                ("align", s.ALIGN + " --image_path photos --overlays 6 --output_path new")):
            now = here.copy()
            shutil.rmtree(now.root / "new", ignore_errors=True)
            answer = now.run(line)
            problem = answer.problem({0, 3, 4})
            shown = [path for path in (now.root / "new").rglob("*")
                     if path.is_file() and path.read_bytes() == photo]
            if not problem and (shown or (title == "render" and answer.code == 0)):
                problem = f"shows it: {shown}"
            if not problem and title == "view" and len(
                    list((now.root / "new/data").glob("photo.id-*.max-256.js"))) != 5:
                problem = "shows it"
            if not problem and title in ("export", "dense") and len(
                    list((now.root / "new/images").rglob("*.jpg"))) != 5:
                problem = "shows it"
            yield f"model names {name}: {title}", problem
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
