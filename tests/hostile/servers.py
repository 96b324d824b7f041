"""The local servers: slow strangers keep nobody out, links outlive the server, strangers get nothing."""

import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import time
import urllib.error
import urllib.request

import scene as s
from names import NAMES, with_name


THREADS = os.path.abspath(os.environ["ROOMTEX_FEW_THREADS"]) if "ROOMTEX_FEW_THREADS" in os.environ else ""
PICK = ("roomtex-pick --quiet --input_path sparse --image_path photos --scan_path scan.rtpi "
        "--output_path picks.csv --port ")


class Server:
    def __init__(self, here, line, programs=None, environment=None):
        arguments = line.split()
        arguments[0] = str((programs or here.programs) / arguments[0])
        self.process = subprocess.Popen(
            arguments, cwd=here.root, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True,
            env={**os.environ, "XDG_STATE_HOME": str(here.root / "state"), **(environment or {})})
        self.url = self.process.stdout.readline().strip()
        self.port = int(re.search(r":(\d+)/", self.url).group(1)) if self.url else 0

    def get(self, seconds=10):
        with urllib.request.urlopen(self.url, timeout=seconds) as answer:
            return answer.status

    def ask(self, method, path, body=None, seconds=20):
        request = urllib.request.Request(self.url + path, method=method, headers={
            "Origin": f"http://127.0.0.1:{self.port}", "Content-Type": "application/json"},
            data=None if body is None else json.dumps(body).encode())
        with urllib.request.urlopen(request, timeout=seconds) as answer:
            return json.loads(answer.read())

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        try:
            return self.process.wait(timeout=15)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return "does not end"


def crowd(server, number):
    """Connections that begin a request and do not go on; and why there are fewer, or ""."""
    strangers = []
    for _ in range(number):
        try:
            one = socket.create_connection(("127.0.0.1", server.port), timeout=5)
            one.sendall(b"GET /")
            strangers.append(one)
        except OSError as error:
            return strangers, f"connecting: {error}"
    return strangers, ""


def picks_of(root):
    """Those of picks.csv as the page sends them."""
    rows = [row.split(",") for row in (root / "picks.csv").read_text().splitlines()]
    head = rows[0]
    return [{"image_name": row[head.index("image_name")],
             "img": [float(row[head.index(c)]) for c in ("x", "y")],
             "point": [float(row[head.index(c)]) for c in ("scan_x", "scan_y", "scan_z")]} for row in rows[1:]]


def names(base):
    """What roomtex-pick saves of a photo, whatever its name, it reads again."""
    for title, name in NAMES.items():
        here = with_name(base, name)
        (here.root / "picks.csv").unlink()
        picks = [{**one, "image_name": name} for one in picks_of(base.root)
                 if one["image_name"] == "photo_000.jpg"][:3]
        try:
            server = Server(here, PICK + "0")
            saved = server.ask("PUT", "picks", {"revision": 1, "picks": picks})
            problem = "" if saved.get("saved") else f"is not saved: {str(saved)[:200]}"
            server.stop()
            server = Server(here, PICK + "0")
            again = server.ask("GET", "state")["session"]["picks"]
            if [one["image_name"] for one in again] != [name] * len(picks) or not picks:
                problem = problem or f"came back as {[one['image_name'] for one in again]}"
            server.stop()
        except (OSError, urllib.error.URLError, ValueError) as error:
            problem = str(error)
        yield f"{title}: roomtex-pick saves and reads it", problem


def killed(base):
    """kill -9 of roomtex-pick ends the roomtex-align that it has started."""
    here = base.copy()
    programs = here.root / "programs"
    programs.mkdir()
    shutil.copy(here.programs / "roomtex-pick", programs)
    align = programs / "roomtex-align"
    align.write_text("#!/bin/sh\necho $$ >pid\nexec sleep 100\n")
    align.chmod(0o755)
    server = Server(here, PICK + "0", programs)
    server.ask("PUT", "picks", {"revision": 1, "picks": picks_of(here.root)})
    server.ask("POST", "align", {})
    pid = here.root / "pid"
    for _ in range(200):
        if pid.exists() and pid.read_text().strip():
            break
        time.sleep(0.05)
    else:
        server.process.kill()
        yield "roomtex-pick is killed: its roomtex-align ends", "it was not started"
        return
    process = pathlib.Path("/proc") / pid.read_text().strip()
    is_there = process.exists()
    server.process.kill()
    server.process.wait()
    for _ in range(60):
        if not process.exists() or "\nState:\tZ" in (process / "status").read_text():
            break
        time.sleep(0.05)
    else:
        is_there = False
        os.kill(int(process.name), signal.SIGKILL)
    yield "roomtex-pick is killed: its roomtex-align ends", "" if is_there else "it lives on"


def few_threads(base):
    """Where the system gives few threads, as many strangers go as there are threads for."""
    for number in (8, 24, 60):
        server = Server(base.copy(), PICK + "0", environment={"LD_PRELOAD": THREADS,
                                                              "THREADS_AT_MOST": str(number)})
        if not server.port:
            ended = server.process.wait(timeout=15)
            yield f"roomtex-pick with {number} threads", "" if ended == 3 else f"exit {ended}"
            continue
        strangers, problem = crowd(server, 100)
        started = time.time()
        try:
            server.get()
        except (OSError, urllib.error.URLError) as error:
            problem = problem or f"a person is kept out: {error}"
        if time.time() - started > 3:
            problem = problem or f"a person waits {time.time() - started:.0f} s"
        for one in strangers:
            one.close()
        ended = server.stop()
        yield (f"roomtex-pick with {number} threads: 100 slow strangers",
               problem or ("" if ended in (0, 4, -15) else f"exit {ended}"))


def remote(base):
    """Whoever lets other computers in is told that nothing is encrypted."""
    here = base.copy()
    for line in ("roomtex-view --input_path cloud.ply", PICK.replace(" --quiet", "").replace(" --port ", ""),
                 "roomtex-outline --input_path sparse --output_path outline.json --window 1"):
        if "cloud.ply" in line:
            here.run("roomtex-import --quiet --input_path scan.rtpi --output_path cloud.ply")
        server = Server(here, line + " --host 0.0.0.0 --allow_remote 1 --port 0")
        server.stop()
        err = server.process.stderr.read()
        yield (f"{line.split()[0]} with --allow_remote", "" if "nothing is encrypted" in err else
               f"says nothing: {err[-200:]}")


def run(base):
    here = base.copy()
    textured = here.run(s.TEXTURE + " --output_path textured")
    if textured.problem({0, 4}):
        yield "texture", textured.problem({0, 4})
        return
    view = "roomtex-view --quiet --input_path textured --aligned sparse --image_path photos --port "
    yield from killed(base)
    yield from names(base)
    yield from remote(base)
    if THREADS:
        yield from few_threads(base)
    for title, line in (("roomtex-view", view), ("roomtex-pick", PICK)):
        server = Server(here, line + "0")
        strangers, problem = crowd(server, 200)
        for _ in range(3):
            for one in strangers:
                try:
                    one.sendall(b"x")
                except OSError:
                    pass
            started = time.time()
            try:
                server.get()
            except (OSError, urllib.error.URLError) as error:
                problem = problem or f"a person is kept out: {error}"
            if time.time() - started > 3:
                problem = problem or f"a person waits {time.time() - started:.0f} s"
        for one in strangers:
            one.close()
        yield f"{title}: 200 slow strangers", problem
        ended = server.stop()
        yield f"{title}: ends on SIGTERM", "" if ended in (0, 4, -15) else f"exit {ended}"
    first = Server(here, view + "0")
    first.stop()
    second = Server(here, view + str(first.port))
    same = second.url == first.url
    try:
        problem = "" if same and second.get() == 200 else f"{first.url} became {second.url}"
    except (OSError, urllib.error.URLError) as error:
        problem = str(error)
    second.stop()
    yield "roomtex-view: links outlive it", problem
    keys = list((here.root / "state/roomtex/keys").glob("*"))
    open_keys = [key.name for key in keys if key.stat().st_mode & 0o077]
    yield "roomtex-view: its key is its owner's alone", "" if keys and not open_keys else str(keys)


if __name__ == "__main__":
    s.main({"servers": run})
