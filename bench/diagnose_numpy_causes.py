"""The columns of every cause of `thermocomp diagnose`, batched: one call makes the columns of many
subjects and shapes side by side. For one run of evenly spaced rows and one output.

Recursions over time are cut into as many stretches as each has rows. All stretches advance together,
and what one hands on to the next is added after: a low pass forgets by a factor, and play is a
clipping, of which two in a row are one. So 1440 rows take 76 steps of numpy instead of 1440."""

import dataclasses
import math
import pathlib
import tomllib
from typing import Callable

import numpy as np

SPECIAL_CASE = 20.0  # what contains a simpler cause pays this


def stretches(values):
    """(rows, n) -> (m, m, n), the last row repeated to fill"""
    m = math.isqrt(len(values) - 1) + 1
    fill = np.broadcast_to(values[-1], (m * m - len(values), values.shape[1]))
    return np.concatenate([values, fill]).reshape(m, m, -1)


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
    low = stretches(values - 0.5 * widths)
    high = stretches(values + 0.5 * widths)
    for k in range(1, low.shape[1]):
        bottom, top = low[:, k].copy(), high[:, k].copy()
        np.clip(low[:, k - 1], bottom, top, out=low[:, k])
        np.clip(high[:, k - 1], bottom, top, out=high[:, k])
    for bottom, top in zip(low, high):
        np.clip(state, bottom, top, out=bottom)
        state = bottom[-1]
    return low.reshape(-1, low.shape[2])[:rows]


def smoothed(values, taus_s, step_s):
    there = low_pass(values, taus_s, step_s)
    return low_pass(there[::-1], taus_s, step_s)[::-1]


class Data:
    """The training run and the model of diagnose_data.py."""

    def __init__(self, folder):
        folder = pathlib.Path(folder)
        with open(folder / "train.csv") as file:
            names = file.readline().strip().split(",")
            table = np.array([line.split(",") for line in file], dtype=float)
        column = {name: table[:, i] for i, name in enumerate(names)}
        model = tomllib.loads((folder / "model.toml").read_text())
        self.time_s = column["time_s"]
        self.step_s = float(np.median(np.diff(self.time_s)))
        self.input_names = model["inputs"]
        self.other_names = [n for n in names if n.endswith("_degC") and n not in self.input_names]
        self.signal_names = [n for n in names if n.endswith(("_rpm", "_mm"))]
        self.k = np.array(model["matrix_um_per_K"][0])
        rises = lambda of: np.column_stack([column[n] - column[n][0] for n in of])
        self.inputs, self.others = rises(self.input_names), rises(self.other_names)
        self.signals = np.column_stack([column[n] for n in self.signal_names])
        self.model = self.inputs @ self.k
        self.measured = column["z_um"] - column["z_um"][0]
        self.residual = self.measured - self.model


@dataclasses.dataclass
class Cause:
    """One kind of hypothesis with all its subjects."""
    name: str
    subjects: list
    form: str                 # "own", "shared" or "none": how gains are found
    make: Callable            # (subject (n), shape (n), power (n)) -> (rows, n x width)
    grid: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(1))  # or one a subject
    powers: tuple = (1.0,)    # a second, discrete parameter
    refined: str = ""         # "linear" or "logarithmic": how the shape is sought between points
    width: int = 1
    handicap: float = 0.0
    one_run: bool = False     # a fault of one run
    sensor: bool = False      # ... and of one reading, which is a witness
    possible: Callable = None  # (subject, gain) -> bool

    def points(self, subject):
        """(shape, power) of every grid point"""
        grid = self.grid[subject] if self.grid.ndim == 2 else self.grid
        return (np.repeat(grid, len(self.powers)), np.tile(self.powers, len(grid)))


def pairs(*columns):
    """(rows, n) each -> (rows, n x len(columns)), what belongs together side by side"""
    return np.stack(columns, axis=2).reshape(len(columns[0]), -1)


def linear(low, high, count):
    return low + (high - low) * np.arange(count) / (count - 1)


def geometric(low, high, count):
    return low * (high / low) ** (np.arange(count) / (count - 1))


def always_acting(d):
    dt, inputs, others = d.step_s, d.input_names, d.other_names
    temps, k = np.hstack([d.inputs, d.others]), d.k
    rpm = np.array([n.endswith("_rpm") for n in d.signal_names])
    speeds, rpm_names = d.signals[:, rpm], [n for n, is_rpm in zip(d.signal_names, rpm) if is_rpm]
    x = d.signals[:, ~rpm][:, :1]
    first, second = np.triu_indices(len(inputs), 1)
    span = np.ptp(d.inputs, axis=0)[:, None]

    def slow(i, s, _):
        late = smoothed(d.inputs[:, i], 0.25 * s, dt)
        return k[i] * s * np.gradient(late, dt, axis=0)

    yield Cause("wrong_coefficient", inputs, "own", lambda i, s, p: d.inputs[:, i])
    yield Cause("thermal_lag", inputs, "own",
                lambda i, s, p: low_pass(d.inputs[:, i], s, dt) - d.inputs[:, i],
                geometric(max(60.0, 0.5 * dt), 14400.0, 20), refined="logarithmic",
                possible=lambda i, gain: (gain / k[i] > 0) & (gain / k[i] <= 1.1))
    yield Cause("nonlinear_expansion", inputs + others, "own", lambda i, s, p: temps[:, i] ** 2)
    yield Cause("position_dependence", [n + "|x_mm" for n in inputs + others], "own",
                lambda i, s, p: pairs(x * temps[:, i], temps[:, i]), width=2, handicap=SPECIAL_CASE)
    yield Cause("slow_sensor", inputs, "none", slow, geometric(max(20.0, 0.5 * dt), 3600.0, 16),
                refined="logarithmic")
    yield Cause("hysteresis", inputs, "none",
                lambda i, s, p: k[i] * (play(d.inputs[:, i], s) - d.inputs[:, i]),
                linear(0.04 * span, 0.8 * span, 16), refined="linear")
    yield Cause("sensor_swap", [inputs[a] + "|" + inputs[b] for a, b in zip(first, second)], "none",
                lambda i, s, p: (k[first[i]] - k[second[i]]) *
                (d.inputs[:, second[i]] - d.inputs[:, first[i]]))
    yield Cause("missing_temperature", others, "own",
                lambda i, s, p: low_pass(d.others[:, i], s, dt),
                np.r_[0.0, geometric(60.0, 21600.0, 20)], refined="logarithmic")
    yield Cause("missing_heat_source", rpm_names, "own",
                lambda i, s, p: low_pass(speeds[:, i] ** p, s, dt), geometric(120.0, 21600.0, 22),
                powers=(1.0, 2.0), refined="logarithmic")
    yield Cause("speed_growth", rpm_names, "own", lambda i, s, p: speeds[:, i] ** 2)


def of_the_output(d):
    dt = d.step_s
    model = d.model[:, None]
    smooth = smoothed(model, np.array([2.0 * dt]), dt)[:, 0]
    late = geometric(max(5.0, 0.2 * dt), 3600.0, 14)
    length_s = d.time_s[-1] - d.time_s[0]
    periods, frequency = [], 5.0 / length_s
    while frequency <= 1.0 / (5.0 * dt) and len(periods) < 400:
        periods.append(1.0 / frequency)
        frequency += max(0.4 / length_s, 0.004 * frequency)

    def shifted(_, s, __):
        return np.stack([np.interp(d.time_s - v, d.time_s, smooth) - smooth for v in s], axis=1)

    def wave(_, s, __):
        turns = 2 * np.pi / s * d.time_s[:, None]
        return pairs(np.sin(turns), np.cos(turns))

    yield Cause("hysteresis", ["z_um"], "none",
                lambda i, s, p: play(model[:, 0 * i], s) - model, np.ptp(d.model) *
                linear(0.03, 0.7, 20), refined="linear")
    yield Cause("time_shift", ["z_um"], "none", shifted, np.r_[-late[::-1], late], refined="linear")
    yield Cause("periodic_disturbance", ["z_um"], "own", wave, np.array(periods),
                refined="logarithmic", width=2)


def faults(d):
    time_s, begin_s = d.time_s[:, None], d.time_s[0]
    span_s = d.time_s[-1] - begin_s
    onsets = lambda first, last, count: linear(begin_s + first * span_s, begin_s + last * span_s,
                                               count)
    sensor = dict(form="shared", refined="linear", handicap=SPECIAL_CASE, one_run=True, sensor=True)
    yield Cause("displacement_step", ["z_um"], "own", lambda i, s, p: 1.0 * (time_s >= s),
                onsets(0.02, 0.98, 64), refined="linear", one_run=True)
    yield Cause("displacement_drift", ["z_um"], "own",
                lambda i, s, p: (time_s - begin_s + 0.0 * s) / 3600.0, one_run=True)
    yield Cause("sensor_step", d.input_names, make=lambda i, s, p: -d.k[i] * (time_s >= s),
                grid=onsets(0.02, 0.95, 64), **sensor)
    yield Cause("sensor_drift", d.input_names,
                make=lambda i, s, p: -d.k[i] * np.maximum((time_s - s) / 3600.0, 0.0),
                grid=onsets(0.0, 0.95, 24), **sensor)
    # No reading is named a room's: a loose sensor falls back to where it began.
    yield Cause("sensor_loose", d.input_names,
                make=lambda i, s, p: d.k[i] * d.inputs[:, i] * (time_s >= s),
                grid=onsets(0.03, 0.95, 48), **sensor,
                possible=lambda i, lost: (lost > 0.02) & (lost < 20.0))


def all_causes(d):
    return [*always_acting(d), *of_the_output(d), *faults(d)]
