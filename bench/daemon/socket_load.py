"""See socket_load.sh."""

import argparse
import json
import os
import pathlib
import re
import resource
import selectors
import socket
import statistics
import subprocess
import sys
import tempfile
import time

from daemon_runs import Daemon, Machine

RATE_HZ = 1000
SUBSCRIBERS, POLLERS, SLOW, HALF = 400, 300, 200, 100
STORM_PER_S = 300
STATUS = b'{"jsonrpc":"2.0","id":1,"method":"status"}\n'
SUBSCRIBE = (b'{"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"methods":["status"],'
             b'"period_s":%s}}\n')


def connect(path):
    link = socket.socket(socket.AF_UNIX)
    link.connect(path)
    link.setblocking(False)
    return link


def crowd(path, seconds):
    """A thousand clients for this time; prints "ready" once all are connected, then their counts."""
    resource.setrlimit(resource.RLIMIT_NOFILE, (4096, 4096))
    readers = selectors.DefaultSelector()
    pollers, silent = [], []
    for i in range(SUBSCRIBERS + POLLERS + SLOW + HALF):
        link = connect(path)
        if i < SUBSCRIBERS:
            link.send(SUBSCRIBE % b"1.0")
            readers.register(link, selectors.EVENT_READ)
        elif i < SUBSCRIBERS + POLLERS:
            pollers.append(link)
            readers.register(link, selectors.EVENT_READ)
        else:
            link.send(SUBSCRIBE % b"0.1" if len(silent) < SLOW else STATUS[:-5])
            silent.append(link)
    print("ready", flush=True)
    begun = time.monotonic()
    received = storms = polled = gone = 0
    while (passed := time.monotonic() - begun) < seconds:
        for key, _ in readers.select(0.005):
            data = key.fileobj.recv(65536)
            received += len(data)
            if not data:
                gone += 1
                readers.unregister(key.fileobj)
        while polled < passed * len(pollers):  # each once a second
            pollers[polled % len(pollers)].send(STATUS)
            polled += 1
        while storms < passed * STORM_PER_S:
            connect(path).close()
            storms += 1
    print(json.dumps({"received_MB": received / 1e6, "storms": storms, "polls": polled,
                      "closed_by_daemon": gone}))


def rss_MB(pid):
    text = pathlib.Path(f"/proc/{pid}/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+)", text).group(1)) / 1024


def run(programs, machine, seconds, loaded):
    with tempfile.TemporaryDirectory() as folder:
        daemon = Daemon(programs, folder, machine.port, RATE_HZ)
        load = None
        try:
            if loaded:
                before_MB = rss_MB(daemon.process.pid)
                load = subprocess.Popen(
                    [sys.executable, __file__, "--crowd", os.path.join(folder, "status.sock"),
                     "--seconds", str(seconds + 2)], stdout=subprocess.PIPE, text=True)
                assert load.stdout.readline() == "ready\n"
            answers_ms = []
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                if loaded:
                    begun = time.monotonic()
                    assert daemon.call("status"), "no answer to a polite client"
                    answers_ms.append(1e3 * (time.monotonic() - begun))
                time.sleep(0.25)
            timing = daemon.call("timing")
            result = {"timing": timing}
            if loaded:
                result["answers_ms"] = answers_ms
                result["grown_MB"] = rss_MB(daemon.process.pid) - before_MB
                result["socket"] = daemon.call("status")["socket"]
                result["crowd"] = json.loads(load.communicate(timeout=60)[0])
            return result
        finally:
            if load is not None and load.poll() is None:
                load.kill()
            daemon.stop()


def main():
    options = argparse.ArgumentParser()
    options.add_argument("--bin", type=pathlib.Path)
    options.add_argument("--pairs", type=int, default=7)
    options.add_argument("--seconds", type=float, default=10)
    options.add_argument("--crowd")
    given = options.parse_args()
    if given.crowd:
        return crowd(given.crowd, given.seconds)
    keys = ("p50", "p99", "p999", "max")
    quiet, loaded = [], []
    with tempfile.TemporaryDirectory() as folder:
        machine = Machine(given.bin, folder)
        try:
            for pair in range(given.pairs):
                # Alternating order, because the machine's other load may change.
                for load in ((False, True) if pair % 2 == 0 else (True, False)):
                    result = run(given.bin, machine, given.seconds, load)
                    (loaded if load else quiet).append(result)
                    lateness = ", ".join(f"{key} {result['timing'][f'lateness_us_{key}']:.0f} us"
                                         for key in keys)
                    print(f"pair {pair + 1}: {'loaded' if load else 'quiet '} {lateness}; missed "
                          f"{result['timing']['missed']}" +
                          (f"; {result['socket']}; {result['crowd']}" if load else ""),
                          file=sys.stderr, flush=True)
        finally:
            machine.stop()
    answers_ms = sorted(each for result in loaded for each in result["answers_ms"])
    print(f"clients {SUBSCRIBERS + POLLERS + SLOW + HALF} clients")
    print(f"missed_quiet {sum(each['timing']['missed'] for each in quiet)} cycles")
    print(f"missed_loaded {sum(each['timing']['missed'] for each in loaded)} cycles")
    print(f"polite_answer_median {statistics.median(answers_ms):.1f} ms")
    print(f"polite_answer_worst {answers_ms[-1]:.1f} ms")
    print(f"memory_growth {max(each['grown_MB'] for each in loaded):.1f} MB")
    for name, runs in (("quiet", quiet), ("loaded", loaded)):
        for key in keys[:3]:
            values = [each["timing"][f"lateness_us_{key}"] for each in runs]
            print(f"lateness_{key}_{name} {statistics.median(values):.0f} us")
    for key in keys[:3]:
        ratios = [b["timing"][f"lateness_us_{key}"] / a["timing"][f"lateness_us_{key}"]
                  for a, b in zip(quiet, loaded)]
        print(f"lateness_{key}_loaded_over_quiet {statistics.median(ratios):.2f} ratio")


main()
