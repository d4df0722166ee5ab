"""The columns of every cause of `thermocomp diagnose`, batched: one call makes the columns of many
subjects and shapes side by side. For one run of evenly spaced rows and one output."""

import dataclasses
from typing import Callable

import numpy as np

from diagnose_numpy_data import smoothed

SPECIAL_CASE = 20.0  # what contains a simpler cause pays this


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
    scale: np.ndarray = None  # one a subject, whose columns are otherwise alike
    one_run: bool = False     # a fault of one run
    sensor: bool = False      # ... and of one reading, which is a witness
    possible: Callable = None  # (subject, gain) -> bool
    number: int = 0            # its place among all

    def unscaled(self, subject, shape, power):
        """(rows, n, width)"""
        made = self.make(subject, shape, power)
        return made.reshape(len(made), -1, self.width)

    def columns(self, subject, shape, power):
        made = self.unscaled(subject, shape, power)
        return made if self.scale is None else made * self.scale[subject, None]

    def twins(self):
        """Subjects of which one output cannot say which it is"""
        return np.flatnonzero(self.scale)

    def grid_of(self, subject):
        return self.grid[subject] if self.grid.ndim == 2 else self.grid

    def points(self, subject):
        """(shape, power) of every grid point"""
        grid = self.grid_of(subject)
        return np.repeat(grid, len(self.powers)), np.tile(self.powers, len(grid))

    def all_points(self):
        """subject, shape and power of every grid point of all subjects"""
        n, powers = len(self.subjects), len(self.powers)
        grid = np.broadcast_to(self.grid, (n, self.grid.shape[-1]))
        return (np.repeat(np.arange(n), grid.shape[1] * powers), np.repeat(grid.ravel(), powers),
                np.tile(self.powers, grid.size))


def pairs(*columns):
    """(rows, n) each -> (rows, n x len(columns)), what belongs together side by side"""
    return np.stack(columns, axis=2).reshape(len(columns[0]), -1)


def linear(low, high, count):
    return low + (high - low) * np.arange(count) / (count - 1)


def geometric(low, high, count):
    return low * (high / low) ** (np.arange(count) / (count - 1))


def always_acting(d):
    dt, steps, inputs, others = d.step_s, d.steps_s, d.input_names, d.other_names
    low_pass, play = d.batching.low_pass, d.batching.play
    temps, inputs_K, k = d.calm_temps, d.calm_inputs, d.k
    others_K = temps[:, len(inputs):]
    rpm = np.array([n.endswith("_rpm") for n in d.signal_names])
    speeds, rpm_names = d.signals[:, rpm], [n for n, is_rpm in zip(d.signal_names, rpm) if is_rpm]
    x = d.signals[:, ~rpm][:, :1]
    first, second = np.triu_indices(len(inputs), 1)
    span = np.ptp(d.inputs, axis=0)[:, None]

    def slow(i, s, _):
        late = smoothed(d.batching, d.inputs.take(i, axis=1), 0.25 * s, steps)
        return k[i] * s * np.gradient(late, d.time_s, axis=0)

    def lag(i, s, _):
        now = inputs_K.take(i, axis=1)
        return low_pass(now, s, steps) - now

    def loose_joint(i, s, _):
        now = inputs_K.take(i, axis=1)
        return k[i] * (play(now, s) - now)

    def along(i, _, __):
        now = temps.take(i, axis=1)
        return pairs(x * now, now)

    def swap(i, _, __):
        a, b = first[i], second[i]
        return (k[a] - k[b]) * (inputs_K.take(b, axis=1) - inputs_K.take(a, axis=1))

    powers = pairs(speeds, speeds ** 2)
    yield Cause("wrong_coefficient", inputs, "own", lambda i, s, p: inputs_K.take(i, axis=1))
    yield Cause("thermal_lag", inputs, "own", lag,
                geometric(max(60.0, 0.5 * dt), 14400.0, 20), refined="logarithmic",
                possible=lambda i, gain: (gain / k[i] > 0) & (gain / k[i] <= 1.1))
    yield Cause("nonlinear_expansion", inputs + others, "own",
                lambda i, s, p: temps.take(i, axis=1) ** 2)
    yield Cause("position_dependence", [n + "|x_mm" for n in inputs + others], "own", along,
                width=2, handicap=SPECIAL_CASE)
    yield Cause("slow_sensor", inputs, "none", slow, geometric(max(20.0, 0.5 * dt), 3600.0, 16),
                refined="logarithmic")
    yield Cause("hysteresis", inputs, "none", loose_joint,
                linear(0.04 * span, 0.8 * span, 16), refined="linear")
    yield Cause("sensor_swap", [inputs[a] + "|" + inputs[b] for a, b in zip(first, second)], "none",
                swap)
    yield Cause("missing_temperature", others, "own",
                lambda i, s, p: low_pass(others_K.take(i, axis=1), s, steps),
                np.r_[0.0, geometric(60.0, 21600.0, 20)], refined="logarithmic")
    yield Cause("missing_heat_source", rpm_names, "own",
                lambda i, s, p: low_pass(powers.take(2 * i + (p > 1.5), axis=1), s,
                                            steps),
                geometric(120.0, 21600.0, 22), powers=(1.0, 2.0), refined="logarithmic")
    yield Cause("speed_growth", rpm_names, "own", lambda i, s, p: speeds[:, i] ** 2)


def of_the_output(d):
    dt = d.step_s
    model = d.calm_model
    smooth = smoothed(d.batching, d.model[:, None], np.array([2.0 * dt]), d.steps_s)[:, 0]
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
                lambda i, s, p: d.batching.play(model.repeat(len(s), axis=1), s) - model,
                np.ptp(d.model) * linear(0.03, 0.7, 20), refined="linear")
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
    yield Cause("sensor_step", d.input_names, make=lambda i, s, p: 1.0 * (time_s >= s),
                grid=onsets(0.02, 0.95, 64), scale=-d.k, **sensor)
    yield Cause("sensor_drift", d.input_names,
                make=lambda i, s, p: np.maximum((time_s - s) / 3600.0, 0.0),
                grid=onsets(0.0, 0.95, 24), scale=-d.k, **sensor)
    # No reading is named a room's: a loose sensor falls back to where it began.
    lost = d.k * d.inputs
    yield Cause("sensor_loose", d.input_names,
                make=lambda i, s, p: lost.take(i, axis=1) * (time_s >= s),
                grid=onsets(0.03, 0.95, 48), **sensor,
                possible=lambda i, lost: (lost > 0.02) & (lost < 20.0))


def all_causes(d):
    causes = [*always_acting(d), *of_the_output(d), *faults(d)]
    for number, cause in enumerate(causes):
        cause.number = number
    return causes
