"""Odd inputs and options of every command: an answer or a sentence, and no input changed."""

import json
import os
import shlex
import socket

import scene as s
from commands import FLAT, prepared

ALIGN = s.ALIGN + " --output_path aligned"
TEXTURE = s.TEXTURE + " --output_path textured"
IMPORT = "roomtex-import --quiet --input_path scan.rtpi --output_path room.ply"
ASSOCIATE = ("roomtex-associate --quiet --database_path database.db --image_path photos "
             "--output_path pairs.csv")
MAPPER = ("roomtex-mapper --quiet --database_path database.db --image_path photos "
          "--output_path mapped")
PAIRS = "roomtex-pairs --quiet --database_path database.db --output_path pairs.txt"
CALIBRATE = "roomtex-calibrate --quiet --image_path photos --board 6x4 --output_path camera.txt"
PATTERN = "roomtex-pattern --quiet --output_path pattern.png"
SIMULATE = ("roomtex-simulate --quiet --output_path new --num_photos 2 --photo_width 64 "
            "--photo_height 64 --scan_columns 40 --scan_rows 20 --furnished 0")
EXPORT = "roomtex-export --quiet --input_path aligned --image_path photos --output_path exported"
DENSE = "roomtex-dense --quiet --input_path aligned --image_path photos --output_path dense"
OUTLINE = "roomtex-outline --quiet --input_path sparse --output_path outline.json"
EXTRUDE = ("roomtex-outline --quiet --outline_path o.json --output_path out.json "
           "--model_path house.obj")
EVALUATE = "roomtex-evaluate --quiet --truth_path truth --input_path sparse"
AUTO = "roomtex-auto --quiet --image_path photos --scan_path scan.rtpi --output_path result"
PICK = ("roomtex-pick --quiet --input_path sparse --image_path photos --scan_path scan.rtpi "
        "--output_path p.csv --port 0")
VIEW = "roomtex-view --quiet --input_path textured --port 0"
# Of what prepared() adds.
PAGE = ("roomtex-view --quiet --input_path coloured --aligned room --image_path photos "
        "--output_path page")
PHOTOS = "roomtex-import --quiet --input_path coloured/model.e57 --images_path taken"
MADE = "--quiet --input_path room --image_path photos --output_path "
SPLAT = "roomtex-export " + MADE + "exported --accept_untrusted 1"
HOLES = "roomtex-dense " + MADE + "dense --accept_untrusted 1 --max_image_size 64"
BOARDS = ("roomtex-calibrate --quiet --image_path boards --board 6x4 --output_path camera.txt "
          "--Trust.min_photos 3")
BOARD = ("roomtex-calibrate --quiet --board 6x4 --board_type charuco --marker 0.018 "
         "--board_path board.pdf")
STATIONS = ("roomtex-texture --quiet --input_path sparse --image_path photos --scan_path scan.rtpi "
            "--scan_path other.rtpi --scan_poses poses.txt --Texture.scale 1 --output_path textured "
            "--max_samples 9000")
PICTURES = ("roomtex-render --quiet --ply_path coloured/model.ply --input_path sparse --num_photos 1 "
            "--num_ring 1 --width 40 --folder_path pictures")
PICTURE = ("roomtex-render --quiet --glb_path coloured/model.glb --input_path sparse --width 40 "
           "--output_path picture.png")
MERGE = ("roomtex-merge --quiet --database_path database.db --copy_path part.db "
         "--output_path merged.db")
SITE = "roomtex-site --quiet --input_path . --output_path site.html"

def write(name, content):
    def change(root):
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_symlink() or path.is_dir():
            return
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return change


def text(name, old, new, count=1):
    return lambda root: write(name, (root / name).read_text().replace(old, new, count))(root)


def outline(**changes):
    return write("o.json", json.dumps({**FLAT, **changes}))


def building(**changes):
    return outline(buildings=[{**FLAT["buildings"][0], **changes}])


def replaced(name, make):
    def change(root):
        path = root / name
        if path.is_dir():
            path.rename(root / "was_here")
        elif path.exists():
            path.unlink()
        make(path)
    return change


def folder(name):
    return replaced(name, lambda path: path.mkdir())


def fifo(name):
    return replaced(name, os.mkfifo)


def loop(name):
    return replaced(name, lambda path: path.symlink_to(path.name))


def unix_socket(name):
    def make(path):
        here = os.getcwd()
        os.chdir(path.parent)  # a long path does not fit into its address
        socket.socket(socket.AF_UNIX).bind(path.name)
        os.chdir(here)
    return replaced(name, make)


def folder_below(name):
    return lambda root: (root / name).mkdir(parents=True)


def moved(old, new):
    return lambda root: (root / old).rename(root / new)


def full(name):
    """A folder in which nothing can be made, whoever asks: a link into the kernel's."""
    return replaced(name, lambda path: path.symlink_to("/proc/self"))


def pick_at(value):
    """The x of the first pick."""
    def change(root):
        lines = (root / "picks.csv").read_text().split("\n")
        fields = lines[1].split(",")
        lines[1] = ",".join([fields[0], value] + fields[2:])
        (root / "picks.csv").write_text("\n".join(lines))
    return change


def with_options(line, options):
    """Options of the line with another value, and further ones; twice in the title is twice."""
    words, given = shlex.split(line), shlex.split(options)
    for name, value in zip(given[::2], given[1::2] + [""]):
        if name in words and name + " " + value not in line:
            words[words.index(name) + 1] = value
        else:
            words += [name, value] if len(given) > 1 else [name]
    return words


def nothing(root):
    pass


DEEP = '{"trusted": true, "options": ' + "[" * 200000 + "]" * 200000 + "}"
RAN, BAD = {0, 4}, {2, 3}


def fifo_in(parent, name):
    def change(root):
        (root / parent).mkdir()
        os.mkfifo(root / parent / name)
    return change


def glb(text_of_json):
    data = text_of_json.encode()
    sizes = (2, 20 + len(data), len(data))
    return b"glTF" + b"".join(n.to_bytes(4, "little") for n in sizes) + b"JSON" + data


def command_of(line):
    return line.split()[0][len("roomtex-"):]


def wrong_kinds():
    places = {"scan.rtpi": (IMPORT, ALIGN, TEXTURE), "picks.csv": (ALIGN,),
              "database.db": (MAPPER, PAIRS, ASSOCIATE), "sparse/images.txt": (ALIGN, TEXTURE),
              "sparse": (EVALUATE, OUTLINE), "photos": (CALIBRATE, PICK)}
    for name, lines in places.items():
        for line in lines:
            for kind, change in (("an empty file", replaced(name, lambda path: path.touch())),
                                 ("an empty folder", folder(name)),
                                 ("a link to itself", loop(name)),
                                 ("a socket", unix_socket(name))):
                yield f"{command_of(line)}: {name} is {kind}", change, line, {3}


def poses_of_zeros(root):
    lines = (root / "sparse/images.txt").read_text().split("\n")
    fields = lines[0].split()
    lines[0] = " ".join([fields[0], "0", "0", "0", "0"] + fields[5:])
    (root / "sparse/images.txt").write_text("\n".join(lines))


def picks_as(change):
    return lambda root: write("picks.csv", change((root / "picks.csv").read_text()))(root)


def numbers():
    for value in ("nan", "inf", "1e308", "-1e9", "", "0x10", "1e"):
        yield f"align: a pick at {value!r}", pick_at(value), ALIGN, {3}
        yield (f"align: a camera of {value!r}",
               text("sparse/cameras.txt", " 240 160 ", f" {value} 160 "), ALIGN, {3})
    yield ("align: an image of camera 4294967295",
           text("sparse/images.txt", " 1 photo_000", " 4294967295 photo_000"), ALIGN, {3})
    yield ("align: an image of no name", text("sparse/images.txt", " photo_000.jpg", " "), ALIGN,
           {3})
    yield "align: a quaternion of zeros", poses_of_zeros, ALIGN, {3}
    yield ("align: every pick twice", picks_as(lambda p: p + p[p.index("\n") + 1:]), ALIGN, {3})
    yield "align: picks with a header alone", picks_as(lambda p: p.split("\n")[0]), ALIGN, {3}
    yield "align: a megabyte of commas as picks", picks_as(lambda p: "," * (1 << 20)), ALIGN, {3}
    yield "align: picks in UTF-16", picks_as(lambda p: p.encode("utf-16")), ALIGN, {3}


def beside():
    for name, content in (("nested 200 000 deep", DEEP), ("empty", ""), ("a list", "[]"),
                          ("broken", "{"), ("binary", b"\xff\xfe\0"),
                          ("with a number of 1e999", '{"scans": [1e999]}')):
        change = write("sparse/alignment.json", content)
        yield f"texture: alignment.json is {name}", change, TEXTURE, {3}
        yield f"outline: alignment.json is {name}", change, OUTLINE, {3}
    for kind, change in (("a folder", folder("sparse/alignment.json")),
                         ("a pipe", fifo("sparse/alignment.json"))):
        yield f"texture: alignment.json is {kind}", change, TEXTURE, {0, 3, 4}
        yield f"outline: alignment.json is {kind}", change, OUTLINE, {0, 3, 4}
    dry = AUTO + " --dry_run"
    yield "auto: steps.json is nested 200 000 deep", write("result/steps.json", DEEP), dry, {0, 3}
    yield "auto: steps.json is a pipe", fifo_in("result", "steps.json"), dry, {0, 3}
    yield "view: a model.glb of nothing", write("textured/model.glb", ""), VIEW, {3}
    yield ("view: a model.glb of 2 GB of JSON", write(
        "textured/model.glb", b"glTF\2\0\0\0\xff\xff\xff\x7f\xff\xff\xff\x7fJSON{}"), VIEW, {3})
    yield ("view: a model.glb whose JSON is nested", write(
        "textured/model.glb", glb('{"asset":' + "[" * 100000 + "]" * 100000 + "}")), VIEW, {3})
    yield "view: a folder without a model", folder("textured"), VIEW, {3}
    yield ("align: panoramas.json is a table", nothing, ALIGN + " --panoramas_path picks.csv", {3})


def outlines():
    zigzag = ([[8 + i / 300, (i % 2) + 1e-3 * i] for i in range(1000)] +
              [[8 + i / 300, 9 + i % 2] for i in range(999, -1, -1)])
    cone = [{"point": [0, 0, 3 + 0.01 * i], "slope_deg": 40, "downhill_deg": 7.2 * i}
            for i in range(50)]
    high = json.dumps(FLAT).replace('"ground": 0', '"ground": 1e999')
    for title, change, codes in (
            ("a good one", outline(), {0}),
            ("nested 200 000 deep", write("o.json", DEEP), {3}),
            ("a height of 1e999", write("o.json", high), {3}),
            ("no building", outline(buildings=[]), {0, 3, 4}),
            ("version \"1\"", outline(version="1"), {3}),
            ("a bow tie", building(footprint=[[0, 0], [8, 5], [8, 0], [0, 5]]), {3}),
            ("a name of control signs", building(name="a\n\"b\" <c>\t\u0000"), {0, 3}),
            ("far away", building(footprint=[[1e9, 1e9], [1e9, 9e8], [9e8, 1e9]]), {0, 3}),
            ("a needle", building(footprint=[[0, 0], [8, 0], [8, 1e-6]]), {0, 3}),
            ("fifty roof planes", building(roof=cone), {0, 3}),
            ("2000 corners", building(footprint=zigzag), {0, 3})):
        yield "outline: " + title, change, EXTRUDE, codes
    yield "outline: edited by a hand that nested it", write("outline.json", DEEP), OUTLINE, {3}
    yield "outline: to an unknown kind", outline(), EXTRUDE.replace(".obj", ".dwg"), {2}


OPTIONS = {
    IMPORT: ("--max_range -1", "--max_range nan", "--max_range 1e-300", "--num_threads 0",
             "--Mesh.max_edge_ratio 0", "--Mesh.max_bend inf", "--num_threads -2",
             "--random_seed 1e99", "--quiet maybe", "--units furlongs",
             "--output_path .ply", "--output_path /", "--output_path ''"),
    ALIGN: ("--near nowhere", "--near 1,2", "--geo_origin 91,0,0", "--geo_origin 1e400,0,0",
            "--overlays -1", "--overlays 2000000000 --image_path photos",
            "--Scale.max_features 0", "--PlaneBA.num_rounds 2000000000",
            "--PlaneBA.max_iterations 0", "--Plane.min_area_m2 1e300", "--Plane.min_window 0",
            "--Plane.max_angle_deg 360", "--database_path photos"),
    TEXTURE: ("--Texture.scale 17", "--Texture.scale 1e9", "--Texture.max_memory_mb 1",
              "--Texture.texel_mm 1e-9", "--Blend.max_views 0", "--Blend.max_views 2000000000",
              "--Blend.detail_sigma 1e9 --Blend.detail 1", "--Occlusion.depth_tolerance nan",
              "--Occlusion.depth_map_size 2000000000", "--Exposure.bracket_path photos",
              "--debug_path scan.rtpi", "--Surface.smoothing_radius 2000000000",
              "--supplement_path scan.rtpi"),
    PATTERN: ("--width 2000000000", "--width 0", "--height 1", "--blocks 0", "--blocks 100000",
              "--brightness 7", "--input_path picks.csv", "--evaluate_path photos"),
    SIMULATE: ("--num_photos 0", "--photo_width 100000 --photo_height 100000", "--seed nan",
               "--scan_columns 1", "--scan_columns 1000000 --scan_rows 1000000"),
    ASSOCIATE: ("--max_offset -1", "--max_offset inf", "--links_path photos",
                "--links_path pairs.csv"),
    PAIRS: ("--Pairs.max_neighbors 0", "--Pairs.num_features 2000000000",
            "--Pairs.max_ratio nan", "--graph_path database.db", "--graph_path pairs.txt"),
    MAPPER: ("--colmap /dev/null", "--colmap photos", "--colmap /bin/false",
             "--Init.min_num_inliers -1", "--Mapper.nonsense 1", "--Mapper."),
    OUTLINE: ("--up x", "--up 0,0,0", "--up nan,0,0", "--scale -1", "--scale 1e300",
              "--area 1,2", "--area 0,0,nan,1", "--min_area 1e300", "--geo_origin ,,",
              "--sparse_path photos"),
    CALIBRATE: ("--board 1x1", "--board 100000x100000", "--board 9", "--board axb",
                "--square 0", "--board_type charuco", "--apply photos",
                "--camera_model FISHEYE"),
    EVALUATE: ("--ply_path truth", "--error_path photos", "--scan_path picks.csv",
               "--ply_path truth/true_colors.ply --error_path e.png", "--truth_path photos"),
    AUTO + " --dry_run": ("--from nowhere", "--only align --from mapper", "--picks_path photos",
                          "--cameras_path picks.csv", "--camera_params 1,2,x",
                          "--colmap nowhere", "--scan_path nowhere.e57",
                          "--video_path photos"),
    PICK: ("--port 99999", "--port -1", "--host 256.1.1.1", "--host 0.0.0.0",
           "--image_name nowhere.jpg", "--output_path photos"),
}
# Odd, and all the same an answer.
FINE = ("max_bend inf", "min_area_m2 1e300", "texel_mm 1e-9", "--scale 1e300",
        "--min_area 1e300", "--colmap nowhere", "--overlays 2000000000")


def options():
    for line, all_of_them in OPTIONS.items():
        for option in all_of_them:
            is_fine = any(fine in option for fine in FINE)
            yield (f"{command_of(line)} {option}", s.write_matches if line == MAPPER else nothing,
                   with_options(line, option), {0, 4} if is_fine else BAD)


def names():
    strange = "a b\n\u00fc'\"#2,x"
    yield ("import: a name with everything in it", moved("scan.rtpi", strange),
           ["roomtex-import", "--quiet", "--input_path", strange, "--output_path",
            strange + ".ply"], {0})
    yield "import: a name of 255 bytes", nothing, IMPORT.replace("room.ply", 251 * "n" + ".ply"), {0}
    yield "import: a name of 256 bytes", nothing, IMPORT.replace("room.ply", 252 * "n" + ".ply"), {3}
    yield ("auto: a scan with # in its name", moved("scan.rtpi", "a#b.rtpi"),
           AUTO.replace("scan.rtpi", "a#b.rtpi") + " --dry_run", {0})
    yield ("align: an output folder with a line end", nothing,
           s.ALIGN.split() + ["--output_path", "new\nfolder"], RAN)
    yield ("texture: an output folder that leads out and in", nothing,
           TEXTURE.replace("textured", "photos/../textured"), RAN)


def places():
    for line, name in ((ALIGN, "aligned"), (TEXTURE, "textured"), (SIMULATE, "new"),
                       (MAPPER, "mapped"), (AUTO, "result")):
        for title, change in (("is a file", write(name, "mine")), ("cannot be written", full(name)),
                              ("is a link to itself", loop(name))):
            yield f"{command_of(line)}: the output folder {title}", change, line, {3}
    for line in (IMPORT, PATTERN, PAIRS, ASSOCIATE):
        output = line.split("--output_path ")[1].split()[0]
        for title, change, changed_line in (
                ("is a folder", folder(output), line),
                ("is a socket", unix_socket(output), line),
                ("has no folder", nothing, line.replace(output, "no/" + output)),
                ("lies in /dev/null", nothing, line.replace(output, "/dev/null/" + output)),
                ("stands, but not the report", nothing, line + " --report_path no/r.json")):
            yield f"{command_of(line)}: the output {title}", change, changed_line, {3}
    yield ("export: a model that is not aligned", nothing,
           EXPORT.replace("aligned", "sparse") + " --scan_path scan.rtpi", {0, 2, 3, 4})
    yield "dense: a model that is not there", nothing, DENSE, BAD
    yield ("evaluate: nothing to compare", nothing, "roomtex-evaluate --quiet --truth_path truth",
           {2})
    yield ("evaluate: photos of other names", text("sparse/images.txt", "photo_", "other_", -1),
           EVALUATE, {3})


def bad_number_cases():
    """Numbers that no option takes, and some that only a few do."""
    for line, names in NUMBERS.items():
        for name in names.split():
            for value in ("nan", "1e999", "-1e300", "", "ten"):
                yield (f"{command_of(line)} --{name} {value!r}", nothing,
                       shlex.split(line) + ["--" + name, value], {2})


def later():
    """What came after the first tables: cases for prepared()."""
    yield "view: a page to give away", nothing, PAGE, {0}
    yield "view: a page of a .ply", nothing, PAGE.replace("coloured ", "coloured/model.ply "), {0}
    yield "view: a page over its model", nothing, PAGE.replace(" page", " coloured"), {2, 3}
    yield "view: a page among the photos", nothing, PAGE.replace(" page", " photos"), {2, 3}
    yield "view: a page over the aligned model", nothing, PAGE.replace(" page", " room"), {2, 3}
    yield "view: a page in the folder that one works in", nothing, PAGE.replace(" page", " ."), BAD
    yield "view: a page into a folder of others", write("page/mine.txt", "mine"), PAGE, {3}
    yield ("view: a page into one of another command", write("page/report.json",
           '{"command": "roomtex-texture"}'), PAGE, {3})
    yield ("view: a page beside a report.json that is nested", write("page/report.json", DEEP),
           PAGE, {3})
    yield ("view: a name with everything in it", nothing,
           shlex.split(PAGE)[:-1] + ["a b\n\u00fc'\"#2,x"], {0})
    yield "view: a scan's name", nothing, PAGE.replace("coloured ", "scan.rtpi "), {3}
    yield "view: without photos", folder("photos"), PAGE, {0, 3}
    yield "view: an evidence.ply of nothing", write("coloured/evidence.ply", ""), PAGE, {0, 3}
    yield "view: an evidence.ply of another room", moved("room", "x"), PAGE, {3}
    yield "view: report.json is a pipe", fifo("coloured/report.json"), PAGE, {0}
    yield "view: an aligned model without photos", folder("room"), PAGE, {3}

    yield "import: photos of an E57", nothing, PHOTOS + " --E57.picks 1", {0}
    yield "import: photos over other photos", nothing, PHOTOS.replace(" taken", " photos"), {3}
    yield "import: photos into a file", write("taken", "mine"), PHOTOS, {3}
    yield "import: photos into a place without rights", full("taken"), PHOTOS, {3}
    yield "import: picks.csv is a folder", folder_below("taken/picks.csv"), PHOTOS + " --E57.picks 1", {3}
    yield "import: sparse is a file", write("taken/sparse", "mine"), PHOTOS, {3}
    yield "import: photos of what has none", nothing, PHOTOS.replace("coloured/model.e57", "scan.rtpi"), {3}
    for version, code in (("1.3", 0), ("1.4", 0), ("1.5", 2), ("", 2), ("1.4e0", 2), ("nan", 2)):
        yield (f"import --Las.version {version!r}", nothing,
               shlex.split(IMPORT.replace("room.ply", "room.las")) + ["--Las.version", version], {code})
    yield "import: picks without photos", nothing, IMPORT + " --E57.picks 1", {2}
    yield ("import: an E57 cut short", lambda root: os.truncate(root / "coloured/model.e57", 5000),
           PHOTOS, {3})
    for kind in ("e57", "pcd", "xyz", "pts", "csv", "las", "ptx", "png", "rtpi"):
        yield f"import: a .{kind}", nothing, IMPORT.replace("room.ply", "new." + kind), {0}
        yield (f"import: a .{kind} twice", nothing,
               f"{IMPORT} --output_path new.{kind} --output_path ./new.{kind}", {2})
    for axis in ("w", "", "xy", "+z", "nan"):
        yield (f"import --up_axis {axis!r}", nothing, shlex.split(IMPORT) + ["--up_axis", axis], {2})
    yield "import: a panorama that is none", nothing, "roomtex-import --input_path photos --output_path faces", {3}
    yield ("import: faces into the folder of the panoramas", nothing,
           "roomtex-import --input_path photos --output_path photos", {2})

    yield "export: a workspace", nothing, SPLAT, RAN
    for option, codes in (("--format nope", {2}), ("--max_points 0", BAD), ("--max_image_size 1", BAD | RAN),
                          ("--max_field_of_view 0", {2}), ("--max_field_of_view 361", {2}),
                          ("--colors_path scan.rtpi", {3}), ("--colors_path photos", {3}),
                          ("--colors_path coloured/evidence.ply", {3}),
                          ("--associations_path picks.csv", {3}), ("--output_path photos", BAD),
                          ("--output_path room", BAD), ("--output_path coloured", BAD),
                          ("--output_path .", BAD)):
        yield f"export {option}", nothing, with_options(SPLAT, option), codes
    for option in ("--output_path photos", "--output_path room", "--output_path .",
                   "--PatchMatch.num_sources 0", "--PatchMatch.num_iterations 0",
                   "--Fusion.min_correlation 2", "--Fusion.spacing 0", "--Fusion.min_support 0",
                   "--max_image_size -1"):
        yield f"dense {option}", nothing, with_options(HOLES, option), BAD
    yield "dense: a workspace", nothing, HOLES, RAN | {3}

    yield "calibrate: boards", nothing, BOARDS, RAN
    for option, codes in (("--square inf", {2}), ("--board 0x0", {2}), ("--board 6x4x2", {2}),
                          ("--board -6x4", {2}), ("--board 6x999999999999", {2}),
                          ("--board_type charuco", BAD), ("--Trust.min_photos -1", {2}),
                          ("--coverage_path coverage.txt", BAD), ("--coverage_path /", BAD),
                          ("--coverage_path camera.txt", {2}), ("--apply picks.csv", {3}),
                          ("--image_path boards/board_0.png", {3})):
        yield f"calibrate {option}", nothing, with_options(BOARDS, option), codes
    yield "calibrate: a photo of nothing", write("boards/z.png", ""), BOARDS, RAN
    yield "calibrate: a photo that is a link to itself", loop("boards/z.png"), BOARDS, RAN
    yield "calibrate: a photo of another size", moved("photos/photo_000.jpg", "boards/z.jpg"), BOARDS, RAN | {3}
    yield "calibrate: a board to print", nothing, BOARD, {0}
    for option in ("--marker 0.03", "--marker nan", "--marker 0", "--dictionary DICT_9X9_1",
                   "--board 500x500", "--square 1e9", "--square 1e-9", "--board_path boards",
                   "--board_path no/board.pdf"):
        yield f"calibrate: a board with {option}", nothing, with_options(BOARD, option), BAD

    yield "texture: stations", nothing, STATIONS, RAN
    yield "texture: station_0 is a file", write("textured/station_0", "mine"), STATIONS, {3}
    yield ("texture: station_1 is a scan", replaced("textured/station_1", lambda path: path.mkdir(parents=True)),
           STATIONS, RAN)
    yield "texture: poses of nan", text("poses.txt", " 1 0", " nan 0"), STATIONS, {3}
    yield "texture: poses of one scan", text("poses.txt", "other", "third"), STATIONS, {3}
    for option in ("--max_samples 0", "--max_samples -1", "--max_samples 1e99"):
        yield f"texture {option}", nothing, with_options(STATIONS, option), BAD
    yield "texture --max_samples 1", nothing, with_options(STATIONS, "--max_samples 1"), BAD | RAN

    yield "render: pictures", nothing, PICTURES, {0}
    yield "render: a picture", nothing, PICTURE, {0}
    for option in ("--width 2000000000", "--width -1", "--num_photos -1", "--num_ring -1",
                   "--num_ring 2000000000", "--folder_path scan.rtpi", "--ply_path scan.rtpi",
                   "--ply_path coloured/evidence.ply", "--ply_path truth", "--image_path picks.csv"):
        yield f"render {option}", nothing, with_options(PICTURES, option), BAD
    for option in ("--image_name no.jpg", "--glb_path scan.rtpi", "--glb_path nowhere",
                   "--output_path photos", "--turn_deg nan", "--back 1e999"):
        yield f"render {option}", nothing, with_options(PICTURE, option), BAD
    for title, content in (("nested", glb('{"asset":' + "[" * 100000 + "]" * 100000 + "}")),
                           ("empty", b""), ("of another version", b"glTF\1\0\0\0")):
        yield f"render: a model.glb {title}", write("coloured/model.glb", content), PICTURE, {3}
    yield ("render: a PLY of one lonely x", write("coloured/model.ply",
           "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uchar red\n"
           "property float x\nend_header\n12345"), PICTURES, {3})
    yield ("render: a PLY with a word for a number", write("coloured/model.ply",
           "ply\nformat binary_little_endian 1.0\nelement vertex many\nproperty float x\n"
           "end_header\n"), PICTURES, {3})

    yield "merge: a part", nothing, MERGE, RAN
    for option in ("--copy_path picks.csv", "--copy_path photos", "--output_path photos",
                   "--output_path part.db", "--output_path database.db"):
        yield f"merge {option}", nothing, with_options(MERGE, option), BAD
    yield "site: a page", nothing, SITE, RAN
    for option in ("--output_path photos", "--output_path no/site.html", "--rooms_path picks.csv",
                   "--rooms_path photos", "--input_path scan.rtpi", "--input_path photos",
                   "--output_path hall/steps.json", "--output_path hall/steps.html"):
        yield f"site {option}", nothing, with_options(SITE, option), BAD
    yield "site: rooms that lead out", write("site.csv", "room\n../x\n"), SITE + " --rooms_path site.csv", {3}
    for content in (DEEP, "", "[]", '{"steps": 7}', '{"steps": {"align": 7}}',
                    '{"steps": {"align": {"state": "done", "seconds": 1e999}}}'):
        yield (f"site: steps.json is {content[:40]}", write("hall/steps.json", content), SITE, RAN | {3})
        yield (f"site: report.json is {content[:40]}", write("hall/report.json", content), SITE, RAN | {3})
    dry = AUTO + " --dry_run"
    yield "auto: the folder that one works in", nothing, with_options(dry, "--output_path ."), {0}
    yield "auto: a photo that is a link to itself", loop("photos/photo_000.jpg"), dry, {0, 3}
    yield ("auto: a folder of photos that holds itself", lambda root: (root / "photos/again").symlink_to("."),
           dry, {0, 3})
    yield "pick: a photo that is a link to itself", loop("photos/photo_000.jpg"), PICK.replace(
        "--input_path sparse ", "").replace("--port 0", "--port -1"), BAD
    for option in ("--video_frames -1", "--panoramas_path photos", "--video_path scan.rtpi",
                   "--quality best", "--output_path photos", "--output_path photos/new", "--until nowhere",
                   "--camera_model FISH", "--camera_params nan", "--scan_poses nowhere",
                   "--up_axis w", "--pairs maybe", "--video_frames 2000000000"):
        yield f"auto {option}", nothing, with_options(dry, option), BAD
    for option in ("--input_path coloured/model.ply --output_path coloured/model.ply",
                   "--model_path outline.json",
                   "--model_path photos", "--outline_path scan.rtpi", "--up_axis w"):
        yield f"outline {option}", nothing, with_options(OUTLINE, option), BAD
    yield ("outline: a model twice", nothing,
           OUTLINE + " --model_path a.obj --model_path ./a.obj", {2})
    for option in ("--graph_path photos", "--image_path scan.rtpi", "--output_path database.db"):
        yield f"pairs {option}", nothing, with_options(PAIRS, option), BAD


NUMBERS = {
    IMPORT: "max_range Mesh.max_edge_ratio Mesh.max_bend Faces.around Faces.field_of_view_deg Faces.size",
    PAGE: "photo_size port",
    SPLAT: "max_points max_image_size max_field_of_view Occlusion.boundary_px Blend.min_agreement",
    HOLES: "max_image_size max_field_of_view PatchMatch.num_sources Fusion.spacing "
           "Fusion.distance_to_scan Fusion.max_depth_difference",
    OUTLINE: "scale min_area max_range port",
    BOARDS: "square marker Model.min_gain Photos.bad_px Trust.min_tilt_deg Trust.max_sigma_px",
    PICTURE: "width",
    PICTURES: "num_photos num_ring",
    AUTO: "video_frames",
    PAIRS: "Pairs.max_ratio Pairs.max_error Pairs.num_rounds Pairs.num_by_place",
}


def cases():
    """Title, what is changed, the command line, exit codes."""
    for group in (wrong_kinds, numbers, beside, outlines, options, names, places):
        yield from group()


def later_cases():
    for group in (later, bad_number_cases):
        yield from group()


# Only the cases whose title holds this.
ONLY = os.environ.get("ROOMTEX_CASES", "")
VERBOSE = os.environ.get("ROOMTEX_SHOW_SENTENCES")


def odd(base):
    yield from run_cases(base, cases())


def odd_later(base):
    yield from run_cases(prepared(base), later_cases())


def run_cases(base, all_cases):
    for title, change, line, codes in all_cases:
        if ONLY not in title:
            continue
        here = base.copy()
        change(here.root)
        before = here.state()
        answer = here.run(shlex.split(line) if isinstance(line, str) else line)
        problem = answer.problem(codes) or here.harm(before)
        if not problem and answer.code == 0 and not answer.out and here.state() == before:
            problem = "ends with 0, and there is nothing"
        yield f"{title} ({answer.code})", problem
        if VERBOSE:
            print("       " + answer.err.strip()[-600:].replace("\n", "\n       "), flush=True)


if __name__ == "__main__":
    s.main({"odd": odd, "odd_later": odd_later})
