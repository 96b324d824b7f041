"""Every option of every command, as --help lists them, at the ends of its range and beyond, from an ini file."""

import os
import re
import resource

import scene as s
from commands import LINES, prepared

ONLY = os.environ.get("ROOMTEX_CASES", "")  # in the title
OPTION = re.compile(r"^  --(\S+) (\S+)", re.MULTILINE)
# No number at all, or none that an option takes.
NO_NUMBER = ("nan", "1e999", "ten", "", "1,5", "0x10", "1e", "--3")
ENDS = {"INT": ("0", "-1", "1", "2147483647", "-2147483648"),
        "NUMBER": ("0", "-1", "1e-300", "1e300", "-1e300", "inf")}
PATHS = {"below a file": "scan.rtpi/x", "of 300 letters": 300 * "n", "a device": "/dev/null",
         "the root": "/", "nothing that can be named": "\x01\t\x7f"}
# What the machine has too few of is refused, and may need some time to be.
SECONDS, LIMITS = 90, [(resource.RLIMIT_AS, 6 << 30)]


def options_of(base, one):
    text = base.run(one.line.split()[0] + " --help").out
    return [(name, kind) for name, kind in OPTION.findall(text) if not name.endswith(".*")]


def with_value(here, one, name, value):
    """The line with the option from an ini file, in a section as COLMAP has them."""
    section, _, key = name.rpartition(".")
    head = f"[{section}]\n" if section else ""
    (here.root / "odd.ini").write_text(f"{head}{key} = {value}\n")
    words = one.line.split()
    while f"--{name}" in words:  # of the command line, which would win
        at = words.index(f"--{name}")
        del words[at:at + 2]
    return here.run(words + ["--project_path", "odd.ini"], limits=LIMITS, seconds=SECONDS)


def no_numbers(base):
    base = prepared(base)
    for one in LINES:
        if ONLY not in one.title:
            continue
        here = base.copy()
        before = here.state()
        for name, kind in options_of(base, one):
            problems = []
            for value in NO_NUMBER + ("maybe",):
                if kind not in ("INT", "NUMBER", "1|0"):
                    continue
                problem = with_value(here, one, name, value).problem({2})
                if problem:
                    problems.append(f"{value!r}: {problem}")
            (here.root / "odd.ini").unlink(missing_ok=True)
            if not problems and here.state() != before:
                problems.append("something changed")
                here = base.copy()
            yield f"{one.title} --{name}", "; ".join(problems)


def ends(base):
    base = prepared(base)
    for one in LINES:
        if ONLY not in one.title:
            continue
        for name, kind in options_of(base, one):
            values = ENDS.get(kind, ())
            if kind == "PATH" and name != "project_path":
                values = PATHS.values()
            codes, problems = [], []
            for value in values:
                here = base.copy()
                before = here.state()
                answer = with_value(here, one, name, value)
                codes.append(answer.code)
                problem = answer.problem({0, 2, 3, 4}) or here.harm(before)
                if problem:
                    problems.append(f"{value[:20]!r}: {problem}")
            if values:
                yield f"{one.title} --{name} {codes}", "; ".join(problems)


if __name__ == "__main__":
    s.main({"no_numbers": no_numbers, "ends": ends})
