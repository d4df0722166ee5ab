#!/usr/bin/python3
"""How often plain least squares put first what was planted: what a search has to beat.

plain_ranking.py [--cases N] [--seed S] [--machines ...] [--bases ...] [--causes ...] [--sizes ...]

The cases of measured_campaign.py, and its data. Every cause with every place over a grid of shapes
is weighed in three ways, each by ln(RMS before / RMS after) without noise that wanders, without a
price of parameters, and without asking the other readings about a false one:

  first row   displacement and prediction count from the first row, no level is free
  level free  each run's mean is taken off before and after
  left out    as the first, own gains from the blocks that are not judged
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# ruff: noqa: E402
import collections
import sys

import numpy as np

import measured_campaign
import measured_machines
from hidden_effects import play
from measured_machines import low_pass

BLOCKS = 8
WAYS = ("first row", "level free", "left out")
SHORTEST_LAG_S, LONGEST_LAG_S = 60.0, 14400.0
LOST_MIN, LOST_MAX = 0.02, 20.0  # what a loose sensor can have lost of its motion
LAG_OVERSHOOT = 1.1              # of a coefficient that may follow late


class Weighed:
    """A cause with a subject: columns of each shape, (rows, shapes) an output; None: not its own.
    form: own gains, one shared gain, or no gain."""

    def __init__(self, cause, subject, form, columns, one_run=False, possible=None):
        self.cause, self.subject, self.form = cause, subject, form
        self.columns, self.one_run, self.possible = columns, one_run, possible


class Causes:
    """Of a machine with its model, over the training rows."""

    def __init__(self, machine, model):
        self.machine, self.model = machine, model
        self.numbers = [i for i, rows in enumerate(machine.train) if rows.stop]
        self.runs = [machine.runs[i] for i in self.numbers]
        self.times = [run["time_s"] for run in self.runs]
        self.predicted = [model.predicted(run) for run in self.runs]
        self.count = len(machine.outputs)
        step_s = float(np.median(np.diff(self.times[0])))
        longest_s = max(t[-1] for t in self.times)
        low = max(SHORTEST_LAG_S, 0.5 * step_s)
        self.lags_s = np.geomspace(low, max(2 * low, min(LONGEST_LAG_S, 0.5 * longest_s)), 20)
        self.periods_s = self._periods(longest_s, 5.0 * step_s)
        self.residual = [self._stacked([run[o] - run[o][0] - p[i] for run, p in
                                        zip(self.runs, self.predicted)])
                         for i, o in enumerate(machine.outputs)]
        self.run_of = self._stacked([np.full(len(t), float(i)) for i, t in enumerate(self.times)])

    def _stacked(self, parts):
        return np.concatenate([p[self.machine.train[i]] for i, p in zip(self.numbers, parts)])

    @staticmethod
    def _periods(longest_s, shortest_s):
        frequency, all_of = 5.0 / longest_s, []
        while frequency <= 1.0 / shortest_s and len(all_of) < 400:
            all_of.append(1.0 / frequency)
            frequency += max(0.4 / longest_s, 0.004 * frequency)
        return all_of

    def _everywhere(self, shapes):
        """@param shapes  of each shape a part a run"""
        columns = np.stack([self._stacked(parts) for parts in shapes], axis=1)
        return [columns] * self.count

    def _one_output(self, output, shapes):
        columns = np.stack([self._stacked(parts) for parts in shapes], axis=1)
        return [columns if i == output else None for i in range(self.count)]

    def _answers(self, changes):
        """What the model says of changed readings less what it says of these.
        @param changes  of each shape what is different, a dictionary a run"""
        all_of = [[self.model.predicted(dict(run, **change)) - p
                   for run, change, p in zip(self.runs, of_runs, self.predicted)]
                  for of_runs in changes]
        return [np.stack([self._stacked([part[i] for part in parts]) for parts in all_of], axis=1)
                for i in range(self.count)]

    def _changed(self, name, shapes):
        """@param shapes  of each shape the changed reading, a part a run"""
        return self._answers([[{name: part} for part in parts] for parts in shapes])

    def all(self):
        yield from self.of_temperatures()
        yield from self.of_readings()
        yield from self.of_signals()
        for output in range(self.count):
            yield from self.of_output(output)
        for number in range(len(self.runs)):
            yield from self.of_run(number)

    def of_temperatures(self):
        for name in self.machine.temperatures:
            rises = [self.machine.rise(run, name) for run in self.runs]
            lagged = [[low_pass(t, r, tau) for t, r in zip(self.times, rises)]
                      for tau in self.lags_s]
            yield Weighed("nonlinear_expansion", name, "own",
                          self._everywhere([[r * r for r in rises]]))
            if name not in self.model.inputs:
                yield Weighed("missing_temperature", name, "own",
                              self._everywhere([rises] + lagged))
                continue
            yield Weighed("wrong_coefficient", name, "own", self._everywhere([rises]))
            late = [[b - a for a, b in zip(rises, of)] for of in lagged]
            yield Weighed("thermal_lag", name, "own", self._everywhere(late),
                          possible=self._lag_possible(name))

    def _lag_possible(self, name):
        group = self.machine.group(name)
        of_group = [sum(k for k, n in zip(row, self.model.inputs) if n in group)
                    for row in self.model.matrix]
        own = self.model.matrix[:, self.model.inputs.index(name)]

        def possible(gains, output):
            shares = gains / np.array([[own[output]], [of_group[output]]])
            return np.any((shares > 0) & (shares <= LAG_OVERSHOOT), axis=0)
        return possible

    def of_readings(self):
        for name in self.model.inputs:
            values = [run[name] for run in self.runs]
            rises = [self.machine.rise(run, name) for run in self.runs]
            slopes = [np.gradient(r, t) for r, t in zip(rises, self.times)]
            ahead = [[v + tau * low_pass(t, s, 0.25 * tau) for v, s, t in
                      zip(values, slopes, self.times)]
                     for tau in self.lags_s[self.lags_s <= 3600.0]]
            yield Weighed("slow_sensor", name, "none", self._changed(name, ahead))
            widths_K = np.linspace(0.04, 0.8, 16) * max(np.ptp(r) for r in rises)
            played = [[v - r + play(r, width) for v, r in zip(values, rises)]
                      for width in widths_K]
            yield Weighed("hysteresis", name, "none", self._changed(name, played))
            for other in self.model.inputs:
                if name < other:
                    exchanged = [{name: run[other], other: run[name]} for run in self.runs]
                    yield Weighed("sensor_swap", name + "|" + other, "none",
                                  self._answers([exchanged]))

    def of_signals(self):
        for name in self.machine.signals:
            heats = [[low_pass(t, run[name] ** power, tau) for t, run in
                      zip(self.times, self.runs)] for power in (1, 2) for tau in self.lags_s]
            yield Weighed("missing_heat_source", name, "own", self._everywhere(heats))
            if name.endswith("_rpm"):
                squares = [run[name] ** 2 for run in self.runs]
                yield Weighed("speed_growth", name, "own", self._everywhere([squares]))

    def of_output(self, output):
        name = self.machine.outputs[output]
        moved = [p[output] for p in self.predicted]
        widths_um = np.linspace(0.03, 0.7, 20) * max(np.ptp(m) for m in moved)
        yield Weighed("hysteresis", name, "none", self._one_output(
            output, [[play(m, width) - m for m in moved] for width in widths_um]))
        shifts_s = np.outer([-1.0, 1.0], np.geomspace(10.0, 3600.0, 14)).ravel()
        yield Weighed("time_shift", name, "none", self._one_output(
            output, [[np.interp(t - shift, t, m) - m for t, m in zip(self.times, moved)]
                     for shift in shifts_s]))
        for period_s in self.periods_s:
            waves = [self._in_run(i, wave(2 * np.pi * t / period_s))
                     for i, t in enumerate(self.times) for wave in (np.sin, np.cos)]
            yield Weighed("periodic_disturbance", name, "all", self._one_output(output, waves))

    def _in_run(self, number, values):
        return [values if i == number else np.zeros(len(t)) for i, t in enumerate(self.times)]

    def of_run(self, number):
        time_s, run = self.times[number], self.runs[number]
        last_s = time_s[self.machine.train[self.numbers[number]]][-1]
        onsets_s = np.linspace(0.02, 0.95, 40) * last_s
        since = [(time_s >= at).astype(float) for at in onsets_s]
        for output, name in enumerate(self.machine.outputs):
            steps = [self._in_run(number, s) for s in since]
            yield Weighed("displacement_step", name, "own", self._one_output(output, steps), True)
            ramp = [self._in_run(number, time_s / 3600.0)]
            yield Weighed("displacement_drift", name, "own", self._one_output(output, ramp), True)
        for name in self.model.inputs:
            rise = self.machine.rise(run, name)
            ramps = [np.maximum(0.0, time_s - at) / 3600.0 for at in onsets_s[:12]]
            for cause, errors, possible in (
                    ("sensor_step", since, None), ("sensor_drift", ramps, None),
                    ("sensor_loose", [-rise * s for s in since],
                     lambda gains, _: (gains > LOST_MIN) & (gains < LOST_MAX))):
                readings = [[of[name] + error for of, error in
                             zip(self.runs, self._in_run(number, e))] for e in errors]
                columns = [-c for c in self._changed(name, readings)]
                yield Weighed(cause, name, "shared", columns, True, possible)


def centred(values, run_of):
    values = values.copy()
    for number in np.unique(run_of):
        values[run_of == number] -= values[run_of == number].mean(axis=0)
    return values


def squares_of(columns, residual):
    return (np.einsum("ij,ij->j", columns, columns), columns.T @ residual, residual @ residual)


class Ranking:
    def __init__(self, causes):
        self.causes = causes
        self.block = np.arange(len(causes.run_of)) * BLOCKS // len(causes.run_of)

    def gains(self, weighed, products):
        """Shape (shapes) an output that it acts on; impossible ones are 0."""
        if weighed.form == "none":
            return {i: np.ones(len(of[0])) for i, of in products.items()}
        if weighed.form == "shared":
            square = sum(of[0] / of[2] for of in products.values())
            right = sum(of[1] / of[2] for of in products.values())
            gains = {i: right / np.maximum(square, 1e-300) for i in products}
        else:
            gains = {i: of[1] / np.maximum(of[0], 1e-300) for i, of in products.items()}
        if weighed.possible:
            gains = {i: np.where(weighed.possible(g, i), g, 0.0) for i, g in gains.items()}
        return gains

    def share(self, weighed, prepared):
        """ln(RMS before / after) of the best shape, summed over outputs, and that shape"""
        residual = [prepared(r) for r in self.causes.residual]
        acting = [i for i, c in enumerate(weighed.columns) if c is not None]
        if weighed.form == "all":
            columns = prepared(weighed.columns[acting[0]])
            y = residual[acting[0]]
            left = y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]
            return 0.5 * np.log(y @ y / (left @ left)), None
        products = {i: squares_of(prepared(weighed.columns[i]), residual[i]) for i in acting}
        total = 0.0
        for i, gains in self.gains(weighed, products).items():
            square, right, before = products[i]
            left = before - 2.0 * gains * right + gains ** 2 * square
            total = total + 0.5 * np.log(before / np.maximum(left, 1e-9 * before))
        best = int(np.argmax(total))
        return float(total[best]), best

    def left_out(self, weighed, shape):
        """At this shape; own gains that act in every run from the other blocks"""
        total = 0.0
        for columns, y in zip(weighed.columns, self.causes.residual):
            if columns is None:
                continue
            columns = columns if shape is None else columns[:, [shape]]
            left = np.empty_like(y)
            for block in range(BLOCKS):
                inside = self.block == block
                gains = np.linalg.lstsq(columns[~inside], y[~inside], rcond=None)[0]
                left[inside] = y[inside] - columns[inside] @ gains
            total += 0.5 * np.log(y @ y / (left @ left))
        return total

    def of(self, weighed):
        """By way"""
        first, shape = self.share(weighed, lambda values: values)
        free, _ = self.share(weighed, lambda values: centred(values, self.causes.run_of))
        fitted = weighed.form in ("own", "all") and not weighed.one_run
        return first, free, self.left_out(weighed, shape) if fitted else first


def main():
    options = measured_campaign.arguments(["no program"] + sys.argv[1:])
    if not measured_machines.DATA.is_dir():
        print("plain ranking: no data at %s" % measured_machines.DATA)
        return 0
    options.untouched = 0
    first, cases = collections.Counter(), collections.Counter()
    for _, seed, machines, base, cause, times, kind in measured_campaign.tasks_of(options):
        try:
            machine, model, truths = measured_campaign.planted_case(seed, machines, base, cause,
                                                                    times, kind)
        except measured_campaign.Impossible:
            continue
        truth = measured_campaign.with_groups(truths, machine)[0]
        ranking = Ranking(Causes(machine, model))
        all_of = [(dict(cause=w.cause, subject=w.subject), ranking.of(w))
                  for w in ranking.causes.all()]
        cases[times] += 1
        for place, way in enumerate(WAYS):
            best = max(all_of, key=lambda each: each[1][place])[0]
            first[times, way] += measured_campaign.right(best, truth)
    for times, count in sorted(cases.items()):
        print("size %-4g first of %3d cases: %s" % (times, count, ", ".join(
            "%s %d" % (way, first[times, way]) for way in WAYS)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
