#!/usr/bin/python3
"""See fleet.sh."""
import itertools
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "bench/daemon"), str(ROOT / "tests/integration/fleet")]

import daemon_runs  # noqa: E402
import fleet_lab  # noqa: E402
import postgres  # noqa: E402

UPLINKS, HOURS, RATE_HZ = 50, 6, 100
ROUNDS, SECONDS = int(os.environ.get("ROUNDS", "5")), float(os.environ.get("SECONDS_EACH", "30"))
KEYS = ("p50", "p99", "p999")


def server_cpu_s(server):
    """Processor time of the server with all of its ended processes."""
    pid = (server.data / "postmaster.pid").read_text().split()[0]
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def peak_MB(pid):
    """Largest resident memory so far; 0 for a process that has ended."""
    try:
        status = pathlib.Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1000 for line in status.splitlines() if line.startswith("VmHWM")), 0.0)


def many_uplinks(store):
    """Runs uplinks until all histories are sent; (rows, seconds, CPU of the server, CPU of all
    uplinks, largest MB)."""
    first = fleet_lab.Machine(store, "first")
    first.record(hours_ago=HOURS + 1, hours=HOURS)
    machines = [fleet_lab.Machine(store, f"mill_{i}", history=first.history) for i in range(UPLINKS)]
    server_before, began = server_cpu_s(store.server), time.monotonic()
    running = [subprocess.Popen([str(fleet_lab.BIN / "thermocomp-uplink"), "--once", str(machine.folder / "uplink.toml")],
                                stderr=subprocess.DEVNULL) for machine in machines]
    usages, memory_MB = [], 0.0
    for process in running:
        ended = 0
        while not ended:
            memory_MB = max([memory_MB, *(peak_MB(each.pid) for each in running if each.returncode is None)])
            ended, status, usage = os.wait4(process.pid, os.WNOHANG)
            time.sleep(0.02)
        process.returncode = status
        assert status == 0, "an uplink failed"
        usages.append(usage)
    took_s = time.monotonic() - began
    rows = int(store.value("SELECT count(*) FROM fleet.sample"))
    assert rows == UPLINKS * len(first.recorded())
    return (rows, took_s, server_cpu_s(store.server) - server_before,
            sum(usage.ru_utime + usage.ru_stime for usage in usages), memory_MB)


def run(store, port, with_uplink):
    """(timing of a daemon, share of a core and MB of the uplink) for one run."""
    with tempfile.TemporaryDirectory() as folder:
        daemon = daemon_runs.Daemon(fleet_lab.BIN, folder, port, RATE_HZ)
        uplink, used = None, (0.0, 0.0)
        try:
            if with_uplink:
                config = pathlib.Path(folder) / "uplink.toml"
                config.write_text(f'format = 1\nmachine = "live"\nstore = "{store.remote("machine_live")}"\n'
                                  f'password_file = "{store.folder}/live.password"\nhistory = ["history.db"]\n'
                                  "period_s = 10\n")
                uplink = subprocess.Popen([str(fleet_lab.BIN / "thermocomp-uplink"), str(config)],
                                          stderr=subprocess.DEVNULL)
                os.setpriority(os.PRIO_PROCESS, uplink.pid, 19)  # like the unit
            time.sleep(SECONDS)
            timing = daemon.call("timing")
        finally:
            if uplink:
                memory_MB = peak_MB(uplink.pid)
                uplink.terminate()
                _, status, usage = os.wait4(uplink.pid, 0)
                uplink.returncode = status
                used = ((usage.ru_utime + usage.ru_stime) / SECONDS, memory_MB)
            daemon.stop()
    return timing, used


def beside_a_daemon(store):
    store.add("live")
    orders = itertools.cycle(list(itertools.permutations(("alone", "uplink", "again"))))
    rounds, used = [], []
    with tempfile.TemporaryDirectory() as folder:
        machine = daemon_runs.Machine(fleet_lab.BIN, folder)
        try:
            for number in range(ROUNDS):
                timings = {}
                for kind in next(orders):
                    timings[kind], each = run(store, machine.port, kind == "uplink")
                    if kind == "uplink":
                        used.append(each)
                rounds.append(timings)
                print(f"round {number + 1} of {ROUNDS}", file=sys.stderr, flush=True)
        finally:
            machine.stop()
    assert int(store.value("SELECT count(*) FROM fleet.sample JOIN fleet.machine ON id = machine "
                           "WHERE name = 'live'")) > 0
    print(f"fleet.uplink_core {100 * statistics.median(core for core, _ in used):.3f} %")
    print(f"fleet.uplink_memory {max(memory for _, memory in used):.1f} MB")
    for key in KEYS:
        def ratio(above, below):
            return [each[above][f"lateness_us_{key}"] / each[below][f"lateness_us_{key}"] for each in rounds]
        both = ratio("uplink", "alone") + ratio("uplink", "again")
        print(f"fleet.cycle_{key}_uplink_over_alone {statistics.median(both):.3f} ratio")
        print(f"fleet.cycle_{key}_alone_over_alone {statistics.median(ratio('again', 'alone')):.3f} ratio")


def main():
    server = postgres.Postgres()
    try:
        server.require_tls()
        server.start()
        with tempfile.TemporaryDirectory() as folder:
            store = fleet_lab.Store(server, pathlib.Path(folder), "bench_fleet")
            rows, took_s, server_s, uplinks_s, memory_MB = many_uplinks(store)
            size = int(store.value("SELECT sum(pg_total_relation_size(relid)) FROM "
                                   "pg_partition_tree('fleet.sample') WHERE isleaf"))
            print(f"fleet.rows {rows} rows")
            print(f"fleet.rows_a_second {rows / took_s:.0f} 1/s")
            print(f"fleet.rows_a_core_second {rows / server_s:.0f} 1/s")
            print(f"fleet.uplink_cpu_a_row {1e6 * uplinks_s / rows:.0f} us")
            print(f"fleet.uplink_memory_catching_up {memory_MB:.1f} MB")
            print(f"fleet.bytes_a_row {size / rows:.0f} B")
            beside_a_daemon(store)
    finally:
        server.end()


if __name__ == "__main__":
    main()
