#!/usr/bin/python3
"""The searches of `thermocomp diagnose` over one run with one output, batched in numpy.

Every cause's grid of columns is built at once, whitened at once and solved at once, under the same
noise shapes; the same number of candidates is refined, one after another, and judged on eight blocks left out. Prints
the seconds of the grids alone and what it found. Argument: the folder of diagnose_data.py, and
the rounds of the search."""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

# ruff: noqa: E402
import pathlib
import sys
import time
import tomllib

import numpy as np

BLOCKS, SHORTLIST, POINTS = 8, 20, 6


def low_pass(values, taus_s, step_s):
    """values (rows, columns) or (rows,), taus (n) -> (rows, columns x n)"""
    values = values if values.ndim == 2 else values[:, None]
    share = -np.expm1(-step_s / np.asarray(taus_s))
    out = np.empty((len(values), values.shape[1], len(share)))
    state = np.repeat(values[0][:, None], len(share), axis=1)
    for i, row in enumerate(values):
        state += share * (row[:, None] - state)
        out[i] = state
    return out


def play(values, widths):
    """values (rows, columns), widths (columns, n)"""
    out = np.empty((len(values),) + widths.shape)
    state = np.repeat(values[0][:, None], widths.shape[1], axis=1)
    for i, row in enumerate(values):
        state = np.minimum(np.maximum(state, row[:, None] - widths / 2), row[:, None] + widths / 2)
        out[i] = state
    return out


def both_ways(values, taus_s, step_s):
    there = low_pass(values, taus_s, step_s)
    back = np.empty_like(there)
    for k, tau_s in enumerate(taus_s):
        back[:, :, k] = low_pass(there[::-1, :, k], [tau_s], step_s)[::-1, :, 0]
    return back


class Data:
    def __init__(self, folder):
        lines = (folder / "train.csv").read_text().splitlines()
        names = lines[0].split(",")
        table = np.array([line.split(",") for line in lines[1:]], dtype=float)
        column = {n: table[:, i] for i, n in enumerate(names)}
        model = tomllib.loads((folder / "model.toml").read_text())
        self.time_s = column["time_s"]
        self.step_s = float(np.median(np.diff(self.time_s)))
        self.k = np.array(model["matrix_um_per_K"][0])
        self.inputs = np.column_stack([column[n] - column[n][0] for n in model["inputs"]])
        self.others = np.column_stack([column[n] - column[n][0] for n in names
                                       if n.endswith("_degC") and n not in model["inputs"]])
        self.signals = np.column_stack([column[n] for n in names if n.endswith("_rpm")])
        self.x = column["x_mm"]
        self.model = self.inputs @ self.k
        self.residual = column["z_um"] - column["z_um"][0] - self.model


def causes(d):
    """(name, function of a shape's values and of subjects -> columns (rows, subjects, shapes),
    grid, number of subjects, has a gain)"""
    length_s = d.time_s[-1] - d.time_s[0]
    lags = np.geomspace(60.0, 14400.0, 20)
    width = np.ptp(d.inputs, axis=0)
    temps = np.hstack([d.inputs, d.others])
    heat = np.hstack([d.signals, d.signals ** 2])
    inputs, others, signals = d.inputs.shape[1], d.others.shape[1], d.signals.shape[1]
    shifts = np.geomspace(12.0, 3600.0, 14)
    first, second = np.triu_indices(inputs, 1)
    dt = d.step_s
    rise = lambda i: d.inputs[:, i]
    k = lambda i: d.k[i][:, None]
    after = lambda s: (d.time_s[:, None] >= length_s * np.asarray(s))[:, None, :]
    yield "wrong_coefficient", lambda s, i: rise(i)[:, :, None], [0.0], inputs, True
    yield ("thermal_lag", lambda s, i: low_pass(rise(i), s, dt) - rise(i)[:, :, None], lags, inputs,
           True)
    yield "nonlinear_expansion", lambda s, i: temps[:, i, None] ** 2, [0.0], inputs + others, True
    yield ("position_dependence", lambda s, i: (temps[:, i] * d.x[:, None])[:, :, None], [0.0],
           inputs + others, True)
    yield ("slow_sensor", lambda s, i: k(i) * np.asarray(s) * np.gradient(
        both_ways(rise(i), 0.25 * np.asarray(s), dt), dt, axis=0), np.geomspace(30.0, 3600.0, 16),
           inputs, False)
    yield ("hysteresis", lambda s, i: k(i) * (play(rise(i), width[i][:, None] * np.asarray(s))
                                              - rise(i)[:, :, None]), np.linspace(0.04, 0.8, 16),
           inputs, False)
    yield ("sensor_swap", lambda s, i: ((d.k[first[i]] - d.k[second[i]]) * (
        rise(second[i]) - rise(first[i])))[:, :, None], [0.0], len(first), False)
    yield ("missing_temperature", lambda s, i: low_pass(d.others[:, i], s, dt),
           np.r_[1e-3, np.geomspace(60.0, 21600.0, 20)], others, True)
    yield ("missing_heat_source", lambda s, i: low_pass(heat[:, i], s, dt),
           np.geomspace(120.0, 21600.0, 22), 2 * signals, True)
    yield "speed_growth", lambda s, i: d.signals[:, i, None] ** 2, [0.0], signals, True
    yield ("time_shift", lambda s, i: np.stack(
        [np.interp(d.time_s - v, d.time_s, d.model) - d.model for v in s], axis=1)[:, None, :],
           np.r_[-shifts[::-1], shifts], 1, False)
    yield ("hysteresis", lambda s, i: play(d.model[:, None], np.ptp(d.model) * np.asarray(s)[None])
           - d.model[:, None, None], np.linspace(0.03, 0.7, 20), 1, False)
    yield "displacement_step", lambda s, i: 1.0 * after(s), np.linspace(0.02, 0.98, 64), 1, True
    yield "displacement_drift", lambda s, i: d.time_s[:, None, None] / 3600.0, [0.0], 1, True
    yield "sensor_step", lambda s, i: -k(i) * after(s), np.linspace(0.02, 0.95, 64), inputs, True
    yield ("sensor_drift", lambda s, i: -k(i) * np.maximum(
        0.0, d.time_s[:, None] - length_s * np.asarray(s))[:, None, :] / 3600.0,
           np.linspace(0.0, 0.95, 24), inputs, True)
    yield ("sensor_loose", lambda s, i: (k(i) * rise(i)[:, :, None]) * after(s),
           np.linspace(0.03, 0.95, 48), inputs, True)


def periods(d):
    longest = (d.time_s[-1] - d.time_s[0]) / 5.0
    frequency, out = 1.0 / longest, []
    while frequency <= 1.0 / (5.0 * d.step_s) and len(out) < 400:
        out.append(1.0 / frequency)
        frequency += max(0.4 / (5.0 * longest), 0.004 * frequency)
    return np.array(out)


def whiten(columns, ratio, tau_s, step_s, starts):
    if not ratio:
        return columns
    out = np.empty_like(columns)
    keep = np.exp(-step_s / tau_s)
    variance = ratio
    state = np.zeros(columns.shape[1])
    for i, row in enumerate(columns):
        if i in starts:
            state[:] = 0.0
            variance = ratio
        else:
            state *= keep
            variance = ratio + keep * keep * (variance - ratio)
        innovation = row - state
        gain = variance / (variance + 1.0)
        out[i] = innovation / np.sqrt(variance + 1.0)
        state += gain * innovation
        variance *= 1.0 - gain
    return out


class Search:
    def __init__(self, d):
        self.d = d
        n = len(d.time_s)
        self.edges = [n * b // BLOCKS for b in range(BLOCKS + 1)]
        noise = np.median(np.abs(np.diff(d.residual, 2))) / (0.6745 * np.sqrt(6.0))
        size = d.residual.std()
        self.settings = [(0.0, 1.0)] + [((share * size / noise) ** 2, tau_s)
                                        for share in (0.1, 0.3, 1.0)
                                        for tau_s in (1200.0, 3600.0, 10800.0)]

    def white(self, columns, setting):
        return whiten(columns, *setting, self.d.step_s, set(self.edges[:-1]))

    def left(self, columns, residual, common, setting, has_gain):
        """Squares that are left with each column."""
        white = self.white(columns, setting)
        base = self.white(np.column_stack([common, residual]), setting)
        q, _ = np.linalg.qr(base[:, :-1])
        r = base[:, -1] - q @ (q.T @ base[:, -1])
        right = white.T @ r
        square = np.einsum("ij,ij->j", white, white) - np.sum((q.T @ white) ** 2, axis=0)
        gain = right / np.maximum(square, 1e-12) if has_gain else np.ones(len(right))
        return r @ r - 2.0 * gain * right + gain ** 2 * square

    def profile(self, residual, common, setting):
        found = []
        for name, make, grid, subjects, has_gain in causes(self.d):
            columns = make(grid, np.arange(subjects))
            shape = columns.shape
            left = self.left(columns.reshape(shape[0], -1), residual, common, setting,
                             has_gain).reshape(shape[1:])
            best = np.argmin(left, axis=1)
            for subject, at in enumerate(best):
                found.append((left[subject, at], name, subject, at, make, grid, has_gain))
        turn = 2 * np.pi * self.d.time_s[:, None] / periods(self.d)
        pairs = self.white(np.hstack([np.sin(turn), np.cos(turn)]), setting)
        base = self.white(np.column_stack([common, residual]), setting)
        r = base[:, -1] - base[:, :-1] @ np.linalg.lstsq(base[:, :-1], base[:, -1], rcond=None)[0]
        found.append((r @ r - np.max(np.sum((pairs.T @ r).reshape(2, -1) ** 2, axis=0)) /
                      (0.5 * len(r)), "periodic_disturbance", 0, 0, None, None, True))
        found.sort(key=lambda each: each[0])
        return found[:SHORTLIST]

    def settle(self, candidate, residual, common):
        """Refined between grid points, under the noise that suits it best, twice over."""
        _, _, subject, at, make, grid, has_gain = candidate
        if make is None:
            return 0.0
        value = grid[at]
        setting = self.settings[0]
        for _ in range(3):
            low, high = grid[max(0, at - 1)], grid[min(len(grid) - 1, at + 1)]
            for _ in range(4 if len(grid) > 1 else 0):
                values = np.linspace(low, high, POINTS + 2)[1:-1]
                left = self.left(make(values, np.array([subject]))[:, 0, :], residual, common, setting, has_gain)
                value = values[np.argmin(left)]
                step = (high - low) / (POINTS + 1)
                low, high = max(low, value - step), min(high, value + step)
            column = make([value], np.array([subject]))[:, 0, :]
            setting = min(self.settings, key=lambda s: self.left(column, residual, common, s,
                                                                 has_gain)[0])
        return self.left_out(candidate, residual, common, setting)

    def left_out(self, candidate, residual, common, setting):
        """Squares of left-out rows, shape and gain from the others."""
        _, _, subject, at, make, grid, has_gain = candidate
        near = grid if len(grid) <= 40 else grid[max(0, at - 3):at + 4]
        raw = make(near, np.array([subject]))[:, 0, :]
        white = self.white(np.column_stack([common, raw, residual]), setting)
        m, total = common.shape[1], 0.0
        grams = [white[a:b].T @ white[a:b] for a, b in zip(self.edges, self.edges[1:])]
        whole = sum(grams)
        for (a, b), gram in zip(zip(self.edges, self.edges[1:]), grams):
            rest = whole - gram
            carried = np.linalg.lstsq(rest[:m, :m], rest[:m, m:], rcond=None)[0]
            reduced = rest[m:, m:] - rest[m:, :m] @ carried
            square, right = np.diag(reduced)[:-1], reduced[:-1, -1]
            gain = right / np.maximum(square, 1e-12) if has_gain else np.ones(len(right))
            best = np.argmin(reduced[-1, -1] - 2 * gain * right + gain ** 2 * square)
            left = residual - raw[:, best] * gain[best]
            outside = np.r_[left[:a], left[b:]].mean()
            total += np.sum((left[a:b] - outside) ** 2)
        return total

    def run(self, rounds):
        common = np.ones((len(self.d.time_s), 1))
        names = []
        self.profile_s = 0.0
        for _ in range(rounds):
            start = time.process_time()
            candidates = self.profile(self.d.residual, common, self.settings[0])
            candidates += self.profile(self.d.residual, common, self.settings[5])
            self.profile_s += time.process_time() - start
            scored = [(self.settle(c, self.d.residual, common), c) for c in candidates
                      if c[4] is not None]
            _, best = min(scored, key=lambda each: each[0])
            names.append((best[1], best[2], float(best[5][best[3]])))
            common = np.column_stack([common, best[4]([best[5][best[3]]], np.array([best[2]]))[:, 0, 0]])
        return names


def main():
    search = Search(Data(pathlib.Path(sys.argv[1])))
    names = search.run(int(sys.argv[2]))
    print(search.profile_s, *names[0])


if __name__ == "__main__":
    main()
