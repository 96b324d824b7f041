"""Every command writes the same bytes with one thread and with four, and when it runs again."""

import scene as s
from commands import ALONE, LINES, Line, outputs, prepared, without_line

MORE = [
    ALONE,
    Line("import to E57", "roomtex-import --quiet --input_path scan.rtpi --output_path room.e57"),
    Line("align with photos", s.ALIGN + " --image_path photos --overlays 2 --output_path aligned"),
    Line("texture with OBJ", s.TEXTURE + " --output_path textured --output_obj 1"),
]


def run(base):
    missing = without_line(base.programs)
    yield "every command has a line in commands.py", f"not {missing}" if missing else ""
    base = prepared(base)
    before = base.state()
    for one in LINES + MORE:
        results, problem = [], ""
        for number in (1, 4, 4):
            here = base.copy()
            problem = problem or here.run(f"{one.line} --num_threads {number}").problem({0, 4})
            results.append(outputs(here, before, one.unsteady))
        names = set().union(*results)
        for name in sorted(names):
            if len({result.get(name) for result in results}) > 1:
                problem = problem or f"{name} differs"
        yield f"{one.title}, {len(names)} files", problem


if __name__ == "__main__":
    s.main({"determinism": run})
