"""A thousand connections at once, of every kind that does not get on: the daemon and its machine notice
nothing, the gateway stays small, and others are served again."""

import contextlib
import os
import resource
import selectors
import socket
import threading

import pytest

from gateway_lab import Gateway
from lab import eventually

COUNT = 1000
# Of the gateway's unit; what a sanitizer keeps comes on top.
MEMORY_MAX_KB = 1024 * int(os.environ.get("THERMOCOMP_GATEWAY_MEMORY_MB", "128"))
REQUEST = b"GET /api/history?from=-28800&points=5000 HTTP/1.1\r\nHost: localhost\r\n\r\n"
STREAM = b"GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n"
# What each says at once, and what it says then, a byte now and then.
KINDS = {
    "silent": (b"", b""),
    "half": (b"GET / HTTP/1.1\r\nHo", b""),
    "slow": (b"", b"GET /" + b"a" * 4000),
    "slow body": (b"POST /api/command HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
                  b"Content-Length: 4000\r\n\r\n", b"{" * 4000),
    "does not read an answer": (REQUEST * 20, b""),
    "does not read a stream": (STREAM, b""),
    "oversize": (b"GET / HTTP/1.1\r\n" + b"X: " + b"y" * 30000 + b"\r\n", b"z" * 4000),
    "no HTTP": (bytes(range(256)) * 8, b"\r\n" * 2000),
    "climbs": (b"GET /../../etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n", b""),
    "another site": (b"GET /api/status HTTP/1.1\r\nHost: localhost\r\nOrigin: http://evil.example\r\n\r\n",
                     b""),
}


@pytest.fixture(autouse=True)
def enough_files():
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < 4096:
        pytest.skip("fewer than 4096 open files are allowed here")
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (4096, hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


class Crowd:
    """The connections, held by one thread that says a byte for each now and then."""

    def __init__(self, port):
        self.port = port
        self.links = []
        self.answers = b""
        self.stops = threading.Event()
        for i in range(COUNT):
            first, then = list(KINDS.values())[i % len(KINDS)]
            link = socket.socket()
            link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
            link.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                link.connect(("127.0.0.1", port))
            self.links.append([link, first, then])
        self.thread = threading.Thread(target=self.talk)
        self.thread.start()

    def talk(self):
        waiting = selectors.DefaultSelector()
        for entry in self.links:
            waiting.register(entry[0], selectors.EVENT_WRITE, entry)
        for key, _ in [*waiting.select(5.0), *waiting.select(0.2)]:
            self.say(key.data, len(key.data[1]))
        while not self.stops.wait(0.5):
            for entry in self.links:
                if entry[1]:
                    self.say(entry, len(entry[1]))
                elif entry[2]:
                    entry[1], entry[2] = entry[2][:1], entry[2][1:]
                    self.say(entry, 1)

    def say(self, entry, size):
        try:
            sent = entry[0].send(entry[1][:size])
            entry[1] = entry[1][sent:]
        except BlockingIOError:
            pass
        except OSError:
            entry[1] = entry[2] = b""  # it was ended

    def said_to(self, kind):
        """What one of a kind was answered, as far as it is there."""
        answers = b""
        for i, (link, _, _) in enumerate(self.links):
            if list(KINDS)[i % len(KINDS)] == kind:
                with contextlib.suppress(OSError):
                    answers += link.recv(4000)
        return answers

    def close(self):
        self.stops.set()
        self.thread.join()
        for link, _, _ in self.links:
            link.close()


def resident_kB(gateway):
    with open(f"/proc/{gateway.process.pid}/status") as text:
        return int(next(line.split()[1] for line in text if line.startswith("VmRSS")))


def is_served(gateway):
    with contextlib.suppress(OSError, Exception):
        with contextlib.closing(gateway.connect(3)) as link:
            link.request("GET", "/api/status")
            return link.getresponse().status == 200


def changes(daemon):
    """What was done to it. (Module and controller live in this process, and may be late in a crowd.)"""
    return [event for event in daemon.call("events")["events"]
            if event["kind"] in ("mode", "command", "daemon")]


@pytest.mark.parametrize("places", (100, 2000))
def test_a_thousand_at_once_change_nothing(lab, machine, places):
    gateway = lab.also_end(Gateway(lab, machine.daemon, f"connections_max = {places}")).start()
    eventually(lambda: is_served(gateway), "it serves")
    eventually(lambda: machine.daemon.status()["reference"]["by"], "the reference is taken")
    before = machine.daemon.status()
    changes_before = changes(machine.daemon)
    pid = gateway.process.pid
    with contextlib.closing(Crowd(gateway.port)) as crowd:
        # The machine warms meanwhile, and the offset follows.
        for offset_um in (9.0, 3.0, 12.0):
            machine.warm_by(offset_um)
            machine.daemon.wait_for_offset(offset_um)
            assert machine.daemon.status()["mode"] == "compensating"
            assert resident_kB(gateway) < MEMORY_MAX_KB
        # Those that do not get on are ended while they go on trying: somebody else gets a place.
        eventually(lambda: is_served(gateway), "others are served", 120)
        print(f"{places} places: the gateway has {resident_kB(gateway) / 1000:.1f} MB")
        assert resident_kB(gateway) < MEMORY_MAX_KB
        for kind in ("climbs", "another site"):
            answers = crowd.said_to(kind)
            assert b" 200 OK" not in answers and b"root:" not in answers, kind
    eventually(lambda: is_served(gateway), "it serves")
    assert gateway.process.poll() is None and gateway.process.pid == pid
    after = machine.daemon.status()
    for status in (before, after):
        del status["reference"]["objections"]  # the temperatures change them
    for key in ("enabled", "mode", "reference", "model"):
        assert after[key] == before[key], key
    assert changes(machine.daemon) == changes_before
    assert after["uptime_s"] > before["uptime_s"]
    gateway.end()
