"""See footprint.sh."""

import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

from daemon_runs import SENSORS, Daemon, Machine

TICKS_PER_S = os.sysconf("SC_CLK_TCK")


def cpu_s(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def status_MB(pid, key):
    text = pathlib.Path(f"/proc/{pid}/status").read_text()
    return int(re.search(rf"^{key}:\s+(\d+) kB", text, re.M).group(1)) / 1024


def main():
    options = argparse.ArgumentParser()
    options.add_argument("--bin", type=pathlib.Path, required=True)
    options.add_argument("--seconds", type=int, default=60)
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        machine = Machine(given.bin, folder)
        bare = subprocess.Popen([given.bin / "bench_bare_poller", str(machine.port),
                                 str(2 * SENSORS)])
        daemon = Daemon(given.bin, folder, machine.port, 100)
        try:
            time.sleep(5)
            before = cpu_s(daemon.process.pid), cpu_s(bare.pid)
            print(f"measuring for {given.seconds} s", file=sys.stderr)
            time.sleep(given.seconds)
            ours_s = cpu_s(daemon.process.pid) - before[0]
            theirs_s = cpu_s(bare.pid) - before[1]
            print(f"daemon_threads {len(os.listdir(f'/proc/{daemon.process.pid}/task'))} threads")
            print(f"daemon_locked {status_MB(daemon.process.pid, 'VmLck'):.1f} MB")
            print(f"daemon_rss {status_MB(daemon.process.pid, 'VmRSS'):.1f} MB")
            print(f"daemon_rss_peak {status_MB(daemon.process.pid, 'VmHWM'):.1f} MB")
            print(f"bare_poller_rss {status_MB(bare.pid, 'VmRSS'):.1f} MB")
            print(f"daemon_cpu {100 * ours_s / given.seconds:.2f} percent")
            print(f"bare_poller_cpu {100 * theirs_s / given.seconds:.2f} percent")
            print(f"cpu_over_bare_poller {ours_s / max(theirs_s, 1 / TICKS_PER_S):.2f} ratio")
        finally:
            daemon.stop()
            bare.kill()
            machine.stop()


main()
