"""Times `thermocomp diagnose` beside diagnose_numpy.py on the data of diagnose_data.py."""

import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile

import diagnose_data

HERE = pathlib.Path(__file__).resolve().parent
ROUNDS = 3


def cpu_s(command, folder):
    """User and system time of one run: others may use this machine too."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def main(program):
    with tempfile.TemporaryDirectory() as folder:
        diagnose_data.write(folder)
        ours = [program, "diagnose", "--model", "model.toml", "--train", "train.csv", "--test",
                "test.csv", "--weighed"]
        taken = {"ours": [], "numpy": [], "grids": []}
        for _ in range(ROUNDS):
            seconds, said = cpu_s(ours, folder)
            taken["ours"].append(seconds)
            if "missing_heat_source of s0_rpm" not in said:
                raise SystemExit("diagnose did not find what was hidden:\n" + said)
            searches = max(int(line.split()[1][:-1]) for line in said.splitlines()
                           if line.startswith("weighed"))
            seconds, said = cpu_s(["/usr/bin/python3", str(HERE / "diagnose_numpy.py"), folder,
                                   str(searches)], folder)
            taken["numpy"].append(seconds)
            taken["grids"].append(float(said.split()[0]))
            if "missing_heat_source 0" not in said:
                raise SystemExit("numpy did not find what was hidden: " + said)
    ours, numpy = (statistics.median(taken[name]) for name in ("ours", "numpy"))
    print(f"diagnose_seconds {ours:.3f} s")
    print(f"numpy_seconds {numpy:.3f} s")
    print(f"numpy_grids_alone_seconds {statistics.median(taken['grids']):.3f} s")
    print(f"time_over_numpy {ours / numpy:.4f} ratio")


if __name__ == "__main__":
    main(sys.argv[1])
