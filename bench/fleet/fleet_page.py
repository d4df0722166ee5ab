#!/usr/bin/python3
"""First paint of the page of 200 machines, in a browser without cache; medians of ten loads."""

import os
import pathlib
import statistics
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
os.environ["THERMOCOMP_BIN"] = os.environ.get("THERMOCOMP_BENCH_BUILD", str(ROOT / "build/release")) + "/bin"
sys.path[:0] = [str(ROOT / "tests/integration/fleet"), str(ROOT / "tests/integration/gateway"),
                str(ROOT / "tests/integration/daemon")]

from chromium import headless  # noqa: E402
from fill_store import ODD, fill  # noqa: E402
from fleet_lab import Store  # noqa: E402
from lab import eventually  # noqa: E402
from postgres import Postgres  # noqa: E402
from test_page import Page  # noqa: E402

LOADS = 10


def painted(driver, port):
    """(first contentful paint, table of all machines in the page) [ms after the start of navigation]"""
    driver.get("about:blank")
    driver.get(f"http://localhost:{port}/")
    eventually(lambda: driver.execute_script("return document.querySelectorAll('#machines tbody tr').length") == 200,
               "all machines")
    return driver.execute_script("""
        const content = performance.getEntriesByName('first-contentful-paint')[0].startTime;
        const table = performance.getEntriesByName('machines shown')[0].startTime;
        return [content, table]""")


def asked_ms(page, path):
    begun = time.monotonic()
    page.json(path)
    return 1000 * (time.monotonic() - begun)


def main():
    server = Postgres().start()
    try:
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            store = Store(server, folder, "page")
            fill(store.ask, minutes="10 days")
            rows = store.value("SELECT count(*) FROM fleet.minute")
            print(f"{rows} minutes", file=sys.stderr)
            page = Page(store, folder)
            try:
                with headless(folder, "window-size=390,844") as driver:
                    driver.execute_cdp_cmd("Network.enable", {})
                    driver.execute_cdp_cmd("Network.setCacheDisabled", {"cacheDisabled": True})
                    painted(driver, page.port)
                    paints = [painted(driver, page.port) for _ in range(LOADS)]
                figures = [("first_paint", statistics.median(each[0] for each in paints)),
                           ("all_machines_shown", statistics.median(each[1] for each in paints)),
                           ("machines_answered", statistics.median(asked_ms(page, "/api/machines") for _ in range(LOADS)))]
                for name, seconds in (("day", 86400), ("month", 2592000)):
                    path = f"/api/curves?name={ODD}&column=head_degC&seconds={seconds}"
                    figures.append((f"curves_of_a_{name}",
                                    statistics.median(asked_ms(page, path) for _ in range(LOADS))))
            finally:
                page.end()
    finally:
        server.end()
    for name, value in figures:
        print(f"{name} {value:.0f} ms")


if __name__ == "__main__":
    main()
