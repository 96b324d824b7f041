"""The local servers: slow strangers keep nobody out, links outlive the server, strangers get nothing."""

import os
import re
import signal
import socket
import subprocess
import time
import urllib.error
import urllib.request

import scene as s


class Server:
    def __init__(self, here, line):
        arguments = line.split()
        arguments[0] = str(here.programs / arguments[0])
        self.process = subprocess.Popen(
            arguments, cwd=here.root, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True,
            env={**os.environ, "XDG_STATE_HOME": str(here.root / "state")})
        self.url = self.process.stdout.readline().strip()
        self.port = int(re.search(r":(\d+)/", self.url).group(1)) if self.url else 0

    def get(self, seconds=10):
        with urllib.request.urlopen(self.url, timeout=seconds) as answer:
            return answer.status

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        try:
            return self.process.wait(timeout=15)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return "does not end"


def run(base):
    here = base.copy()
    textured = here.run(s.TEXTURE + " --output_path textured")
    if textured.problem({0, 4}):
        yield "texture", textured.problem({0, 4})
        return
    view = "roomtex-view --quiet --input_path textured --aligned sparse --image_path photos --port "
    pick = ("roomtex-pick --quiet --input_path sparse --image_path photos --scan_path scan.rtpi "
            "--output_path picks.csv --port ")
    for title, line in (("roomtex-view", view), ("roomtex-pick", pick)):
        server = Server(here, line + "0")
        strangers = []
        problem = ""
        for _ in range(200):
            try:
                one = socket.create_connection(("127.0.0.1", server.port), timeout=5)
                one.sendall(b"GET /")
                strangers.append(one)
            except OSError as error:
                problem = f"connecting: {error}"
                break
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
