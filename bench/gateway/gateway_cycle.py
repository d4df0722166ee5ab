#!/usr/bin/python3
"""See gateway_cycle.sh."""
import argparse
import itertools
import os
import pathlib
import selectors
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import types

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "bench/daemon"), str(ROOT / "tests/integration/gateway"),
                str(ROOT / "tests/integration/daemon")]

from daemon_runs import Daemon, Machine  # noqa: E402
from gateway_lab import Gateway  # noqa: E402
from lab import BIN  # noqa: E402

RATE_HZ = 1000
PAGES = 50
KEYS = ("p50", "p99", "p999")
REQUEST = "GET {} HTTP/1.1\r\nHost: localhost\r\n\r\n"


def read_pages(port):
    """Requests of the browsers of 50 pages, until killed; prints "ready" once all have a state."""
    os.nice(19)
    reading = selectors.DefaultSelector()
    told = set()

    def take(timeout_s):
        for key, _ in reading.select(timeout_s):
            data = key.fileobj.recv(65536)
            if not data:
                raise SystemExit("a stream ended")
            if b"data: " in data and key.fd not in told:
                told.add(key.fd)
                if len(told) == PAGES:
                    print("ready", flush=True)

    for _ in range(PAGES):
        for path in ("/", "/page.js", "/page.css", "/api/history?from=-28800&points=600"):
            with socket.create_connection(("127.0.0.1", port)) as link:
                link.sendall((REQUEST.format(path)[:-2] + "Connection: close\r\n\r\n").encode())
                while link.recv(65536):
                    pass
            take(0)  # an unread stream is ended
        link = socket.create_connection(("127.0.0.1", port))
        link.sendall(REQUEST.format("/api/events").encode())
        link.setblocking(False)
        reading.register(link, selectors.EVENT_READ)
    while True:
        take(None)


def run(machine, seconds, with_pages):
    """Timing of a daemon in one run; with pages also their count by the gateway."""
    with tempfile.TemporaryDirectory() as folder:
        daemon = Daemon(BIN, folder, machine.port, RATE_HZ)
        gateway = readers = None
        pages = 0
        try:
            if with_pages:
                place = pathlib.Path(folder)
                gateway = Gateway(types.SimpleNamespace(folder=place),
                                  types.SimpleNamespace(socket=place / "status.sock")).start()
                os.setpriority(os.PRIO_PROCESS, gateway.process.pid, 10)  # like the unit
                readers = subprocess.Popen([sys.executable, __file__, "--read", str(gateway.port)],
                                           stdout=subprocess.PIPE, text=True)
                assert readers.stdout.readline() == "ready\n"
            time.sleep(seconds)
            timing = daemon.call("timing")
            if gateway:
                pages = int(next(line.split()[1] for line in gateway.text("/metrics").splitlines()
                                 if line.startswith("thermocomp_gateway_pages")))
        finally:
            for process in (readers, gateway and gateway.process):
                if process:
                    process.kill()
                    process.wait(20)
            daemon.stop()
    return timing, pages


def main():
    parser = argparse.ArgumentParser(description="Lateness of the cycle with pages open.")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--read", type=int, help="port; used by the program itself")
    options = parser.parse_args()
    if options.read:
        read_pages(options.read)
    orders = itertools.cycle(list(itertools.permutations(("alone", "pages", "again"))))
    rounds = []
    pages_seen = set()
    with tempfile.TemporaryDirectory() as folder:
        machine = Machine(BIN, folder)
        try:
            for number in range(options.rounds):
                timings = {}
                for kind in next(orders):
                    timings[kind], pages = run(machine, options.seconds, kind == "pages")
                    if kind == "pages":
                        pages_seen.add(pages)
                rounds.append(timings)
                print(f"round {number + 1} of {options.rounds}: " + "; ".join(
                    f"{kind} p99.9 {timing['lateness_us_p999']:.0f} us, missed {timing['missed']}"
                    for kind, timing in timings.items()), file=sys.stderr, flush=True)
        finally:
            machine.stop()
    assert pages_seen == {PAGES}, pages_seen

    def ratios(above, below, key):
        return [each[above][f"lateness_us_{key}"] / each[below][f"lateness_us_{key}"] for each in rounds]

    print(f"gateway.cycle_pages {PAGES} pages")
    for kind in ("alone", "pages", "again"):
        print(f"gateway.cycle_missed_{kind} {sum(each[kind]['missed'] for each in rounds)} cycles")
    for key in KEYS:
        for kind in ("alone", "pages"):
            values = [each[kind][f"lateness_us_{key}"] for each in rounds]
            print(f"gateway.cycle_{key}_{kind} {statistics.median(values):.0f} us")
    for key in KEYS:
        both = ratios("pages", "alone", key) + ratios("pages", "again", key)
        itself = ratios("again", "alone", key)
        print(f"gateway.cycle_{key}_pages_over_alone {statistics.median(both):.3f} ratio")
        print(f"gateway.cycle_{key}_alone_over_alone {statistics.median(itself):.3f} ratio")
        print(f"gateway.cycle_{key}_alone_over_alone_least {min(itself):.3f} ratio")
        print(f"gateway.cycle_{key}_alone_over_alone_most {max(itself):.3f} ratio")


if __name__ == "__main__":
    main()
