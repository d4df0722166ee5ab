"""The runs of diagnose_data.py for diagnose_numpy.py: reading them, their columns through filters.

Recursions over time are cut into as many stretches as each has rows. All stretches advance
together, and what one hands on to the next is added after: a low pass forgets by a factor, and play
is a clipping, of which two in a row are one. So 1440 rows take 76 steps of numpy, not 1440."""

import functools
import math
import tomllib

import numpy as np

COEFFICIENT_SD = 0.03  # of each coefficient, as a share of it
SEEN_MIN, NOISE_UM_MIN = 0.1, 1e-3


def stretches(values):
    """(rows, n) -> (m, m, n), the last row repeated to fill"""
    m = math.isqrt(len(values) - 1) + 1
    out = np.empty((m * m, values.shape[1]))
    out[:len(values)] = values
    out[len(values):] = values[-1]
    return out.reshape(m, m, -1)


def low_pass(values, taus_s, step_s):
    """values (rows, n), taus_s (n); 0 passes the values on"""
    rows, first = len(values), values[0]
    share = -np.expm1(-step_s / np.maximum(taus_s, 1e-300))
    keep = 1.0 - share
    out = stretches(values)
    out *= share
    for k in range(1, out.shape[1]):
        out[:, k] += keep * out[:, k - 1]
    fades = np.cumprod(np.broadcast_to(keep, (out.shape[1], len(share))), axis=0)
    state = first
    for stretch in out:
        stretch += fades * state
        state = stretch[-1]
    return out.reshape(-1, len(share))[:rows]


def play(values, widths):
    """values (rows, n), widths (n)"""
    rows, state = len(values), values[0]
    low = stretches(values)
    high = low + 0.5 * widths
    low -= 0.5 * widths
    for k in range(1, low.shape[1]):
        bottom, top = low[:, k].copy(), high[:, k].copy()
        for bound in (low, high):
            np.maximum(bound[:, k - 1], bottom, out=bound[:, k])
            np.minimum(bound[:, k], top, out=bound[:, k])
    for bottom, top in zip(low, high):
        np.maximum(state, bottom, out=bottom)
        np.minimum(bottom, top, out=bottom)
        state = bottom[-1]
    return low.reshape(-1, low.shape[2])[:rows]


def smoothed(values, taus_s, step_s):
    there = low_pass(values, taus_s, step_s)
    return low_pass(there[::-1], taus_s, step_s)[::-1]


def calm(values):
    """Every column smoothed over as many rows (0, 1, 2, 4, 8) as predict a row left out best."""
    over = np.array([1.0, 2.0, 4.0, 8.0])
    smooth = smoothed(np.repeat(values, len(over), axis=1), np.tile(over, values.shape[1]), 1.0)
    smooth = smooth.reshape(*values.shape, len(over))
    share = -np.expm1(-1.0 / over)
    left = (values[:, :, None] - smooth)[1:-1] / (1.0 - share / (2.0 - share))
    none = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    squares = np.column_stack([np.sum(none ** 2, axis=0), np.sum(left ** 2, axis=0)])
    choices = np.concatenate([values[:, :, None], smooth], axis=2)
    return choices[:, np.arange(values.shape[1]), np.argmin(squares, axis=1)]


class Data:
    """One run and the model."""

    def __init__(self, folder, run, for_search):
        self.for_search = for_search  # test rows are taken as they are
        with open(folder / run) as file:
            names = file.readline().strip().split(",")
            table = np.loadtxt(file, delimiter=",")
        column = {name: table[:, i] for i, name in enumerate(names)}
        model = tomllib.loads((folder / "model.toml").read_text())
        self.time_s = column["time_s"]
        self.step_s = float(np.median(np.diff(self.time_s)))
        self.input_names = model["inputs"]
        inputs = set(self.input_names)
        self.other_names = [n for n in names if n.endswith("_degC") and n not in inputs]
        self.signal_names = [n for n in names if n.endswith(("_rpm", "_mm"))]
        self.k = np.array(model["matrix_um_per_K"][0])
        self.temps = np.column_stack([column[n] - column[n][0]
                                      for n in self.input_names + self.other_names])
        self.inputs = self.temps[:, :len(self.k)]
        self.signals = np.column_stack([column[n] for n in self.signal_names])
        self.model = self.inputs @ self.k
        self.measured = column["z_um"] - column["z_um"][0]
        self.residual = self.measured - self.model

    @functools.cached_property
    def noise_um(self):
        """Of a single value."""
        second = np.abs(np.diff(self.residual, 2))
        middle = np.partition(second, len(second) // 2)[len(second) // 2]
        return max(NOISE_UM_MIN, middle / (0.6745 * np.sqrt(6.0)))

    @functools.cached_property
    def calm_temps(self):
        return self._calm[:, :-1]

    @functools.cached_property
    def calm_inputs(self):
        return np.ascontiguousarray(self._calm[:, :len(self.k)])

    @functools.cached_property
    def calm_model(self):
        return self._calm[:, -1:]

    @functools.cached_property
    def _calm(self):
        every = np.column_stack([self.temps, self.model])
        return calm(every) if self.for_search else every

    @functools.cached_property
    def coefficient_columns(self):
        """What errors of the coefficients add: principal columns, one standard deviation each."""
        every = COEFFICIENT_SD * self.k * self.calm_inputs
        squares, directions = np.linalg.eigh(every.T @ every)
        return every @ directions[:, squares > SEEN_MIN * self.noise_um ** 2]
