"""A thousand simultaneous slow or hostile connections: the daemon and its machine are not affected, the
gateway's memory stays small, and other clients are served again."""

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
# Limit of the gateway's unit; sanitizers need more.
MEMORY_MAX_KB = 1024 * int(os.environ.get("THERMOCOMP_GATEWAY_MEMORY_MB", "128"))
REQUEST = b"GET /api/history?from=-28800&points=5000 HTTP/1.1\r\nHost: localhost\r\n\r\n"
STREAM = b"GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n"
# Bytes sent at once, and bytes sent later, one every 0.5 s.
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
    """The connections; one thread sends a byte on each every 0.5 s."""

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
            entry[1] = entry[2] = b""  # closed by the gateway

    def said_to(self, kind):
        """Answers to the connections of a kind, as far as received."""
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
    """Events of mode, commands and daemon. (Module and controller run in this process and may be late.)"""
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
        # Meanwhile the machine warms and the offset follows.
        for offset_um in (9.0, 3.0, 12.0):
            machine.warm_by(offset_um)
            machine.daemon.wait_for_offset(offset_um)
            assert machine.daemon.status()["mode"] == "compensating"
            assert resident_kB(gateway) < MEMORY_MAX_KB
        # Slow connections are closed although they continue, so another client gets a place.
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
        del status["reference"]["objections"]  # depend on the temperatures
    for key in ("enabled", "mode", "reference", "model"):
        assert after[key] == before[key], key
    assert changes(machine.daemon) == changes_before
    assert after["uptime_s"] > before["uptime_s"]
    gateway.end()
