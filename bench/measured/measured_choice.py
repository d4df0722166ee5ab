"""The family chosen by `thermocomp fit` from several runs, compared with the best one: test RMS in
um, mean over outputs, on sets of four to eight runs cut from measured data; then for each machine
the ratio of the default's RMS to that of the best family, geometric mean over the sets.

    measured_choice.py PROGRAM [--data FOLDER]

PROGRAM is thermocomp. Some minutes.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

# ruff: noqa: E402
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np

import measured_data as data
from measured import SOURCE, arguments, left_by, rms

FAMILIES = ("static_few", "lagged_few", "physical", "lag_bank")
H = data.HOUR_S
# Hours of the runs, and of those that are predicted.
SPINDLE = {
    "6x4h": ([(4 * i, 4 * i + 4) for i in range(6)], [(24, 33)]),
    "4x6h": ([(6 * i, 6 * i + 6) for i in range(4)], [(24, 33)]),
    "8x3h": ([(3 * i, 3 * i + 3) for i in range(8)], [(24, 33)]),
    "5x3h": ([(3 * i, 3 * i + 3) for i in range(5)], [(15, 24)]),
    "4x4h": ([(4 * i, 4 * i + 4) for i in range(4)], [(16, 24)]),
    "6x4h_back": ([(8 + 4 * i, 12 + 4 * i) for i in range(6)], [(0, 4), (4, 8)]),
    "8x2h_odd": ([(4 * i, 4 * i + 2) for i in range(8)], [(4 * i + 2, 4 * i + 4)
                                                         for i in range(8)]),
    "8h_and_4h": ([(0, 8), (8, 16), (16, 20), (20, 24)], [(24, 28), (28, 33)]),
}
SENSORS_OF_SOME = 6


def spindle(folder):
    """Each set with all sensors and twice with six of them, one row per half minute."""
    run = data.Run("spindle", data.read(folder / "spindle_46h" / "hours_00_32.csv"))
    run.columns = {name: values[::2] for name, values in run.columns.items()}
    outputs = [f"ch{i}_um" for i in range(1, 6)]
    temperatures = [name for name in run.columns if name.endswith("_degC")]
    random = np.random.default_rng(3)
    sets = []
    for name, (train, test) in SPINDLE.items():
        for part in range(3):
            some = temperatures if part == 0 else random.choice(temperatures, SENSORS_OF_SOME,
                                                                replace=False)
            spared = set(temperatures) - set(some)
            cut = lambda hours, spared=spared: run.cut(hours[0] * H, hours[1] * H).without(spared)
            sets.append(data.Split(f"spindle {name} {part}", [cut(h) for h in train],
                                   [cut(h) for h in test], outputs))
    return sets


def pieces(run, count):
    time_s = run.columns["time_s"]
    edges = np.linspace(time_s[0], time_s[-1] + 1, count + 1)
    return [run.cut(a, b) for a, b in zip(edges, edges[1:])]


def telescope(folder):
    sets = []
    for which in ("sci", "skye"):
        of = {p: data.Run(f"{which}_{p}", data.read(folder / "telescope_focus" /
                                                    f"{which}_{p}.csv")) for p in "ABC"}
        sets += [data.Split(f"telescope {which} {a} {b}", pieces(of[a], 5), pieces(of[b], 3),
                            ["focus_um"]) for a, b in ("AB", "BC", "CA")]
    return sets


def cell(folder):
    """Four rates to predict the fifth."""
    sets = []
    for which in ("S001", "S002"):
        of = {rate: data.Run(f"{which}_{rate}", data.read(folder / "cell_under_load" /
                                                          f"Q30_{which}_{rate}.csv"))
              for rate in ("C10", "1C", "2C", "3C", "4C")}
        sets += [data.Split(f"cell {which} {test}", [of[r] for r in of if r != test], [of[test]],
                            ["diameter_um"]) for test in of]
    return sets


def test_um(program, split, folder, family):
    """@return the chosen family and its RMS; None if there is no answer"""
    folder.mkdir()
    model = folder / "model.toml"
    done = subprocess.run([program, "fit", *arguments(split.train, folder, "train"), "--outputs",
                           ",".join(split.outputs), "-o", model, "--json",
                           *(["--family", family] if family else [])],
                          capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return None
    left, _, _, _ = left_by(program, model, arguments(split.test, folder, "test"), split)
    return json.loads(done.stdout)["family"], float(np.mean([rms(each) for each in left]))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--data", default=os.environ.get(
        "THERMOCOMP_DATA", SOURCE.parent / "shared" / "data"), type=pathlib.Path)
    options = parser.parse_args()
    if not options.data.is_dir():
        print(f"no measured data in {options.data} (THERMOCOMP_DATA): nothing to measure")
        return 77
    logs = {}
    with tempfile.TemporaryDirectory() as folder:
        for split in spindle(options.data) + telescope(options.data) + cell(options.data):
            split = split.of_common_columns()
            of = {family: test_um(options.program, split,
                                  pathlib.Path(folder) / f"{split.name}_{family}".replace(" ", "_"),
                                  family) for family in ("", *FAMILIES)}
            answers = {family: answer[1] for family, answer in of.items() if answer and family}
            taken, left = of[""]
            print(f"{split.name:26} {taken:10} {left:8.2f}   " +
                  "  ".join(f"{family} {value:.2f}" for family, value in answers.items()),
                  flush=True)
            logs.setdefault(split.name.split()[0], []).append(
                np.log(left / min(answers.values())))
    for machine, of_sets in logs.items():
        print(f"{machine}_default_over_best_family {np.exp(np.mean(of_sets)):.3f} ratio, "
              f"{len(of_sets)} sets")
    return 0


if __name__ == "__main__":
    sys.exit(main())
