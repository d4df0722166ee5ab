"""Splits of measured data: rows for fitting and rows for evaluation.

The data belong to others: they are read from the folder THERMOCOMP_DATA and never copied into the
project. Displacement, rises and prediction are relative to each file's first row.
"""

import dataclasses

import numpy as np

HOUR_S = 3600.0
ROWS_OF_A_RUN_MAX = 1200  # keeps the shape of a day, and lets boosting end


def read(path):
    with open(path, encoding="utf-8") as text:
        lines = [line for line in text if not line.startswith("#")]
    names = lines[0].strip().split(",")
    rows = [[float(field) if field.strip() else np.nan for field in line.split(",")]
            for line in lines[1:] if line.strip()]
    return dict(zip(names, np.array(rows).T))


@dataclasses.dataclass
class Run:
    """A file as recorded, with the rows used by a split."""

    name: str
    columns: dict
    from_s: float = -np.inf
    to_s: float = np.inf

    def cut(self, from_s, to_s):
        """The rows as a separate file: references and lags start at its first row."""
        time_s = self.columns["time_s"]
        keep = (time_s >= from_s) & (time_s < to_s)
        return Run(self.name, {name: values[keep] for name, values in self.columns.items()})

    def selected(self, from_s, to_s):
        return dataclasses.replace(self, from_s=from_s, to_s=to_s)

    def without(self, names):
        kept = {name: values for name, values in self.columns.items() if name not in names}
        return dataclasses.replace(self, columns=kept)


@dataclasses.dataclass
class Split:
    name: str
    train: list
    test: list
    outputs: list

    def of_common_columns(self):
        runs = self.train + self.test
        common = set.intersection(*(set(run.columns) for run in runs))
        extra = set.union(*(set(run.columns) for run in runs)) - common
        self.train = [run.without(extra) for run in self.train]
        self.test = [run.without(extra) for run in self.test]
        return self


def spindle(folder):
    run = Run("spindle", read(folder / "spindle_46h" / "hours_00_32.csv"))
    outputs = [f"ch{i}_um" for i in range(1, 6)]
    def hours(a, b):
        return run.selected(a * HOUR_S, b * HOUR_S)
    return [Split("spindle_0-16_16-32", [hours(0, 16)], [hours(16, 99)], outputs),
            Split("spindle_0-24_24-32", [hours(0, 24)], [hours(24, 99)], outputs),
            Split("spindle_8-32_0-8", [run.cut(8 * HOUR_S, np.inf)],
                  [run.cut(0, 8 * HOUR_S)], outputs)]


def printer(folder):
    run = Run("printer", read(folder / "printer_frame" / "2021-06-13_morning.csv"))
    time_s = run.columns["time_s"]
    half_s = 0.5 * (time_s[0] + time_s[-1])
    return [Split("printer_halves", [run.selected(0, half_s)], [run.selected(half_s, np.inf)],
                  ["z_um"])]


def telescope(folder):
    runs = {f"{which}_{period}": Run(f"{which}_{period}",
                                     read(folder / "telescope_focus" / f"{which}_{period}.csv"))
            for which in ("sci", "skye") for period in "ABC"}
    splits = [Split(f"telescope_{which}_AB_C", [runs[f"{which}_A"], runs[f"{which}_B"]],
                    [runs[f"{which}_C"]], ["focus_um"]) for which in ("sci", "skye")]
    splits.append(Split("telescope_sci_skye", [runs[f"sci_{period}"] for period in "ABC"],
                        [runs[f"skye_{period}"] for period in "ABC"], ["focus_um"]))
    return splits


def cell(folder):
    splits = []
    for which in ("S001", "S002"):
        runs = {rate: Run(f"{which}_{rate}", read(folder / "cell_under_load" /
                                                  f"Q30_{which}_{rate}.csv"))
                for rate in ("1C", "3C", "4C")}
        splits.append(Split(f"cell_{which}_1C4C_3C", [runs["1C"], runs["4C"]], [runs["3C"]],
                            ["diameter_um"]))
    return splits


def mirror(folder):
    first, second = (Run(f"night_{day}", read(folder / "mirror_focus" / f"binospec_2019-{day}.csv"))
                     for day in ("05-31", "06-01"))
    return [Split("mirror_nights", [first], [second], ["m2_focus_um"])]


def probes(folder):
    """Inductive probes on one machine: another kind, the same covered, and the end of each run."""
    runs = {path.stem: Run(path.stem, read(path))
            for path in sorted((folder / "probe_drift").glob("*.csv"))}
    pairs = (("superpinda", "superpinda_covered"), ("superpinda_fysetc", "superpinda_fysetc_covered"),
             ("GX_H8A", "N3F_H4NB"), ("superpinda", "superpinda_fysetc"))
    splits = [Split(f"probe_{a}_{b}", [runs[a]], [runs[b]], ["z_um"]) for a, b in pairs]
    for name, run in runs.items():
        time_s = run.columns["time_s"]
        at_s = time_s[0] + 0.6 * (time_s[-1] - time_s[0])
        splits.append(Split(f"probe_{name}_60_40", [run.selected(-np.inf, at_s)],
                            [run.selected(at_s, np.inf)], ["z_um"]))
    return splits


def printer_other(folder):
    run = Run("printer_other", read(folder / "printer_other" / "run_2021-06-12.csv"))
    return [Split("printer_other_13000", [run.selected(-np.inf, 13000.0)],
                  [run.selected(13000.0, np.inf)], ["z_um"])]


def shares(run, outputs, *at):
    """The rows before a share of the run's time, and those after it."""
    first_s, last_s = run.columns["time_s"][[0, -1]]
    splits = []
    for share in at:
        time_s = first_s + share * (last_s - first_s)
        splits.append(Split(f"{run.name}_to_{share:g}", [run.selected(-np.inf, time_s)],
                            [run.selected(time_s, np.inf)], outputs))
    return splits


def further_splits(folder):
    """Other splits of the same data, used only to choose the width of the intervals."""
    def runs(pattern):
        return {path.stem: Run(path.stem, read(path)) for path in sorted(folder.glob(pattern))}
    spindle_run, *_ = runs("spindle_46h/*.csv").values()
    spindle_outputs = [f"ch{i}_um" for i in range(1, 6)]
    pieces = [spindle_run.cut(6 * i * HOUR_S, 6 * (i + 1) * HOUR_S) for i in range(5)]
    splits = shares(spindle_run, spindle_outputs, 0.25, 0.4)
    splits += [Split(f"spindle_{n}x6h", pieces[:n], [pieces[n]], spindle_outputs) for n in (2, 4)]
    for pattern, output, at in (("printer_frame/*.csv", "z_um", (0.3, 0.4, 0.6, 0.7)),
                                ("printer_other/*.csv", "z_um", (0.35, 0.5, 0.75)),
                                ("mirror_focus/*.csv", "m2_focus_um", (0.5,)),
                                ("probe_drift/*.csv", "z_um", (0.4, 0.75))):
        for run in runs(pattern).values():
            splits += shares(run, [output], *at)
    for pattern, output, count in (("telescope_focus/sci*.csv", "focus_um", (1, 2)),
                                   ("telescope_focus/skye*.csv", "focus_um", (1, 2)),
                                   ("cell_under_load/*S001_?C.csv", "diameter_um", (1, 3)),
                                   ("cell_under_load/*S002_?C.csv", "diameter_um", (1, 3)),
                                   ("probe_drift/*.csv", "z_um", (1, 5))):
        of = list(runs(pattern).values())
        for i, run in enumerate(of):
            others = of[i + 1:] + of[:i]
            splits += [Split(f"{'+'.join(each.name for each in others[:n])}_{run.name}", others[:n],
                             [run], [output]) for n in count]
    return [split.of_common_columns() for split in splits]


def all_splits(folder):
    splits = (spindle(folder) + printer(folder) + telescope(folder) + cell(folder) +
              mirror(folder) + probes(folder) + printer_other(folder))
    return [split.of_common_columns() for split in splits]


def low_pass(time_s, values, tau_s):
    """First-order low pass of each column of `values`, starting at its first value."""
    if not tau_s > 0:
        return values
    out = np.empty_like(values)
    out[0] = values[0]
    share = -np.expm1(-np.diff(time_s) / tau_s)
    for i in range(1, len(values)):
        out[i] = out[i - 1] + share[i - 1] * (values[i] - out[i - 1])
    return out


def write(run, path):
    """A run file of all columns, every number as read."""
    names = ["time_s"] + [name for name in run.columns if name != "time_s"]
    with open(path, "w", encoding="utf-8") as text:
        text.write(",".join(names) + "\n")
        for row in np.column_stack([run.columns[name] for name in names]):
            text.write(",".join("" if np.isnan(v) else repr(float(v)) for v in row) + "\n")


def selection(run, path):
    if np.isinf(run.from_s) and np.isinf(run.to_s):
        return str(path)
    def bound(value):
        return "" if np.isinf(value) else repr(float(value))
    return f"{path}@{bound(run.from_s)}:{bound(run.to_s)}"


class Table:
    """Rows of runs for a peer; shape (rows, columns), all thinned alike."""

    def __init__(self, runs, outputs, low_passes_s=(0.0,), with_signals=False):
        self.x, self.y, self.runs = [], [], []
        for run in runs:
            columns = run.columns
            time_s = columns["time_s"]
            names = sorted(n for n in columns if n.endswith(("_degC", "_K")))
            self.temperatures = names
            signals = sorted(n for n in columns if n not in names and n not in outputs
                             and n != "time_s") if with_signals else []
            base = [columns[n] - columns[n][0] for n in names]
            for name in signals:
                base += [columns[name], columns[name] ** 2]
            base = np.column_stack(base)
            base = np.hstack([low_pass(time_s, base, tau_s) for tau_s in low_passes_s])
            keep = (time_s >= run.from_s) & (time_s < run.to_s)
            rows = np.flatnonzero(keep & np.isfinite(base).all(axis=1))
            rows = rows[::max(1, len(rows) // ROWS_OF_A_RUN_MAX)]
            self.x.append(base[rows] - base[0])
            self.y.append(np.column_stack([columns[o][rows] - columns[o][0] for o in outputs]))
            self.runs.append(run.name)

    def stacked(self):
        return np.vstack(self.x), np.vstack(self.y)
