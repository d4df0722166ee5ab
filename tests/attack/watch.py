"""Independent observers of the attacked daemon, with their own clocks."""

import bisect
import contextlib
import json
import socket
import threading
import time


class Metronome:
    """Wakes every few milliseconds and records its delays: the machine's latency, which is deducted
    from the daemon's."""

    PERIOD_S = 0.005
    NOTED_FROM_S = 0.002

    def __init__(self):
        self.at_s = []
        self.late_s = []
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        due = time.monotonic() + self.PERIOD_S
        while not self.ending.is_set():
            time.sleep(max(0.0, due - time.monotonic()))
            now = time.monotonic()
            if now - due > self.NOTED_FROM_S:
                self.at_s.append(now)
                self.late_s.append(now - due)
            due = max(due + self.PERIOD_S, now)

    def lateness_s(self, since_s, until_s):
        first = bisect.bisect_left(self.at_s, since_s)
        late = 0.0
        for at, lateness in zip(self.at_s[first:], self.late_s[first:]):
            if at - lateness > until_s:
                break
            late = max(late, lateness)
        return late

    def close(self):
        self.ending.set()
        self.thread.join(5)


class ServiceManager:
    """Receives notifications like systemd: NOTIFY_SOCKET of all daemons of this rig."""

    def __init__(self, path):
        self.path = path
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(path))
        self.fed_at_s = []
        self.ready = threading.Event()
        self.thread = threading.Thread(target=self.listen, daemon=True)
        self.thread.start()

    def listen(self):
        while (message := self.socket.recv(4096)) != b"end":
            if b"READY=1" in message:
                self.ready.set()
            if b"WATCHDOG=1" in message:
                self.fed_at_s.append(time.monotonic())

    def close(self):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
            link.sendto(b"end", str(self.path))
        self.thread.join(5)
        self.socket.close()


class Refused(Exception):
    """The answer is an error."""


def connect(path, timeout_s=30.0):
    link = socket.socket(socket.AF_UNIX)
    link.settimeout(timeout_s)
    try:
        link.connect(str(path))
    except OSError:
        link.close()
        raise
    return link


def request(method, **params):
    return json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params}).encode()


def call(path, method, timeout_s=30.0, **params):
    """Result of a call on its own connection. Raises OSError, Refused, ValueError (no JSON)."""
    with connect(path, timeout_s) as link:
        link.sendall(request(method, **params) + b"\n")
        with link.makefile("rb") as lines:
            line = lines.readline()
    if not line:
        raise ConnectionResetError("no answer")
    answer = json.loads(line)
    if "error" in answer:
        raise Refused(answer["error"]["message"])
    return answer["result"]


class Client:
    """Asks for the status four times a second and records the response times."""

    PAUSE_S = 0.25

    def __init__(self, path):
        self.path = path
        self.waited = []  # (asked at, answered at or None)
        self.asking_since_s = None
        self.paused = True
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        while not self.ending.wait(self.PAUSE_S):
            if self.paused:
                continue
            self.asking_since_s = asked = time.monotonic()
            with contextlib.suppress(OSError, ValueError, Refused):
                call(self.path, "status", timeout_s=60.0)
                self.waited.append((asked, time.monotonic()))
            self.asking_since_s = None

    def all_waits(self):
        """Response times including a pending one."""
        since = self.asking_since_s
        return self.waited + ([(since, time.monotonic())] if since else [])

    def close(self):
        self.ending.set()
        self.thread.join(0.1)
