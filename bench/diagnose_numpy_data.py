"""The runs of diagnose_data.py for diagnose_numpy.py: reading them, calming them of their noise."""

import functools
import tomllib

import numpy as np

COEFFICIENT_SD = 0.03  # of each coefficient, as a share of it
SEEN_MIN, NOISE_UM_MIN = 0.1, 1e-3


def smoothed(batching, values, taus_s, steps_s):
    there = batching.low_pass(values, taus_s, steps_s)
    return batching.low_pass(there[::-1], taus_s, steps_s[::-1])[::-1]


def calm(batching, values):
    """Every column smoothed over as many rows (0, 1, 2, 4, 8) as predict a row left out best."""
    over = np.array([1.0, 2.0, 4.0, 8.0])
    smooth = smoothed(batching, np.repeat(values, len(over), axis=1),
                      np.tile(over, values.shape[1]), np.ones(len(values) - 1))
    smooth = smooth.reshape(*values.shape, len(over))
    share = -np.expm1(-1.0 / over)
    left = (values[:, :, None] - smooth)[1:-1] / (1.0 - share / (2.0 - share))
    none = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    squares = np.column_stack([np.sum(none ** 2, axis=0), np.sum(left ** 2, axis=0)])
    choices = np.concatenate([values[:, :, None], smooth], axis=2)
    return choices[:, np.arange(values.shape[1]), np.argmin(squares, axis=1)]


class Data:
    """One run and the model."""

    def __init__(self, folder, run, for_search, batching):
        self.for_search = for_search  # test rows are taken as they are
        self.batching = batching      # diagnose_numpy_rows or diagnose_numpy_stretches
        with open(folder / run) as file:
            names = file.readline().strip().split(",")
            table = np.loadtxt(file, delimiter=",")
        column = {name: table[:, i] for i, name in enumerate(names)}
        model = tomllib.loads((folder / "model.toml").read_text())
        self.time_s = column["time_s"]
        self.steps_s = np.diff(self.time_s)
        self.step_s = float(np.median(self.steps_s))
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
        return calm(self.batching, every) if self.for_search else every

    @functools.cached_property
    def coefficient_columns(self):
        """What errors of the coefficients add: principal columns, one standard deviation each."""
        every = COEFFICIENT_SD * self.k * self.calm_inputs
        squares, directions = np.linalg.eigh(every.T @ every)
        return every @ directions[:, squares > SEEN_MIN * self.noise_um ** 2]
