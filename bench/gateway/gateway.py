#!/usr/bin/python3
"""Cost of thermocomp-gateway next to a running daemon.

Memory, processor, bytes of the page, first paint, time for a month of history. Processes and
devices are those of the integration tests.

    bench/gateway/gateway.py [--pages 5] [--seconds 30]
"""
import argparse
import contextlib
import os
import pathlib
import shutil
import statistics
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/integration/gateway"), str(ROOT / "tests/integration/daemon")]

from chromium import headless  # noqa: E402
from gateway_lab import Gateway, stretch_history  # noqa: E402
from lab import Lab, eventually  # noqa: E402
from plain_devices import Machine  # noqa: E402


def memory_MB(pid):
    with open(f"/proc/{pid}/smaps_rollup") as text:
        fields = {line.split(":")[0]: line.split()[1] for line in text if ":" in line
                  and line.split(":")[0] in ("Rss", "Pss")}
    return int(fields["Rss"]) / 1000, int(fields["Pss"]) / 1000


def processor_s(pid):
    with open(f"/proc/{pid}/stat") as text:
        fields = text.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def open_pages(gateway, count, stack, stops):
    """Streams read like a browser does."""
    def read(answer):
        with contextlib.suppress(Exception):
            while not stops.is_set() and answer.readline():
                pass

    for _ in range(count):
        link = stack.enter_context(contextlib.closing(gateway.connect()))
        link.request("GET", "/api/events")
        threading.Thread(target=read, args=(link.getresponse(),), daemon=True).start()


def first_paints_ms(gateway, folder, loads):
    """From the start of each load to the first contentful paint, without cache."""
    paints = []
    with headless(folder, "window-size=390,844") as driver:
        driver.execute_cdp_cmd("Network.enable", {})
        driver.execute_cdp_cmd("Network.setCacheDisabled", {"cacheDisabled": True})
        for _ in range(loads):
            driver.get(f"http://localhost:{gateway.port}/")
            paint = eventually(lambda: driver.execute_script(
                "const paint = performance.getEntriesByName('first-contentful-paint')[0];"
                "return paint && document.getElementById('answer').textContent === 'yes'"
                " ? paint.startTime : null"), "a paint")
            paints.append(paint)
    return paints


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pages", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--loads", type=int, default=9)
    options = parser.parse_args()
    lab = Lab(pathlib.Path(tempfile.mkdtemp(prefix="gateway")))
    stops = threading.Event()
    try:
        machine = Machine(lab)
        machine.start()
        gateway = lab.also_end(Gateway(lab, machine.daemon)).start()
        page_bytes = sum(len(gateway.ask(path, headers={"Accept-Encoding": "gzip"})[2]) for path in (
            "/", "/page.js", "/charts.js", "/page.css", "/icon.svg", "/manifest.json", "/dygraph.min.js", "/dygraph.min.css"))
        with contextlib.ExitStack() as stack:
            open_pages(gateway, options.pages, stack, stops)
            time.sleep(3.0)
            begun_s, used_s = time.monotonic(), processor_s(gateway.process.pid)
            time.sleep(options.seconds)
            share = (processor_s(gateway.process.pid) - used_s) / (time.monotonic() - begun_s)
            resident_MB, own_MB = memory_MB(gateway.process.pid)
            stops.set()
        paints_ms = []
        if shutil.which("chromedriver") and shutil.which("chromium"):
            paints_ms = first_paints_ms(gateway, lab.folder, options.loads)
        machine.daemon.end()
        stretch_history(machine.daemon.history, days=30)
        begun_s = time.monotonic()
        told = gateway.json(f"/api/history?from={-30 * 86400}&points=900")
        month_drawn_s = time.monotonic() - begun_s
        known = sum(value is not None for value in told["columns"]["z_offset_um"])
        assert known >= 898, known
        print(f"month: {told['chunks']} commits, {told['chunks_read']} read, 900 points")
        print(f"gateway.page, with gzip {page_bytes / 1000:.1f} kB")
        if paints_ms:
            print(f"gateway.first_paint {statistics.median(paints_ms):.0f} ms")
            print(f"gateway.first_paint_worst {max(paints_ms):.0f} ms")
        print(f"gateway.resident {resident_MB:.1f} MB")
        print(f"gateway.resident_own {own_MB:.1f} MB")
        print(f"gateway.processor {100 * share:.2f} percent")
        print(f"gateway.month_of_history {month_drawn_s:.2f} s")
    finally:
        lab.end()


if __name__ == "__main__":
    main()
