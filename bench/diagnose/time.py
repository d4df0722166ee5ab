"""Processor time of `thermocomp diagnose` with one thread: a day of 64 channels with heat that no
sensor measures, and the measured spindle if its data exist. The hidden effect must be found.

    time.py PROGRAM
"""

import json
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile

import day_of_64_channels

os.environ["OPENBLAS_NUM_THREADS"] = "1"
ROUNDS = 5
HIDDEN = ("missing_heat_source", "s0_rpm")
SOURCE = pathlib.Path(__file__).resolve().parents[2]
DATA = pathlib.Path(os.environ.get("THERMOCOMP_DATA", SOURCE.parent / "shared" / "data"))
DAY_S_MAX, SPINDLE_S_MAX = 5.0, 20.0  # longest acceptable times


def cpu_s(command):
    """User and system time of one run, since others may use this machine too."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def timed(name, limit_s, command):
    seconds = statistics.median(cpu_s(command) for _ in range(ROUNDS))
    return [f"{name}_seconds {seconds:.3f} s", f"{name}_over_limit {seconds / limit_s:.4f} ratio"]


def day(program, folder):
    day_of_64_channels.write(folder)
    answer = folder / "answer.json"
    lines = timed("day_of_64_channels", DAY_S_MAX, [
        program, "diagnose", "--model", folder / "model.toml", "--train", folder / "train.csv",
        "--test", folder / "test.csv", "--json", answer])
    found = [(each["cause"], each["subject"]) for each in json.loads(answer.read_text())["findings"]]
    if found != [HIDDEN]:
        raise SystemExit(f"not found what was hidden: {found}")
    return lines


def spindle(program, folder):
    record = DATA / "spindle_46h" / "hours_00_32.csv"
    if not record.exists():
        print(f"the spindle is left out: there is no {record}", file=sys.stderr)
        return []
    return timed("spindle", SPINDLE_S_MAX, [
        program, "diagnose", "--model", record.with_name("static_model.toml"),
        "--train", f"{record}@:86760", "--test", f"{record}@86760:",
        "--json", folder / "spindle.json"])


def main(program):
    with tempfile.TemporaryDirectory() as folder:
        lines = day(program, pathlib.Path(folder)) + spindle(program, pathlib.Path(folder))
    print("\n".join(lines))


if __name__ == "__main__":
    main(os.path.abspath(sys.argv[1]))
