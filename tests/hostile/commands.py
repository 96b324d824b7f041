"""Every command once, on a small room: the lines that the tables take, so that a command which is new is in all of them."""

import dataclasses
import json
import shutil

import scene as s


@dataclasses.dataclass
class Line:
    title: str
    line: str
    folder: str = None  # its files appear as a set
    unsteady: tuple = ()  # files and folders that hold times
    again: bool = True  # over its own results; False: it replaces nothing
    old: str = " --random_seed 7"  # options of the run that left those results
    where: str = ""  # the folder to work in
    together: bool = True  # all files, in whatever folders, appear as one answer once the next command has run


ROOM = "--quiet --input_path room --image_path photos --accept_untrusted 1 "

# In alphabetical order of the commands.
LINES = [
    Line("align", s.ALIGN + " --image_path photos --output_path aligned", "aligned", ("aligned/alignment.json",)),
    Line("associate", "roomtex-associate --quiet --database_path database.db --image_path photos "
         "--output_path pairs.csv --links_path links", "links"),
    Line("auto", "roomtex-auto --quiet --image_path photos --scan_path scan.rtpi --picks_path "
         "picks.csv --output_path result --only align --quality low --accept_untrusted 1", None,
         ("result/log", "result/aligned/alignment.json", "result/steps.json", "result/report.json",
          "result/report.html"), together=False),
    Line("calibrate", "roomtex-calibrate --quiet --image_path boards --board 6x4 --output_path "
         "camera.txt --coverage_path cover/coverage.png --apply database.db --apply_output "
         "copies/copy.db --report_path reports/r.json", None, ("reports/r.json",)),
    Line("dense", "roomtex-dense " + ROOM + "--output_path dense --max_image_size 64", "dense",
         ("dense/report.json",)),
    Line("evaluate", "roomtex-evaluate --quiet --truth_path truth --input_path sparse --ply_path "
         "coloured/model.ply --scan_path scan.rtpi --error_path error.png --report_path "
         "reports/r.json", None, ("reports/r.json",)),
    Line("export", "roomtex-export " + ROOM + "--output_path exported", "exported",
         ("exported/report.json",)),
    Line("import", "roomtex-import --quiet --input_path scan.rtpi --output_path room.ply"),
    Line("join", "roomtex-join --quiet --input_path room --input_path other_room --output_path "
         "joined --accept_untrusted 1", "joined", ("joined/joined.json",)),
    Line("mapper", "roomtex-mapper --quiet --database_path database.db --image_path photos "
         "--output_path mapped", "mapped",
         ("mapped/roomtex-mapper.log", "mapped/0/roomtex-mapper.json")),
    Line("merge", "roomtex-merge --quiet --database_path database.db --copy_path part.db "
         "--output_path merged.db"),
    Line("outline", "roomtex-outline --quiet --outline_path house.json --output_path outline.json "
         "--model_path house.obj --model_path house.glb", again=False),
    Line("pairs", "roomtex-pairs --quiet --database_path database.db --output_path pairs.txt "
         "--graph_path graph.json"),
    Line("pattern", "roomtex-pattern --quiet --output_path pattern.png --width 320 --height 240"),
    Line("render", "roomtex-render --quiet --ply_path coloured/model.ply --input_path sparse "
         "--num_photos 1 --num_ring 1 --width 40 --folder_path pictures", "pictures"),
    Line("simulate", "roomtex-simulate --quiet --output_path new --num_photos 2 --photo_width 64 "
         "--photo_height 64 --scan_columns 40 --scan_rows 20 --furnished 0"),
    Line("site", "roomtex-site --quiet --input_path . --output_path site.html", None,
         ("site.html", "site.json")),
    Line("texture", s.TEXTURE + " --output_path textured", "textured", ("textured/report.json",)),
    Line("view", "roomtex-view --quiet --input_path coloured --aligned sparse --image_path photos "
         "--output_path page", "page", ("page/report.json",)),
]
# Without a model and picks: each photo is placed by itself, or refused.
ALONE = Line("align photos alone", "roomtex-align --quiet --image_path photos --scan_path scan.rtpi --output_path alone",
             "alone", ("alone/alignment.json",))
# A server has tables of its own (servers), and tools of the developers are not installed.
WITHOUT = {"roomtex-pick", "roomtex-evaluate-texture"}

FLAT = {"format": "roomtex outline", "version": 1, "metric": True,
        "outline_from_input": {"scale": 1, "rotation_wxyz": [1, 0, 0, 0], "translation": [0, 0, 0]},
        "geo_origin": None,
        "buildings": [{"name": "a", "ground": 0, "footprint": [[0, 0], [8, 0], [8, 5], [0, 5]],
                       "roof": [{"point": [0, 0, 3], "slope_deg": 0, "downhill_deg": 0}]}]}


def without_line(programs):
    """Commands that no line runs."""
    there = {path.name for path in programs.glob("roomtex-*")}
    return sorted(there - WITHOUT - {one.line.split()[0] for one in LINES})


def prepared(base):
    """The scene with all that the lines read: matches, boards, stations, results, parts of a site."""
    here = base.copy()
    root = here.root
    s.write_matches(root)
    s.write_boards(root / "boards")
    s.write_stations(root)
    shutil.copy(root / "database.db", root / "part.db")
    (root / "house.json").write_text(json.dumps(FLAT))
    for folder in ("planes", "reports", "meshes", "clouds", "cover", "copies", "result/sparse", "hall"):
        (root / folder).mkdir(parents=True)
    (root / "hall/steps.json").write_text('{"steps": {}}')
    for name in ("0", "init"):
        shutil.copytree(root / "sparse", root / "result/sparse" / name)
    shutil.copy(root / "database.db", root / "result")
    for line in (s.ALIGN + " --image_path photos --output_path room",
                 s.TEXTURE + " --output_path coloured --E57.images 1"):
        answer = here.run(line)
        assert not answer.problem({0, 4}), answer.err
    shutil.copytree(root / "room", root / "other_room")
    return here


TIMES = ("seconds", "cpu_seconds", "peak_memory_bytes", "options", "version", "commands", "command_line")


def without_times(value):
    if isinstance(value, dict):
        return {key: without_times(one) for key, one in value.items() if key not in TIMES}
    return [without_times(one) for one in value] if isinstance(value, list) else value


def is_unsteady(name, unsteady):
    return any(name == one or name.startswith(one + "/") for one in unsteady)


def outputs(here, before, unsteady=()):
    """What is new or another; of reports all but times, options and places."""
    files = {}
    for name, content in here.state().items():
        if before.get(name) == content:
            continue
        if name.endswith("steps.json"):
            content = "with times"
        elif name.endswith(".json"):
            text = (here.root / name).read_text().replace(str(here.root), "")
            content = json.dumps(without_times(json.loads(text)))
        elif is_unsteady(name, unsteady):
            content = "with times"
        files[name] = content
    return files
