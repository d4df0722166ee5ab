#!/usr/bin/python3
"""See fleet_absence.sh."""
import os
import pathlib
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/integration/fleet")]

import fleet_lab  # noqa: E402
import postgres  # noqa: E402
from fleet import peak_MB  # noqa: E402

DAYS = float(os.environ.get("DAYS", "90"))


def catch_up(machine):
    """(seconds, CPU seconds, largest resident MB)"""
    began, memory_MB, ended = time.monotonic(), 0.0, 0
    process = subprocess.Popen([str(fleet_lab.BIN / "thermocomp-uplink"), "--once", str(machine.folder / "uplink.toml")],
                               stdin=subprocess.DEVNULL)
    while not ended:
        memory_MB = max(memory_MB, peak_MB(process.pid))
        ended, status, usage = os.wait4(process.pid, os.WNOHANG)
        time.sleep(0.02)
    process.returncode = status
    assert status == 0, "the uplink failed"
    return time.monotonic() - began, usage.ru_utime + usage.ru_stime, memory_MB


def main():
    server = postgres.Postgres()
    try:
        server.require_tls()
        server.start()
        with tempfile.TemporaryDirectory() as folder:
            store = fleet_lab.Store(server, pathlib.Path(folder), "absence")
            machine = fleet_lab.Machine(store, "away")
            config = machine.folder / "thermocompd.toml"
            config.write_text(config.read_text().replace("rate_hz = 2", "rate_hz = 1"))
            recorded = machine.record(hours_ago=24 * DAYS + 2, hours=24 * DAYS, probings_per_h=0.5)
            print(f"{machine.history.stat().st_size / 1e6:.0f} MB of history", file=sys.stderr, flush=True)
            took_s, core_s, memory_MB = catch_up(machine)
            means, taken = machine.recorded(), machine.taken()
            sent, refused, repeated = machine.progress()
            wrong = sum(abs(taken[begin][name] - value) > 1e-5 * abs(value) + 1e-5
                        for begin, row in means.items() if begin in taken for name, value in row.items())
            print(f"fleet_absence.rows {len(taken)} rows")
            print(f"fleet_absence.lost {len(means.keys() - taken.keys())} rows")
            print(f"fleet_absence.twice_or_foreign {machine.count('sample') - len(means.keys() & taken.keys())} rows")
            print(f"fleet_absence.refused_or_repeated {refused + repeated + sent - len(means)} rows")
            print(f"fleet_absence.other_values {wrong} values")
            print(f"fleet_absence.probings_lost {recorded['probings'] - machine.count('probing')} probings")
            print(f"fleet_absence.events_lost {recorded['events'] - machine.count('event')} events")
            print(f"fleet_absence.took {took_s:.0f} s")
            print(f"fleet_absence.uplink_cpu {core_s:.1f} s")
            print(f"fleet_absence.uplink_memory {memory_MB:.1f} MB")
    finally:
        server.end()


if __name__ == "__main__":
    main()
