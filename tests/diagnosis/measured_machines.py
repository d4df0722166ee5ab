"""Measured machines from the shared data, with base models fitted to them.

The data are not copied: a run is thinned in memory and written to a temporary folder.
"""

import os
import pathlib

import numpy as np

from hidden_effects import low_pass as low_pass_evenly

DATA = pathlib.Path(os.environ.get("THERMOCOMP_DATA") or
                    pathlib.Path(__file__).resolve().parents[3] / "shared" / "data")
TRAIN_SHARE = 0.75  # share of the rows if the machine was measured in one run
BLOCKS = 8
LAGS_S = (900.0, 2700.0, 8100.0)
BANK_LAGS_S = (300.0, 900.0, 2700.0, 8100.0)  # as `fit` takes them
ALIKE = 0.98  # places with a higher correlation of rises cannot be distinguished


def columns(path):
    with open(path, encoding="utf-8") as file:
        lines = [line for line in file if not line.startswith("#")]
    values = np.genfromtxt(lines[1:], delimiter=",")
    return dict(zip(lines[0].strip().split(","), values.T))


def thinned(run, step_s, first_s=0.0, last_s=np.inf):
    time_s = run["time_s"]
    inside = np.flatnonzero((time_s >= first_s) & (time_s < last_s))
    slot = np.floor((time_s[inside] - time_s[inside[0]]) / step_s + 1e-9)
    rows = inside[np.concatenate([[True], np.diff(slot) > 0])]
    out = {name: values[rows].copy() for name, values in run.items()}
    out["time_s"] -= out["time_s"][0]
    return out


def low_pass(time_s, values, tau_s):
    steps = np.diff(time_s)
    if len(steps) and np.ptp(steps) < 1e-6 * steps[0]:
        return low_pass_evenly(values, tau_s, steps[0])
    out = np.empty_like(values)
    out[0] = values[0]
    for i, keep in enumerate(np.exp(-steps / tau_s), 1):
        out[i] = values[i] + keep * (out[i - 1] - values[i])
    return out


def rms(parts):
    """RMS of all rows after removing each run's mean."""
    return float(np.sqrt(np.mean(np.concatenate([p - p.mean() for p in parts]) ** 2)))


class Machine:
    """Runs of one machine, names of the measured quantities, training rows."""

    def __init__(self, name, runs, outputs, signals, train):
        self.name, self.runs, self.outputs, self.signals = name, runs, outputs, signals
        self.temperatures = [n for n in runs[0] if n.endswith("_degC")]
        self.train = train  # rows of each run, none of a test run

    def rise(self, run, name):
        return run[name] - run[name][0]

    def train_parts(self, values):
        """@param values  one array per run"""
        return [v[rows] for v, rows in zip(values, self.train) if rows.stop]

    def keep_probings(self, apart_s):
        """Keeps displacement only in one row per `apart_s`, like probings."""
        for run in self.runs:
            slot = np.floor((run["time_s"] - run["time_s"][0]) / apart_s + 1e-9)
            probed = np.concatenate([[True], np.diff(slot) > 0])
            for output in self.outputs:
                run[output] = np.where(probed, run[output], np.nan)

    def group(self, name):
        """Temperatures whose rises cannot be distinguished from this one's in the training rows."""
        def stacked(of):
            parts = self.train_parts([self.rise(r, of) for r in self.runs])
            return np.concatenate(parts)
        own = stacked(name)
        return {n for n in self.temperatures if n == name or
                (np.std(stacked(n)) > 0 and np.corrcoef(own, stacked(n))[0, 1] > ALIKE)}


def one_run(name, run, outputs, signals):
    rows = len(run["time_s"])
    return Machine(name, [run], outputs, signals, [slice(0, int(TRAIN_SHARE * rows))])


def spindle(random, count=None):
    """@param count  number of outputs; None: one or two"""
    run = columns(DATA / "spindle_46h" / "hours_00_32.csv")
    hours = [(0, 32), (0, 16), (16, 32)][int(random.integers(3))]
    run = thinned(run, 60.0, hours[0] * 3600.0, hours[1] * 3600.0)
    count = count or random.choice([1, 1, 2])
    outputs = ["ch%d_um" % i for i in random.permutation(5)[:count] + 1]
    for other in [n for n in run if n.endswith("_um") and n not in outputs]:
        del run[other]
    return one_run("spindle", run, outputs, ["spindle_rpm"])


def printer(_):
    run = columns(DATA / "printer_frame" / "2021-06-13_morning.csv")
    return one_run("printer", thinned(run, 55.0), ["z_um"], [])


def other_printer(_):
    run = columns(DATA / "printer_other" / "run_2021-06-12.csv")
    del run["bed_target"]
    return one_run("other_printer", thinned(run, 20.0), ["z_um"], [])


def probe(random):
    """Two runs of one probe or one kind of probe, whose reading bed, nozzle and chamber warm."""
    pair = (("superpinda", "superpinda_covered"), ("superpinda_fysetc", "superpinda_fysetc_covered"),
            ("GX_H8A", "N3F_H4NB"))[int(random.integers(3))]
    runs = [columns(DATA / "probe_drift" / ("%s.csv" % name)) for name in pair]
    for run in runs:
        del run["bed_target"], run["hotend_target"]
    runs = [thinned(run, 6.0) for run in runs]
    train = [slice(0, len(runs[0]["time_s"])), slice(0, 0)]
    return Machine("probe", runs, ["z_um"], [], train)


def cell(random):
    unit = ("Q30_S001", "Q30_S002")[int(random.integers(2))]
    files = [columns(DATA / "cell_under_load" / ("%s_%s.csv" % (unit, rate)))
             for rate in ("1C", "2C", "C10", "3C")]
    kept = ("time_s", "cell_degC", "ambient_degC", "diameter_um", "loss_proxy_A2")
    runs = [{n: run[n] for n in kept} for run in (thinned(f, s) for f, s in
                                                  zip(files, (15.0, 15.0, 60.0, 15.0)))]
    train = [slice(0, len(run["time_s"])) for run in runs[:3]] + [slice(0, 0)]
    return Machine("cell", runs, ["diameter_um"], ["loss_proxy_A2"], train)


def mirror(_):
    runs = [columns(DATA / "mirror_focus" / ("binospec_2019-%s.csv" % day))
            for day in ("05-31", "06-01")]
    kept = ("time_s", "oss_degC", "outside_degC", "chamber_degC", "m2_focus_um", "sin_elevation")
    runs = [{n: run[n] for n in kept} for run in (thinned(r, 60.0) for r in runs)]
    train = [slice(0, len(runs[0]["time_s"])), slice(0, 0)]
    return Machine("mirror", runs, ["m2_focus_um"], ["sin_elevation"], train)


def spindle_outputs(random):
    return spindle(random, 5)


MACHINES = {"spindle": spindle, "spindle_outputs": spindle_outputs, "printer": printer,
            "cell": cell, "mirror": mirror, "other_printer": other_printer, "probe": probe}


class Model:
    """A linear model with lags: coefficients of inputs, and of lagged inputs less the inputs.

    @param as_bank  written as one lag_bank instead of one thermal_lag each
    """

    def __init__(self, inputs, outputs, lags_s, as_bank=False):
        self.inputs, self.outputs, self.lags_s = inputs, outputs, lags_s
        self.as_bank = as_bank
        self.matrix = self.gains = None  # (outputs, inputs), (outputs, lags, inputs)

    def parts(self, run):
        rises = np.stack([run[n] - run[n][0] for n in self.inputs], axis=1)
        lagged = [np.stack([low_pass(run["time_s"], c, tau) - c for c in rises.T], axis=1)
                  for tau in self.lags_s]
        return np.hstack([rises] + lagged)

    def fit(self, runs, penalty=None):
        """Ridge on standardised columns without intercept, the penalty from left-out blocks."""
        left = [self.parts(run) for run in runs]
        right = [np.stack([run[o] - run[o][0] for o in self.outputs], axis=1) for run in runs]
        left, right = np.vstack(left), np.vstack(right)
        known = np.isfinite(right).all(axis=1)
        left, right = left[known], right[known]
        scale = left.std(axis=0) + 1e-12
        left = left / scale
        block = np.arange(len(left)) * BLOCKS // len(left)
        products = [(left[block == b].T @ left[block == b], left[block == b].T @ right[block == b])
                    for b in range(BLOCKS)]
        square, against = (sum(p[i] for p in products) for i in (0, 1))

        def solved(a, b, share):
            return np.linalg.solve(a + share * len(left) * np.eye(len(a)), b)

        def missed(share):
            total = 0.0
            for b, (own, own_against) in enumerate(products):
                gains = solved(square - own, against - own_against, share)
                total += np.sum((right[block == b] - left[block == b] @ gains) ** 2)
            return total
        self.penalty = penalty or min(10.0 ** np.arange(-6.0, 0.5, 0.5), key=missed)
        self.left_out = missed(self.penalty)
        gains = (solved(square, against, self.penalty) / scale[:, None]).T
        shape = (len(self.outputs), 1 + len(self.lags_s), len(self.inputs))
        self.matrix, self.gains = gains.reshape(shape)[:, 0], gains.reshape(shape)[:, 1:]
        return self

    def predicted(self, run):
        return np.hstack([self.matrix, self.gains.reshape(len(self.outputs), -1)]) @ \
            self.parts(run).T

    def write(self, path):
        quoted = lambda values: "[" + ", ".join('"%s"' % v for v in values) + "]"
        listed = lambda values: "[" + ", ".join("%.12f" % v for v in values) + "]"
        # A bank lags the values themselves: the lagged part has no immediate effect.
        at_once = self.matrix - self.gains.sum(axis=1) if self.as_bank else self.matrix
        rows = ",\n  ".join(listed(row) for row in at_once)
        text = ('format = 1\ninputs = %s\noutputs = %s\nreference = "first_sample"\n'
                "matrix_um_per_K = [\n  %s\n]\n" % (
                    quoted(self.inputs), quoted(self.outputs), rows))
        path.write_text(text + (self.bank(quoted, listed) if self.as_bank else self.lags()))

    def lags(self):
        text = ""
        for lag, tau_s in enumerate(self.lags_s):
            for i, name in enumerate(self.inputs):
                gains = ", ".join("%s = %.12f" % (o, self.gains[j, lag, i])
                                  for j, o in enumerate(self.outputs))
                text += ('\n[[term]]\nkind = "thermal_lag"\nsubject = "%s"\ntau_s = %.1f\n'
                         "gain_um_per_K = { %s }\n" % (name, tau_s, gains))
        return text

    def bank(self, quoted, listed):
        text = '\n[[term]]\nkind = "lag_bank"\nsubjects = %s\ntau_s = %s\n' % (
            quoted(self.inputs), listed(self.lags_s))
        for j, output in enumerate(self.outputs):
            text += "[term.gain_um_per_unit]\n" if j == 0 else ""
            text += "%s = [%s]\n" % (output, ", ".join(listed(g) for g in self.gains[j].T))
        return text


def chosen_few(machine, names, most, lags_s):
    """Forward selection with left-out blocks."""
    chosen = []
    best = None
    while len(chosen) < min(most, len(names)):
        trials = [Model(chosen + [n], machine.outputs, lags_s).fit(machine.runs, 1e-4)
                  for n in names if n not in chosen]
        least = min(trials, key=lambda m: m.left_out)
        if best is not None and least.left_out > 0.98 * best.left_out:
            break
        best, chosen = least, least.inputs
    return sorted(chosen)


def base_model(machine, kind, without=()):
    """@param kind  ridge (all temperatures), few (static), lags (few, each with three lags) or bank
    (all temperatures, each with four lags, as one lag_bank)
    @param without  temperatures withheld from the model"""
    names = [n for n in machine.temperatures if n not in without]
    if kind == "ridge":
        return Model(names, machine.outputs, ()).fit(machine.runs)
    if kind == "bank":
        return Model(names, machine.outputs, BANK_LAGS_S, as_bank=True).fit(machine.runs)
    lags_s = LAGS_S if kind == "lags" else ()
    return Model(chosen_few(machine, names, 4, lags_s), machine.outputs, lags_s).fit(machine.runs)
