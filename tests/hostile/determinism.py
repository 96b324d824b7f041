"""Every command writes the same bytes with one thread and with four, and when it runs again."""

import json

import scene as s

TIMES = ("seconds", "cpu_seconds", "peak_memory_bytes", "options", "version")


def commands():
    yield "import", "roomtex-import --quiet --input_path scan.rtpi --output_path out/room.ply"
    yield "import to E57", ("roomtex-import --quiet --input_path scan.rtpi --output_path "
                            "out/room.e57")
    yield "align", s.ALIGN + " --image_path photos --overlays 2 --output_path out"
    yield "texture", s.TEXTURE + " --output_path out --output_obj 1"
    yield "associate", ("roomtex-associate --quiet --database_path database.db --image_path photos "
                        "--output_path out/pairs.csv")
    yield "pattern", "roomtex-pattern --quiet --output_path out/pattern.png"
    yield "simulate", ("roomtex-simulate --quiet --output_path out --num_photos 2 --photo_width 64 "
                       "--photo_height 64 --scan_columns 40 --scan_rows 20")
    yield "evaluate", ("roomtex-evaluate --quiet --truth_path truth --input_path sparse "
                       "--report_path out/report.json")


def without_times(value):
    if isinstance(value, dict):
        return {key: without_times(one) for key, one in value.items() if key not in TIMES}
    return [without_times(one) for one in value] if isinstance(value, list) else value


def outputs(here):
    files = {}
    for name, content in here.state().items():
        if not name.startswith("out/"):
            continue
        if name.endswith(".json"):
            text = (here.root / name).read_text().replace(str(here.root), "")
            content = json.dumps(without_times(json.loads(text)))
        files[name] = content
    return files


def run(base):
    for title, line in commands():
        results, problem = [], ""
        for number in (1, 4, 4):
            here = base.copy()
            (here.root / "out").mkdir()
            problem = problem or here.run(f"{line} --num_threads {number}").problem({0, 4})
            results.append(outputs(here))
        for name in results[0]:
            if not all(result.get(name) == results[0][name] for result in results):
                problem = problem or f"{name} differs"
        yield f"{title}, {len(results[0])} files", problem


if __name__ == "__main__":
    s.main({"determinism": run})
