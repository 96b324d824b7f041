"""What the tables of this folder share: a folder of work in which programs run and what was measured is kept, so that
a table that was ended, or wants more sizes, goes on where it was."""

import json
import os
import subprocess
import sys

os.environ["QT_QPA_PLATFORM"] = "offscreen"  # COLMAP asks for a display otherwise


class Measurements:
    def __init__(self, folder, programs, name):
        """folder: of the work; programs: where roomtex-* are; name: of the JSON file with what was measured."""
        self.folder = os.path.abspath(folder)
        self.programs = os.path.abspath(programs)
        os.makedirs(self.folder, exist_ok=True)
        self.path = self.at(name)
        self.known = json.load(open(self.path)) if os.path.exists(self.path) else {}

    def at(self, *names):
        return os.path.join(self.folder, *names)

    def call(self, line, fine=(0,)):
        """Runs a program; CPU seconds and peak memory (MB) of it and of what it starts. Ends if it fails."""
        program = line[0] if line[0] == "colmap" else os.path.join(self.programs, line[0])
        with open(self.at("log.txt"), "a") as log:
            log.write(" ".join(line) + "\n")
            log.flush()
            process = subprocess.Popen([program] + line[1:], stdout=log, stderr=log)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode not in fine:
            sys.exit(f"{' '.join(line)}: exit code {process.returncode}, see {self.at('log.txt')}")
        return {"cpu": usage.ru_utime + usage.ru_stime, "peak": usage.ru_maxrss / 1024}

    def once(self, key, measure):
        """What `measure` returned, now or in an earlier run."""
        if key not in self.known:
            print(key, file=sys.stderr, flush=True)
            self.known[key] = measure()
            with open(self.path + ".new", "w") as stream:
                json.dump(self.known, stream, indent=1)
            os.replace(self.path + ".new", self.path)
        return self.known[key]
