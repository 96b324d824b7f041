"""Odd surroundings of every command: its folder, its environment, its standard files, who else is there."""

import os
import subprocess
import threading
import time

import scene as s
from commands import LINES, outputs, prepared

ONLY = os.environ.get("ROOMTEX_CASES", "")  # in the title
NOBODY = 65534


def expected_outputs(base, one):
    here = base.copy()
    before = here.state()
    answer = here.run(one.line)
    return answer, outputs(here, before, one.unsteady)


def only(lines):
    return [one for one in lines if ONLY in one.title]


def in_a_shell(here, one, around, seconds=s.SECONDS):
    """around: a shell's line with {} for the command, {told} for the command that tells its stages."""
    line = str(here.programs / one.line.split()[0]) + one.line[len(one.line.split()[0]):]
    around = around.replace("{told}", line.replace(" --quiet ", " ")).replace("{}", line)
    return here.run_program(["bash", "-c", around], seconds=seconds)


ENVIRONMENTS = {
    "HOME unset": "env -u HOME {}",
    "HOME that is not there": "HOME=/no/where {}",
    "TMPDIR that is not there": "TMPDIR=/no/where {}",
    "TMPDIR empty": "TMPDIR= {}",
    "a locale with decimal commas": "LOCPATH=$PWD/.locales LC_ALL=de_DE.UTF-8 {}",
    "a locale that is not there": "LC_ALL=xx_YY {}",
    "standard output closed": "{} >&-",
    "all standard files closed": "{} <&- >&- 2>&-",
    "standard error closed, and telling": "{told} 2>&-",
    "nobody reading standard error": "{ {told} 2>&1 >&3 | true; exit ${PIPESTATUS[0]}; } 3>&1",
    "a umask that takes all": "umask 0777; {}",
    "60 open files": "ulimit -n 60; {}",
    "a stack of 1 MB": "ulimit -s 1024; {}",
}
# May be refused in a sentence, or end as programs do whose reader is gone.
OTHER_CODES = {"TMPDIR that is not there": 3, "TMPDIR empty": 3, "60 open files": 3, "a umask that takes all": 3, "nobody reading standard error": 128 + 13}


def environments(base):
    base = prepared(base)
    (base.root / ".locales").mkdir()
    subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", base.root / ".locales/de_DE.UTF-8"],
                   stderr=subprocess.DEVNULL, check=False)  # else it is one that is not there
    for one in only(LINES):
        expected, files = expected_outputs(base, one)
        for title, around in ENVIRONMENTS.items():
            here = base.copy()
            before = here.state()
            answer = in_a_shell(here, one, around)
            codes = {expected.code, OTHER_CODES.get(title, expected.code)}
            silent = "2>" in around
            problem = "" if silent and answer.code in codes else answer.problem(codes)
            if not problem and answer.code == expected.code:
                subprocess.run(["chmod", "-R", "u+rwX", here.root], check=True)
                now = outputs(here, before, one.unsteady)
                differing = sorted(name for name in files if now.get(name) != files[name])
                problem = f"other files: {differing[:3]}" if differing else ""
            if not problem and here.leftovers():
                problem = f"leaves {here.leftovers()}"
            yield f"{one.title}, {title} ({answer.code})", problem


def full_output(base):
    """An answer that cannot be told is not told to be there."""
    base = prepared(base)
    for one in only(LINES):
        here = base.copy()
        plain = here.copy().run(one.line)
        answer = in_a_shell(here, one, "{} >/dev/full")
        yield (f"{one.title}, standard output is a full disk ({answer.code})",
               answer.problem({3} if plain.out else {plain.code}))


def folder_gone(base):
    """The folder that one works in is deleted; inputs and outputs are named in full."""
    base = prepared(base)
    for one in only(LINES):
        here = base.copy()
        gone = here.root / "gone"
        gone.mkdir()
        answer = in_a_shell(here, one, "cd gone && rmdir ../gone && {}")
        problem = answer.problem({2, 3})
        if not problem and here.leftovers():
            problem = f"leaves {here.leftovers()}"
        yield f"{one.title}, the folder is gone ({answer.code})", problem


def read_only(base):
    """Somebody who may read all and write nothing."""
    base = prepared(base)
    os.chmod(base.root, 0o755)
    for one in only(LINES):
        here = base.copy()
        for folder, _, files in os.walk(here.root):
            os.chmod(folder, 0o555)
            for name in files:
                os.chmod(os.path.join(folder, name), 0o444, follow_symlinks=True)
        before = here.state()
        user = (lambda: (os.setgid(NOBODY), os.setuid(NOBODY))) if os.getuid() == 0 else None
        answer = here.run(one.line, prepare=user)
        problem = answer.problem({3})
        if not problem and here.state() != before:
            problem = "something changed"
        yield f"{one.title}, nothing may be written ({answer.code})", problem
        subprocess.run(["chmod", "-R", "u+rwX", here.root], check=True)


def through_links(base):
    """Every input is a link into a store, and the folder that one works in is reached by a link."""
    base = prepared(base)
    for one in only(LINES):
        expected, files = expected_outputs(base, one)
        here = base.copy()
        store = here.root / ".store"
        store.mkdir()
        for path in sorted(here.root.rglob("*")):
            if path.is_file() and not path.is_symlink() and store not in path.parents:
                kept = store / str(path.relative_to(here.root)).replace("/", "__")
                path.rename(kept)
                path.symlink_to(os.path.relpath(kept, path.parent))
        before = here.state()
        (here.root / "linked").symlink_to(".")
        answer = in_a_shell(here, one, "cd linked && {}")
        problem = answer.problem({expected.code})
        now = here.state()
        if not problem and any(now.get(name) != before[name] for name in before
                               if name.startswith(".store/")):
            problem = "wrote through a link"
        shown = {name: content for name, content in outputs(here, before, one.unsteady).items()
                 if name != "linked"}
        if not problem and set(shown) != set(files):
            problem = f"other files: {sorted(set(shown) ^ set(files))[:3]}"
        yield f"{one.title}, inputs are links ({answer.code})", problem


def two_at_once(base):
    """Two of the same into one place: one answer is there, whole."""
    base = prepared(base)
    for one in only(LINES):
        expected, files = expected_outputs(base, one)
        for shift in (0, 0.1):
            here = base.copy()
            before = here.state()
            arguments = one.line.split()
            arguments[0] = str(here.programs / arguments[0])
            both = []
            for _ in range(2):
                both.append(subprocess.Popen(arguments, cwd=here.root, stdout=subprocess.DEVNULL,
                                             stderr=subprocess.PIPE, stdin=subprocess.DEVNULL))
                time.sleep(shift)
            answers = []
            for process in both:
                err = process.communicate(timeout=s.SECONDS)[1].decode(errors="replace")
                answers.append(s.Answer(process.returncode, "", err))
            problem = next((p for p in (a.problem({expected.code, 3}) for a in answers) if p), "")
            codes = [a.code for a in answers]
            if not problem and expected.code not in codes:
                problem = f"neither ends: {answers[0].err[-150:]} {answers[1].err[-150:]}"
            now = outputs(here, before, one.unsteady)
            differing = sorted(name for name in set(files) | set(now)
                               if now.get(name) != files.get(name))
            if not problem and differing:
                problem = f"other files: {differing[:4]}"
            if here.leftovers():
                problem = problem or f"leaves {here.leftovers()}"
            yield f"{one.title}, two at once {codes}", problem


def changing(base):
    """Inputs are cut short and made whole again, over and over, while they are read."""
    base = prepared(base)
    inputs = ("scan.rtpi", "database.db", "photos/photo_001.jpg", "sparse/images.txt",
              "room/points3D.bin", "coloured/model.ply", "boards/board_1.png", "part.db",
              "picks.csv", "house.json", "room/alignment.json")
    for one in only(LINES):
        here = base.copy()
        whole = {name: (here.root / name).read_bytes() for name in inputs}
        ended = threading.Event()

        def change():
            while not ended.is_set():
                for name, content in whole.items():
                    os.truncate(here.root / name, len(content) // 2)
                time.sleep(0.003)
                for name, content in whole.items():
                    with open(here.root / name, "r+b") as file:
                        file.write(content)
                time.sleep(0.003)

        problem, codes = "", []
        worker = threading.Thread(target=change)
        worker.start()
        for _ in range(5):
            answer = here.run(one.line)
            codes.append(answer.code)
            problem = problem or answer.problem({0, 2, 3, 4})
        ended.set()
        worker.join()
        if not problem and here.leftovers():
            problem = f"leaves {here.leftovers()}"
        yield f"{one.title}, inputs change while it reads {codes}", problem


if __name__ == "__main__":
    s.main({"environments": environments, "full_output": full_output, "folder_gone": folder_gone,
            "read_only": read_only, "through_links": through_links, "two_at_once": two_at_once,
            "changing": changing})
