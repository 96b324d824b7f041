"""A command that ends at any rename, by a signal or at a full disk leaves old files or new ones."""

import itertools
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import time

import scene as s
from commands import ALONE, LINES, ROOM, Line, is_unsteady, prepared

LIBRARY = os.path.abspath(os.environ["ROOMTEX_DIE_AT_RENAME"]) if "ROOMTEX_DIE_AT_RENAME" in os.environ else ""
ONLY = os.environ.get("ROOMTEX_CASES", "")  # in the title


def commands():
    """All of them, and further ones whose files lie in several folders."""
    yield from LINES
    yield ALONE
    yield Line("align in the folder that one works in", s.ALIGN + " --output_path .", None,
               ("alignment.json",))
    # These replace all that they left, one file after the other: nothing can change places here.
    room = ROOM.replace("room ", "../room ").replace("photos ", "../photos ")
    for title, line in (("export", "roomtex-export " + room),
                        ("dense", "roomtex-dense " + room + "--max_image_size 64 "),
                        ("view", "roomtex-view --quiet --input_path ../coloured --aligned ../sparse "
                         "--image_path ../photos ")):
        yield Line(title + " in the folder that one works in", line + "--output_path .", None,
                   ("here/report.json",), where="here")
    yield Line("align into three folders", (
        s.ALIGN + " --output_path aligned --Plane.output_path planes/planes.ply --report_path "
        "reports/r.json"), "aligned", ("aligned/alignment.json", "reports/r.json"))
    yield Line("texture by stations", (
        "roomtex-texture --quiet --input_path sparse --image_path photos --scan_path scan.rtpi "
        "--scan_path other.rtpi --scan_poses poses.txt --Texture.scale 1 --output_web 0 "
        "--output_path textured --max_samples 9000"), None,  # a set for each station
        ("textured/report.json",), together=False)
    yield Line("import photos of an E57", "roomtex-import --quiet --input_path coloured/model.e57 "
               "--images_path taken --E57.picks 1", "taken")
    yield Line("import into three folders", (
        "roomtex-import --quiet --input_path scan.rtpi --output_path meshes/room.ply "
        "--output_path clouds/room.pcd --report_path reports/r.json"), None, ("reports/r.json",))


def trusted_commands(base):
    """Scenes and lines of an align that is trusted, and of answers that are not beside a trusted one."""
    # Photos and samples enough that the surface decides.
    here = s.Scene(base.programs).make(num_photos=20, scan_columns=320)
    records = ("aligned/alignment.json", "aligned.untrusted/alignment.json")
    line = s.ALIGN + " --image_path photos --output_path aligned"
    yield here, Line("align that is trusted", line, "aligned", records, old=" --PlaneBA.beta 300"), {0}
    there = here.copy()
    answer = there.run(line)
    assert answer.code == 0, answer.err
    yield there, Line("align that is not trusted beside a trusted one",
                      line + " --Trust.min_scale_features 100000", "aligned.untrusted", records,
                      old=" --plane_constrained 0"), {4}
    # Refused: nothing but a report, and all that differs between two of them is times.
    picks = [row.split(",") for row in (there.root / "picks.csv").read_text().splitlines()]
    turned = [",".join(one[:3] + other[3:]) for one, other in zip(picks[1:], picks[3:] + picks[1:3])]
    (there.root / "picks.csv").write_text("\n".join([",".join(picks[0])] + turned) + "\n")
    yield there, Line("align that is refused beside a trusted one", line, "aligned.untrusted",
                      records), {4}


def at_random(base, num_kills=30):
    """roomtex-auto with the real COLMAP, killed again and again: it always goes on, and ends whole."""
    here = s.Scene(base.programs)
    # With fewer or smaller photos COLMAP does not register that of the picks every time.
    made = here.run("roomtex-simulate --quiet --output_path capture --num_photos 12 --photo_width 560 "
                    "--photo_height 374 --scan_columns 300 --scan_rows 150")
    assert made.code == 0, made.err
    inputs = here.state()
    programs = str(here.programs)
    line = [programs + "/roomtex-auto", "--quiet", "--image_path", "capture/photos", "--scan_path",
            "capture/scan.rtpi", "--picks_path", "capture/picks.csv", "--quality", "low",
            "--output_path", "result", "--accept_untrusted", "1"]
    generator = random.Random(19)
    kills, ends, problems = {}, [], []

    def check(code, err):
        state = here.state()
        if code not in (0, 4):
            problems.append(f"exit {code}: {err[-300:]}")
        for name in ("report.html", "report.json", "textured/model.ply", "aligned/images.bin",
                     "sparse/0/images.bin"):
            if "result/" + name not in state:
                problems.append(f"ends without {name}")
        if here.leftovers():
            problems.append(f"leaves {here.leftovers()}")
        if any(state.get(name) != content for name, content in inputs.items()):
            problems.append("inputs changed")
        ends.append(code)

    while sum(kills.values()) < num_kills and not problems:
        process = subprocess.Popen(line, cwd=here.root, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, start_new_session=True)
        try:
            _, err = process.communicate(timeout=generator.uniform(0.2, 20))
            check(process.returncode, err.decode())
            shutil.rmtree(here.root / "result")
            continue
        except subprocess.TimeoutExpired:
            pass
        try:
            steps = json.loads((here.root / "result/steps.json").read_text())["steps"]
            step = next((name for name in steps if steps[name]["state"] == "started"), "between")
        except FileNotFoundError:
            step = "first"
        kills[step] = kills.get(step, 0) + 1
        # Every other time only the command itself: what it had started has to end by itself.
        alone = sum(kills.values()) % 2 == 0
        process.kill() if alone else os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        time.sleep(2)
        try:
            os.killpg(process.pid, signal.SIGKILL)
            problems.append(f"killed in {step}, it leaves a process")
        except ProcessLookupError:
            pass
        process.stderr.close()
    if not problems:
        answer = here.run(" ".join(["roomtex-auto"] + line[1:]), seconds=600)
        check(answer.code, answer.err)
    yield (f"auto, {sum(kills.values())} kills at random moments {kills}, {len(ends)} ends {ends}",
           "; ".join(problems))


def below(state, folder):
    return {name: content for name, content in state.items() if name.startswith(folder + "/")}


def without(files, unsteady):
    return {name: content for name, content in files.items() if not is_unsteady(name, unsteady)}


def not_one_answer(killed, one, before, after):
    """Whether files of the answer are old and others new, once another command has written beside them."""
    folders = {os.path.dirname(name) for name in after if before.get(name) != after[name]}
    folders |= {os.path.dirname(name[:name.index(".roomtex-partial-")] + "x") for name in killed.state()
                if ".roomtex-partial-" in name}
    for folder in sorted(folders):
        if not (killed.root / folder).is_dir():
            continue
        answer = killed.run("roomtex-import --quiet --input_path scan.rtpi --output_path " +
                            os.path.join(folder, "settle.ply"))
        if answer.code != 0:
            return f"nothing can be written into {folder}: {answer.err[-200:]}"
        (killed.root / folder / "settle.ply").unlink()
    now = killed.state()
    is_new = {name: now.get(name) != before.get(name) for name in set(before) | set(after)
              if before.get(name) != after.get(name) and not name.endswith(".log")}  # logs grow as it runs
    if any(is_new.values()) and not all(is_new.values()):
        return f"new: {[name for name in is_new if is_new[name]]}, old: {[name for name in is_new if not is_new[name]]}"
    return ""


def at_every_rename(base):
    """First over nothing, then over the results of another run."""
    assert LIBRARY, "ROOMTEX_DIE_AT_RENAME names no library: nothing would be killed"
    whole = prepared(base)
    cases = itertools.chain(((whole, one, {0, 4}) for one in commands()), trusted_commands(base))
    for scene, one, codes in cases:
        title, line, folder = one.title, one.line, one.folder
        if ONLY not in title:
            continue
        steady = lambda files: without(files, one.unsteady)
        names = set()
        for old in (False, True) if one.again else (False,):
            here = scene.copy()
            inputs = here.state()
            if old:
                here.run(line + one.old, where=one.where)
                if folder:
                    (here.root / folder / "mine.txt").write_text("mine")
            before = here.state()
            expected = here.copy()
            answer = expected.run(line, where=one.where)
            problem = answer.problem(codes)
            after = expected.state()
            if names - set(after):
                problem = f"over old results these are missing: {sorted(names - set(after))}"
            names |= set(after)
            if old and one.old != Line.old and steady(before) == steady(after):
                problem = "the old results are the new ones"
            number = 0
            while not problem and number < 60:
                number += 1
                killed = here.copy()
                how = "DIE_AT" if number % 2 else "DIE_AFTER"
                answer = killed.run(line, where=one.where, environment={"LD_PRELOAD": LIBRARY,
                                                       "DIE_PROGRAM": line.split()[0],
                                                       how: str((number + 1) // 2)})
                if answer.code in (0, 4):
                    break
                now = {name: content for name, content in killed.state().items()
                       if ".roomtex-partial-" not in name}
                if answer.code != -signal.SIGKILL:
                    problem = f"{how} {number}: exit {answer.code}: {answer.err[-200:]}"
                elif any(now.get(name) != content for name, content in inputs.items()):
                    problem = f"{how} {number}: inputs changed"
                elif folder and steady(below(now, folder)) not in (
                        steady(below(before, folder)), steady(below(after, folder))):
                    problem = f"{how} {number}: neither old nor new"
                elif any(content not in (before.get(name), after.get(name))
                         for name, content in steady(now).items()):
                    problem = f"{how} {number}: a file is neither old nor new"
                elif one.together and (problem := not_one_answer(killed, one, before, after)):
                    problem = f"{how} {number}: {problem}"
                else:
                    killed.run(line, where=one.where)
                    if killed.leftovers():
                        problem = f"{how} {number}: the next run leaves {killed.leftovers()}"
                    elif steady(killed.state()) != steady(after):
                        problem = f"{how} {number}: the next run does not mend it"
            yield f"{title}, {'over old results' if old else 'over nothing'}, {number} kills", problem


def by_signals(base):
    slow = "roomtex-simulate --quiet --output_path new --num_photos 40"
    cases = [("simulate", slow), ("texture", s.TEXTURE.replace("--Texture.scale 1", "--Texture.scale 8") +
                               " --output_path textured")]
    for title, line in cases:
        for what in (signal.SIGINT, signal.SIGTERM):
            here = base.copy()
            before = here.state()
            arguments = line.split()
            arguments[0] = str(here.programs / arguments[0])
            process = subprocess.Popen(arguments, cwd=here.root, stderr=subprocess.PIPE,
                                       stdout=subprocess.DEVNULL, start_new_session=True,
                                       # A job in the background ignores it.
                                       preexec_fn=lambda: signal.signal(signal.SIGINT,
                                                                        signal.SIG_DFL))
            while process.poll() is None and not here.leftovers():
                time.sleep(0.02)
            process.send_signal(what)
            try:
                err = process.communicate(timeout=20)[1].decode()
            except subprocess.TimeoutExpired:
                process.kill()
                yield f"{title} gets {what.name}", "does not end"
                continue
            after = here.state()
            problem = ""
            if process.returncode not in (-what, 0):
                problem = f"exit {process.returncode}: {err[-200:]}"
            elif process.returncode == -what and "stopped by " + what.name not in err:
                problem = f"does not say so: {err[-200:]}"
            elif here.leftovers():
                problem = f"leaves {here.leftovers()}"
            elif any(after.get(name) != content for name, content in before.items()):
                problem = "inputs changed"
            yield f"{title} gets {what.name}", problem


def full_disk(base):
    """A limit of the size of files stands for the full disk: writing fails in the same places."""
    base = prepared(base)
    for one in commands():
        title, line = one.title, one.line
        if ONLY not in title:
            continue
        for limit in (0, 2000, 20000):
            here = base.copy()
            before = here.state()
            answer = here.run(line, limits=[(resource.RLIMIT_FSIZE, limit)], where=one.where)
            after = here.state()
            problem = answer.problem({0, 3, 4})
            if answer.code in (0, 4) and limit < 2000:
                problem = "ends well with nothing written"
            if here.leftovers():
                problem = f"leaves {here.leftovers()}"
            if any(after.get(name) != content for name, content in before.items()):
                problem = "inputs changed"
            yield f"{title} with files of at most {limit} bytes", problem


if __name__ == "__main__":
    s.main({"renames": at_every_rename, "random": at_random, "signals": by_signals, "full_disk": full_disk})
