"""Test RMS of `thermocomp diagnose` compared with usual fits, on machines with a hidden effect
(tests/diagnosis) and the same splits, and on the measured spindle.

    baselines.py PROGRAM [--cases N] [--levels 1,2] [--keep FOLDER]

    refit   static least squares of all temperatures
    arx     d[t] = a d[t-1] + B [T, u](t) + C [T, u](t-1), run freely over the test rows
    lasso   L1 regression on all temperatures and signals, each with four lags; penalty from left-out rows
    sparse  sequential-threshold least squares on the same library with squares

Each is fitted to the residual of the base model and added to it, which improves all of them.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

os.environ["OPENBLAS_NUM_THREADS"] = "1"

# ruff: noqa: E402
import numpy as np

SOURCE = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCE / "tests" / "diagnosis"))
import cases
import hidden_effects as hidden

try:
    import tomllib
except ImportError:
    raise SystemExit("needs Python 3.11")

LAGS_S = (600.0, 1800.0, 5400.0)
DATA = pathlib.Path(os.environ.get("THERMOCOMP_DATA", SOURCE.parent / "shared" / "data"))


def read(path):
    with open(path) as text:
        lines = [line for line in text if not line.startswith("#")]
    names = lines[0].strip().split(",")
    return dict(zip(names, np.array([line.split(",") for line in lines[1:]], dtype=float).T))


def low_pass(time_s, values, tau_s):
    out = np.empty_like(values)
    out[0] = values[0]
    share = -np.expm1(-np.diff(time_s) / tau_s)
    for i in range(1, len(values)):
        out[i] = out[i - 1] + share[i - 1] * (values[i] - out[i - 1])
    return out


class Run:
    """Columns of one run: rises of temperatures, signals, the residual of the base model."""

    def __init__(self, columns, model, begin=0, end=None):
        self.time_s = columns["time_s"]
        temps = sorted(n for n in columns if n.endswith("_degC"))
        signals = sorted(n for n in columns if n.endswith(("_rpm", "_mm_per_min", "_on")))
        self.temps = np.column_stack([columns[n] - columns[n][0] for n in temps])
        self.signals = np.column_stack([columns[n] / max(1e-9, np.ptp(columns[n]))
                                        for n in signals])
        self.model = {o: sum(k * (columns[n] - columns[n][0]) for k, n in zip(row, model["inputs"]))
                      for o, row in zip(model["outputs"], model["matrix_um_per_K"])}
        self.moved = {o: columns[o] - columns[o][0] for o in model["outputs"]}
        self.rows = slice(begin, end)
        both = np.hstack([self.temps, self.signals])
        self.lagged = np.hstack([both] + [np.column_stack(
            [low_pass(self.time_s, c, tau_s) for c in both.T]) for tau_s in LAGS_S])
        self.library = np.hstack([self.lagged, self.temps ** 2, self.signals ** 2])
        self.now = both

    def residual(self, output):
        return self.moved[output] - self.model[output]


def stacked(runs, columns, output):
    left = [getattr(r, columns)[r.rows] for r in runs]
    right = [r.residual(output)[r.rows] for r in runs]
    return np.vstack(left), np.concatenate(right)


def solve(left, right, ridge=1e-6):
    return np.linalg.solve(left.T @ left + ridge * len(left) * np.eye(left.shape[1]),
                           left.T @ right)


def refit(train, test, output):
    left, right = stacked(train, "temps", output)
    gain = solve(left, right)
    return [r.residual(output) - r.temps @ gain for r in test]


def arx(train, test, output):
    left, right = [], []
    for run in train:
        d = run.residual(output)[run.rows]
        now = run.now[run.rows]
        left.append(np.hstack([d[:-1, None], now[1:], now[:-1]]))
        right.append(d[1:])
    gain = solve(np.vstack(left), np.concatenate(right))
    out = []
    for run in test:
        measured = run.residual(output)
        state = np.zeros(len(measured))
        drive = run.now[1:] @ gain[1:1 + run.now.shape[1]] + run.now[:-1] @ gain[
            1 + run.now.shape[1]:]
        for i in range(1, len(state)):
            state[i] = np.clip(np.clip(gain[0], -1.0, 1.0) * state[i - 1] + drive[i - 1], -1e4, 1e4)
        out.append(measured - state)
    return out


def l1(square, right, price):
    """Coordinate descent on the normal equations."""
    gain = np.zeros(len(right))
    for _ in range(200):
        before = gain.copy()
        for j in range(len(right)):
            rest = right[j] - square[j] @ gain + square[j, j] * gain[j]
            gain[j] = np.sign(rest) * max(0.0, abs(rest) - price) / square[j, j]
        if np.max(np.abs(gain - before)) < 1e-4 * (np.max(np.abs(gain)) + 1e-12):
            break
    return gain


def folds(left, right, fit, choices):
    """The choice with the smallest error on left-out blocks."""
    edges = np.linspace(0, len(right), 6).astype(int)
    sums = []
    for choice in choices:
        total = 0.0
        for a, b in zip(edges, edges[1:]):
            keep = np.r_[0:a, b:len(right)]
            total += np.sum((right[a:b] - left[a:b] @ fit(left[keep], right[keep], choice)) ** 2)
        sums.append(total)
    return choices[int(np.argmin(sums))]


def penalised(fit, name, choices):
    def method(train, test, output):
        left, right = stacked(train, name, output)
        scale = np.maximum(left.std(axis=0), 1e-9)
        left = left / scale
        best = folds(left, right, fit, choices)
        gain = fit(left, right, best) / scale
        return [r.residual(output) - getattr(r, name) @ gain for r in test]
    return method


def lasso_fit(left, right, price):
    square = left.T @ left / len(left) + 1e-6 * np.eye(left.shape[1])
    return l1(square, left.T @ right / len(left), price * right.std())


def threshold_fit(left, right, threshold):
    keep = np.ones(left.shape[1], dtype=bool)
    gain = np.zeros(left.shape[1])
    for _ in range(10):
        gain[:] = 0.0
        if not keep.any():
            break
        gain[keep] = solve(left[:, keep], right, 1e-4)
        smaller = keep & (np.abs(gain) < threshold * right.std())
        if not smaller.any():
            break
        keep &= ~smaller
    return gain


METHODS = {"refit": refit, "arx": arx,
           "lasso": penalised(lasso_fit, "lagged", (0.3, 0.1, 0.03, 0.01)),
           "sparse": penalised(threshold_fit, "library", (0.5, 0.2, 0.1, 0.05))}


def rms(parts):
    values = np.concatenate(parts)
    return float(np.sqrt(np.nanmean(values ** 2)))


def table_of_cases(options):
    for level in [int(l) for l in options.levels.split(",")]:
        columns = {name: [] for name in ("model", "diagnose", *METHODS)}
        for i in range(options.cases):
            cause = hidden.ALWAYS[i % len(hidden.ALWAYS)]
            task = (options.program, options.keep, "single", level, 3000 + i, [cause])
            _, truth, answer = cases.examined(task, hidden.make)
            folder = pathlib.Path(options.keep) / f"{level}_{3000 + i}_{cause}"
            model = tomllib.loads((folder / "model.toml").read_text())
            train = [Run(read(folder / n), model) for n in ("train_a.csv", "train_b.csv")]
            test = [Run(read(folder / "test.csv"), model)]
            for output, oracle in truth["oracle_test_rms_um"].items():
                columns["model"].append(answer["baseline"][output]["test_rms_um"])
                columns["diagnose"].append(answer["extended"][output]["test_rms_um"])
                for name, method in METHODS.items():
                    columns[name].append(rms(method(train, test, output)))
        for name, values in columns.items():
            print(f"level{level}_{name}_median_test_rms {np.median(values):.3f} um")


def table_of_spindle(program):
    run = DATA / "spindle_46h" / "hours_00_32.csv"
    if not run.exists():
        print(f"no measured spindle: {run}", file=sys.stderr)
        return
    model_file = run.parent / "static_model.toml"
    model = tomllib.loads(model_file.read_text())
    said = subprocess.run([program, "diagnose", "--model", model_file, "--train", f"{run}@:86760",
                           "--test", f"{run}@86760:", "--json", "-"], capture_output=True,
                          text=True, check=True).stdout
    extended = json.loads(said)["extended"]
    columns = {n: c[::4] for n, c in read(run).items()}
    split = int(np.searchsorted(columns["time_s"], 86760.0))
    train, test = Run(columns, model, 0, split), Run(columns, model, split, None)
    for output in model["outputs"]:
        print(f"spindle_{output}_model {rms([test.residual(output)[split:]]):.3f} um")
        print(f"spindle_{output}_diagnose {extended[output]['test_rms_um']:.3f} um")
        for name, method in METHODS.items():
            left = method([train], [test], output)[0][split:]
            print(f"spindle_{output}_{name} {rms([left]):.3f} um")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--cases", type=int, default=39)
    parser.add_argument("--levels", default="1,2,3")
    parser.add_argument("--keep")
    options = parser.parse_args()
    options.program = str(pathlib.Path(options.program).resolve())
    with tempfile.TemporaryDirectory() as folder:
        options.keep = options.keep or folder
        table_of_spindle(options.program)
        table_of_cases(options)


if __name__ == "__main__":
    main()
