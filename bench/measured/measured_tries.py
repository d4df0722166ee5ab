"""Ways to settle a bank of lags, side by side on the splits of measured data: test RMS in um, mean
over outputs (docs/measurements.md, "What was tried for the bank").

    measured_tries.py [--data FOLDER] [--splits TEXT] [--evidence]

Columns as those of `thermocomp fit`, but for its hinges: every temperature, signal and square of a
signal, each at low passes by a ratio of three up to half of the longest run, divided by the
geometric mean of their own standard deviation and the usual one where nothing else is said. Nothing is chosen by test rows. The penalties p of a ridge regression are shares of the mean square
of a column, prices p of L1 regression shares of its correlation with the output.
"""

import argparse
import os
import pathlib
import sys

os.environ["OPENBLAS_NUM_THREADS"] = "1"

# ruff: noqa: E402
import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize, nnls

import measured_data as data
from measured_peers import blocks_of

ROWS_OF_EVIDENCE = 300
LAGS_MAX = 6
PENALTIES = (1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
SETTLED = (1e-2, 3e-3, 1e-3)


def low_passes_s(split):
    longest_s, steps = 0.0, []
    for run in split.train:
        time_s = run.columns["time_s"]
        time_s = time_s[time_s < run.to_s]
        longest_s = max(longest_s, time_s[-1] - time_s[0])
        steps.append(np.diff(time_s))
    taus, tau_s = [0.0], max(300.0, 2 * np.median(np.concatenate(steps)))
    while tau_s <= longest_s / 2 and len(taus) < LAGS_MAX:
        taus.append(tau_s)
        tau_s *= 3
    return taus


class Problem:
    """Equations of a split in scaled columns; some blocks of rows left out, a free level or not.

    @param own  what a column is divided by: its own standard deviation to this power times the
                usual one, of the temperatures or of the signal, to the rest of 1
    """

    def __init__(self, split, own=0.5):
        taus = low_passes_s(split)
        train = data.Table(split.train, split.outputs, taus, True)
        test = data.Table(split.test, split.outputs, taus, True)
        self.x, self.y = train.stacked()
        self.at, self.truth = test.stacked()
        whole = np.isfinite(self.y).all(axis=1)
        self.x, self.y = self.x[whole], self.y[whole]
        deviation = self.x.std(axis=0)
        moves = deviation > 1e-9 * np.abs(self.x).max()
        subjects = len(moves) // len(taus)
        places = len(train.temperatures)
        usual = np.tile(deviation[:subjects], len(taus))
        usual[np.arange(len(moves)) % subjects < places] = np.sqrt(
            np.mean(deviation[:places] ** 2))
        self.scale = (deviation ** own * usual ** (1 - own))[moves]
        self.x, self.at = self.x[:, moves] / self.scale, self.at[:, moves] / self.scale
        parts = [out[np.isfinite(out).all(axis=1)] for out in train.y]
        self.run = np.concatenate([np.full(len(p), i) for i, p in enumerate(parts)])
        self.blocks = blocks_of(parts)
        self.subject = np.arange(len(moves))[moves] % subjects

    def equations(self, left_out=(), free_level=False):
        keep = np.ones(len(self.y), bool)
        keep[np.asarray(left_out, int)] = False
        x, y = self.x[keep].copy(), self.y[keep].copy()
        for run in np.unique(self.run) if free_level else ():
            own = self.run[keep] == run
            x[own] -= x[own].mean(axis=0)
            y[own] -= y[own].mean(axis=0)
        return x.T @ x / len(x), x.T @ y / len(x), np.sqrt(np.mean(y ** 2, axis=0))

    def left(self, gains):
        error = self.truth - self.at @ gains
        return float(np.mean(np.sqrt(np.nanmean(error ** 2, axis=0))))


def ridge(equations, penalty):
    xx, xy, _ = equations
    return np.linalg.solve(xx + penalty * np.eye(len(xx)), xy)


def sparse(equations, price):
    """L1 regression, coordinate by coordinate."""
    xx, xy, size = equations
    gains = np.zeros_like(xy)
    for output in range(xy.shape[1]):
        gain, rest = np.zeros(len(xx)), xy[:, output] / size[output]
        for _ in range(300):
            moved = 0.0
            for j in np.flatnonzero(np.diag(xx) > 1e-12):
                pull = rest[j] + xx[j, j] * gain[j]
                new = np.sign(pull) * max(abs(pull) - price, 0.0) / xx[j, j]
                if new != gain[j]:
                    rest = rest - (new - gain[j]) * xx[:, j]
                    moved, gain[j] = max(moved, abs(new - gain[j])), new
            if moved < 1e-4:
                break
        gains[:, output] = gain * size[output]
    return gains


def one_sign(problem, equations, penalty):
    """Ridge regression in which all lags of a subject have the sign of its sum, as 0 < g/K <= 1."""
    xx, xy, _ = equations
    free = ridge(equations, penalty)
    factor = np.linalg.cholesky(xx + penalty * np.eye(len(xx)))
    gains = np.zeros_like(xy)
    for output in range(xy.shape[1]):
        sums = np.bincount(problem.subject, free[:, output] / problem.scale)
        signs = np.where(sums[problem.subject] >= 0, 1.0, -1.0)
        right = np.linalg.solve(factor, xy[:, output])
        gains[:, output] = signs * nnls(factor.T * signs, right, maxiter=50 * len(xx))[0]
    return gains


def by_evidence(problem):
    """Gains of a Gaussian prior whose size, with those of white noise, of noise of an hour and of a
    level of each run, has the largest marginal likelihood."""
    some = np.unique(np.linspace(0, len(problem.y) - 1, ROWS_OF_EVIDENCE).astype(int))
    x, run = problem.x[some], problem.run[some]
    same = (run[:, None] == run[None, :]).astype(float)
    near = same * np.exp(-np.abs(some[:, None] - some[None, :]) / (0.04 * len(problem.y)))
    kernels = [x @ x.T, np.eye(len(some)), near, same]
    gains = np.zeros((x.shape[1], problem.y.shape[1]))
    for output in range(gains.shape[1]):
        size = np.sqrt(np.mean(problem.y[:, output] ** 2))
        y = problem.y[some, output] / size

        def cost(logs, y=y):
            factor = cho_factor(sum(np.exp(2 * s) * k for s, k in zip(logs, kernels)) +
                                1e-9 * np.eye(len(y)), lower=True)
            return 0.5 * y @ cho_solve(factor, y) + np.sum(np.log(np.diag(factor[0])))

        logs = minimize(cost, np.log([0.1, 0.03, 0.1, 0.03]), method="L-BFGS-B",
                        bounds=[(-9, 3)] * 4, options={"maxiter": 30}).x
        whole = sum(np.exp(2 * s) * k for s, k in zip(logs, kernels))
        weights = np.linalg.solve(whole + 1e-9 * np.eye(len(y)), y)
        gains[:, output] = size * np.exp(2 * logs[0]) * (x.T @ weights)
    return gains


def ridge_and_l1_of_records(problem):
    lacking = [problem.equations(block) for block in problem.blocks]
    whole = problem.equations()
    return np.mean([ridge(whole, p) for p in SETTLED] +
                   [np.mean([sparse(each, p) for each in lacking], axis=0) for p in SETTLED],
                   axis=0)


def tries(problem, with_evidence):
    whole = problem.equations()
    lacking = [problem.equations(block) for block in problem.blocks]
    result = {f"ridge {p:g}": ridge(whole, p) for p in PENALTIES}
    result |= {f"L1 {p:g}": sparse(whole, p) for p in SETTLED}
    bagged = {p: np.mean([sparse(each, p) for each in lacking], axis=0) for p in SETTLED}
    result |= {f"L1 {p:g}, mean of records": gains for p, gains in bagged.items()}
    result |= {f"ridge {p:g}, one sign a subject": one_sign(problem, whole, p) for p in SETTLED}
    level = problem.equations(free_level=True)
    result |= {f"ridge {p:g}, free level": ridge(level, p) for p in SETTLED}
    result["mean of ridge and L1"] = np.mean(
        [result[f"{kind} {p:g}"] for kind in ("ridge", "L1") for p in SETTLED], axis=0)
    result["mean of ridge and L1 of records"] = ridge_and_l1_of_records(problem)
    result["those and one sign"] = np.mean(
        [result[f"ridge {p:g}"] for p in SETTLED] + list(bagged.values()) +
        [result[f"ridge {p:g}, one sign a subject"] for p in SETTLED], axis=0)
    if with_evidence:
        result["marginal likelihood"] = by_evidence(problem)
    return result


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--data", type=pathlib.Path, default=os.environ.get(
        "THERMOCOMP_DATA",
        pathlib.Path(__file__).resolve().parents[3] / "shared" / "data"))
    parser.add_argument("--splits", default="")
    parser.add_argument("--evidence", action="store_true")
    options = parser.parse_args()
    table, names = {}, []
    for split in data.all_splits(pathlib.Path(options.data)):
        if options.splits not in split.name:
            continue
        names.append(split.name)
        problem = Problem(split)
        for what, gains in tries(problem, options.evidence).items():
            table.setdefault(what, []).append(problem.left(gains))
        for own, what in ((1.0, "the same, scaled to a deviation of 1"),
                          (0.0, "the same, scaled alike per kelvin")):
            other = Problem(split, own)
            table.setdefault(what, []).append(other.left(ridge_and_l1_of_records(other)))
    print("  ".join(names))
    for what, row in table.items():
        print(f"{what:36}" + " ".join(f"{value:7.2f}" for value in row))
    return 0


if __name__ == "__main__":
    sys.exit(main())
