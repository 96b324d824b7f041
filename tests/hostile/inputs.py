"""Inputs are never changed: outputs that are inputs, by every road that leads there."""

import os
import shutil

import scene as s
from commands import LINES, prepared


def cases():
    # title, command line, what is prepared before (a function of the folder)
    nothing = lambda root: None

    def link(name, target):
        def prepare(root):
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            os.symlink(os.path.relpath(root / target, (root / name).parent), root / name)
        return prepare

    def copy(name, source):
        def prepare(root):
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes((root / source).read_bytes())
        return prepare

    align = s.ALIGN + " --output_path aligned"
    texture = s.TEXTURE + " --output_path textured"
    for path in ("scan.rtpi", "picks.csv", "sparse/images.txt", "./photos/../scan.rtpi"):
        yield f"align --report_path {path}", f"{align} --report_path {path}", nothing
    yield ("align --report_path of the ini file",
           f"{align} --project_path project.ini --report_path project.ini", nothing)
    yield ("align --report_path through a link", f"{align} --report_path out.json",
           link("out.json", "scan.rtpi"))
    yield ("align --report_path through a linked folder", f"{align} --report_path there/scan.rtpi",
           lambda root: os.symlink(".", root / "there"))
    yield "align --Plane.output_path", f"{align} --Plane.output_path scan.rtpi", nothing
    yield ("align --report_path of a photo",
           f"{align} --image_path photos --report_path photos/photo_000.jpg", nothing)
    yield ("align with alignment.json as picks",
           align.replace("--picks_path picks.csv", "--picks_path aligned/alignment.json"),
           copy("aligned/alignment.json", "picks.csv"))
    yield ("align with the scan named as an output",
           align.replace("scan.rtpi", "aligned/points3D.bin"),
           copy("aligned/points3D.bin", "scan.rtpi"))
    yield f"texture --report_path of the database", f"{texture} --report_path database.db", nothing
    for name, source in (("evidence.ply", "scan.rtpi"), ("model.rtpi", "scan.rtpi"),
                         ("report.json", "scan.rtpi"), ("texture.png", "scan.rtpi")):
        yield (f"texture with a scan {name} in the output folder",
               texture.replace("scan.rtpi", f"textured/{name}"), copy(f"textured/{name}", source))
    yield ("texture with a link model.rtpi to the scan in the output folder", texture,
           link("textured/model.rtpi", "scan.rtpi"))
    yield ("texture into the folder of a photo texture.png",
           s.TEXTURE.replace("--image_path photos", "--image_path .")
           .replace("--input_path sparse", "--input_path with_texture_png")
           .replace("--database_path database.db ", "") + " --output_path .",
           with_texture_png)
    yield "import over its input", "roomtex-import --input_path scan.rtpi --output_path scan.rtpi", nothing
    yield ("import over its input by another name",
           "roomtex-import --input_path scan.rtpi --output_path sub/out.rtpi",
           link("sub/out.rtpi", "scan.rtpi"))
    yield ("import: report is the output",
           "roomtex-import --input_path scan.rtpi --output_path out.ply --report_path out.ply",
           nothing)
    yield ("import: report is the input",
           "roomtex-import --input_path scan.rtpi --output_path out.ply --report_path scan.rtpi",
           nothing)
    for path in ("database.db", "photos/photo_001.jpg"):
        yield (f"associate --output_path {path}",
               "roomtex-associate --quiet --database_path database.db --image_path photos "
               f"--output_path {path}", nothing)
    yield ("calibrate --output_path database",
           "roomtex-calibrate --image_path photos --board 9x6 --square 0.025 --apply database.db "
           "--output_path database.db", nothing)
    yield ("calibrate --apply_output database",
           "roomtex-calibrate --image_path photos --board 9x6 --square 0.025 --apply database.db "
           "--output_path camera.txt --apply_output ./database.db", nothing)
    yield ("calibrate --coverage_path photo",
           "roomtex-calibrate --image_path photos --board 9x6 --square 0.025 "
           "--output_path camera.txt --coverage_path photos/photo_002.jpg", nothing)
    yield ("pattern --output_path photo",
           "roomtex-pattern --output_path photos/photo_000.jpg --input_path photos/photo_000.jpg",
           nothing)
    yield ("pattern --report_path photo",
           "roomtex-pattern --output_path p.png --input_path photos/photo_000.jpg "
           "--report_path photos/photo_000.jpg", nothing)
    yield ("evaluate --report_path truth",
           "roomtex-evaluate --capture_path . --aligned_path sparse --report_path scan.rtpi",
           nothing)
    yield ("mapper --report_path database",
           "roomtex-mapper --database_path database.db --image_path photos --output_path mapped "
           "--report_path database.db", nothing)
    yield ("render --output_path photo",
           "roomtex-render --ply_path truth/true_colors.ply --input_path sparse "
           "--image_path photos --output_path photos/photo_000.jpg", nothing)
    for command, output in (("roomtex-view --input_path textured", "--output_path textured"),
                            ("roomtex-view --input_path textured --output_path page",
                             "--report_path textured/model.ply"),
                            ("roomtex-view --input_path textured --aligned sparse",
                             "--output_path page --report_path sparse/images.txt"),
                            ("roomtex-outline --input_path scan.rtpi", "--output_path scan.rtpi"),
                            ("roomtex-outline --input_path sparse --output_path o.json",
                             "--model_path o.json"),
                            ("roomtex-merge --database_path database.db --copy_path database.db",
                             "--output_path database.db"),
                            ("roomtex-pairs --database_path database.db --output_path p.txt",
                             "--graph_path database.db"),
                            ("roomtex-site --input_path rooms", "--output_path rooms/hall/report.html"),
                            ("roomtex-site --input_path rooms", "--output_path rooms/hall/steps.html"),
                            ("roomtex-calibrate --board 6x4 --image_path photos --output_path c.txt",
                             "--board_path photos/photo_000.jpg"),
                            ("roomtex-export --input_path sparse --image_path photos "
                             "--scan_path scan.rtpi", "--output_path sparse"),
                            ("roomtex-dense --input_path sparse --image_path photos "
                             "--scan_path scan.rtpi", "--output_path photos")):
        yield f"{command.split()[0][8:]} {output}", f"{command} {output}", with_results
    yield ("auto --report_path scan",
           "roomtex-auto --image_path photos --scan_path scan.rtpi --output_path result "
           "--report_path scan.rtpi", nothing)


def with_results(root):
    """What stands in for results of other commands: no more is needed to see that it stays."""
    (root / "textured").mkdir()
    shutil.copy(root / "truth/true_colors.ply", root / "textured/model.ply")
    (root / "rooms/hall").mkdir(parents=True)
    (root / "rooms/hall/steps.json").write_text('{"steps": {}}')
    (root / "rooms/hall/report.html").write_text("mine")


def with_texture_png(root):
    """The first photo of the model is called texture.png, and lies where the texture will."""
    folder = root / "with_texture_png"
    folder.mkdir()
    for name in ("cameras.txt", "images.txt", "points3D.txt"):
        text = (root / "sparse" / name).read_text()
        text = text.replace("photo_000.jpg", "texture.png")
        (folder / name).write_text(text)
    for photo in (root / "photos").iterdir():
        name = "texture.png" if photo.name == "photo_000.jpg" else photo.name
        (root / name).write_bytes(photo.read_bytes())


def run(base):
    for title, line, prepare in cases():
        here = base.copy()
        prepare(here.root)
        before = here.state()
        answer = here.run(line)
        after = here.state()
        changed = [name for name in before if after.get(name) != before[name]]
        problem = answer.problem({2, 3} if prepare is with_results else {2})
        if changed:
            problem = f"changed {changed}; " + problem
        yield title, problem


def inputs_of(root, words):
    """Values of options that are there: files, and of a folder the folder and its first file."""
    for value in dict.fromkeys(words[1:]):
        path = root / value
        if value.startswith("-") or not path.exists() or value == ".":
            continue
        yield value
        if path.is_dir():
            yield os.path.relpath(next(p for p in sorted(path.rglob("*")) if p.is_file()), root)


def every(base):
    """Each option of every command that names an output, with each of its inputs."""
    base = prepared(base)
    for one in LINES:
        words = one.line.split()
        outputs = {name for name, value in zip(words, words[1:])
                   if name.endswith("_path") and not (base.root / value).exists()}
        for name in sorted(outputs | {"--report_path"}):
            for value in inputs_of(base.root, words):
                line = list(words)
                if name in line:
                    line[line.index(name) + 1] = value
                else:
                    line += [name, value]
                here = base.copy()
                before = here.state()
                answer = here.run(line)
                after = here.state()
                changed = [file for file in before if after.get(file) != before[file]]
                # A folder may get results beside what it holds.
                is_folder = (base.root / value).is_dir()
                problem = answer.problem({0, 2, 3, 4} if is_folder else {2, 3})
                if changed:
                    problem = f"changed {changed[:3]}; " + problem
                yield f"{one.title} {name} {value} ({answer.code})", problem


if __name__ == "__main__":
    s.main({"inputs": run, "every_input": every})
