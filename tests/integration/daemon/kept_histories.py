#!/usr/bin/python3
"""Replays histories of one build with another: has a change of the code changed an offset?

    kept_histories.py record BIN FOLDER    runs the tests of this folder that record every kind of
        history, with the programs in BIN, and keeps the histories: Modbus TCP and RTU, corrections,
        cycle ends, lost sensors, reloads during a run, restarts, kills
    kept_histories.py replay BIN FOLDER    replays each with the programs in BIN; exit status 1 if
        an offset differs or a history cannot be read

A test that fails while recording is reported, and its history is kept.
"""
import os
import pathlib
import re
import subprocess
import sys

HERE = pathlib.Path(__file__).parent
TESTS = ("history/test_spindle_replay.py", "history/test_exact_replay.py", "test_probing.py",
         "test_lost_sensors.py", "test_extended_model.py", "test_reloads.py")


def record(programs, folder):
    folder.mkdir(parents=True, exist_ok=True)
    environment = {**os.environ, "THERMOCOMP_BIN": str(programs.resolve()),
                   "THERMOCOMP_REPLAY_ROWS": os.environ.get("THERMOCOMP_REPLAY_ROWS", "600"),
                   "THERMOCOMP_RELOAD_SHARE": os.environ.get("THERMOCOMP_RELOAD_SHARE", "0.2")}
    subprocess.run(["/usr/bin/python3", "-m", "pytest", "-q", "-p", "no:cacheprovider",
                    f"--basetemp={folder / 'runs'}", *(str(HERE / name) for name in TESTS)],
                   env=environment, check=False)
    return 0 if list(folder.rglob("*.db")) else 1


def replay(programs, folder):
    histories = sorted(folder.rglob("*.db"))
    compared = different = unread = 0
    for history in histories:
        done = subprocess.run([str(programs / "thermocomp"), "replay", str(history), "-o",
                               os.devnull], capture_output=True, text=True, check=False)
        output = re.search(r"(\d+) offsets compared, (\d+) differ", done.stderr)
        name = history.relative_to(folder)
        if done.returncode not in (0, 1) or not output:
            unread += 1
            print(f"{name}: {done.stderr.strip()}")
            continue
        print(f"{name}: {output.group(0)}")
        compared += int(output.group(1))
        different += int(output.group(2))
    print(f"{len(histories)} histories, {unread} not read, {compared} offsets compared, "
          f"{different} differ")
    return 0 if compared and not different and not unread else 1


def main():
    if len(sys.argv) != 4 or sys.argv[1] not in ("record", "replay"):
        sys.exit(__doc__)
    work = record if sys.argv[1] == "record" else replay
    sys.exit(work(pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])))


if __name__ == "__main__":
    main()
