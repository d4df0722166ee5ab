"""See jitter.sh."""

import argparse
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time

from daemon_runs import Daemon, Machine


def cyclictest(seconds):
    # --laptop: leaves the processor's sleep states unchanged, like the daemon.
    output = subprocess.run(
        ["cyclictest", "--laptop", "-m", "-q", "-t1", "-p60", "-i1000", f"-D{seconds}", "-h50000"],
        capture_output=True, text=True, check=True).stdout
    histogram = [(int(us), int(count)) for us, count in
                 re.findall(r"^(\d{6})\s+(\d+)\s*$", output, re.M) if int(count)]
    total = sum(count for _, count in histogram)
    seen = 0
    for us, count in histogram:
        seen += count
        if seen >= 0.999 * total:
            p999_us = us + 1  # upper edge, like the daemon's
            break
    worst_us = int(re.search(r"# Max Latencies:\s*(\d+)", output).group(1))
    return p999_us, worst_us


def daemon(programs, machine, seconds):
    with tempfile.TemporaryDirectory() as folder:
        running = Daemon(programs, folder, machine.port, 1000)
        try:
            time.sleep(seconds)
            timing = running.call("timing")
        finally:
            running.stop()
    return timing["lateness_us_p999"], timing["lateness_us_max"], timing["missed"]


def main():
    options = argparse.ArgumentParser()
    options.add_argument("--bin", type=pathlib.Path, required=True)
    options.add_argument("--pairs", type=int, default=10)
    options.add_argument("--seconds", type=int, default=30)
    given = options.parse_args()
    ratios, against_itself, ours, theirs, worst_ours, worst_theirs = [], [], [], [], [], []
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        machine = Machine(given.bin, folder)
        try:
            for pair in range(given.pairs):
                p999_us, worst_us, missed_now = daemon(given.bin, machine, given.seconds)
                first_us, first_worst_us = cyclictest(given.seconds)
                second_us, second_worst_us = cyclictest(given.seconds)
                ratios.append(p999_us / first_us)
                against_itself.append(second_us / first_us)
                ours.append(p999_us)
                theirs.append(first_us)
                worst_ours.append(worst_us)
                worst_theirs.append(max(first_worst_us, second_worst_us))
                missed += missed_now
                print(f"pair {pair + 1} of {given.pairs}: p99.9 daemon {p999_us:.0f} us, cyclictest "
                      f"{first_us} us and {second_us} us; worst {worst_us:.0f}, {first_worst_us}, "
                      f"{second_worst_us} us", file=sys.stderr)
        finally:
            machine.stop()
    print(f"daemon_p999 {statistics.median(ours):.1f} us")
    print(f"cyclictest_p999 {statistics.median(theirs):.1f} us")
    print(f"daemon_worst {max(worst_ours):.0f} us")
    print(f"cyclictest_worst {max(worst_theirs):.0f} us")
    print(f"daemon_missed_cycles {missed} cycles")
    print(f"cyclictest_against_itself_min {min(against_itself):.3f} ratio")
    print(f"cyclictest_against_itself_median {statistics.median(against_itself):.3f} ratio")
    print(f"cyclictest_against_itself_max {max(against_itself):.3f} ratio")
    print(f"p999_over_cyclictest {statistics.median(ratios):.3f} ratio")


main()
