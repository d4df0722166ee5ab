"""A new machine with few hours, helped by its sisters: `series`, `fit --prior`.

    series.py PROGRAM [--data FOLDER] [--only TEXT]

Test RMS (mean over outputs and machines) of the machine's own `fit`, of the series' mean, of `fit
--prior`, and of an oracle: the own fit on days that a new machine lacks. Machines of a simulated
type, whose coefficients scatter by 16 %, and measured unrelated machines, each left out in turn.
"""

import argparse
import os
import pathlib
import subprocess
import sys
import tempfile
import tomllib

os.environ["OPENBLAS_NUM_THREADS"] = "1"

# ruff: noqa: E402
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "measured"))
import measured_data
import series_type

HOUR_S = 3600.0
SISTERS = 8
NEW = 6
PROBED_H = (1, 3, 10)


class Tool:
    def __init__(self, program, folder):
        self.program, self.folder, self.count = program, folder, 0

    def path(self, suffix):
        self.count += 1
        return self.folder / f"{self.count}{suffix}"

    def run(self, *arguments, good=(0,)):
        done = subprocess.run([self.program, *map(str, arguments)], capture_output=True, text=True)
        if done.returncode not in good:
            raise RuntimeError(f"{' '.join(map(str, arguments))}: {done.stderr}")
        return done

    def written(self, columns):
        path = self.path(".csv")
        measured_data.write(measured_data.Run("", columns), path)
        return path

    def fit(self, runs, outputs, *options):
        model = self.path(".toml")
        self.run("fit", *runs, "--outputs", ",".join(outputs), "-o", model, *options)
        return model

    def series(self, sisters, outputs, *options):
        series = self.path(".toml")
        self.run("series", *sisters, "--outputs", ",".join(outputs), "-o", series, *options)
        return series

    def residuals(self, model, runs, outputs):
        """RMS over the runs, one per output; and the share of rows within 1.96 claimed deviations."""
        squares, held, rows = np.zeros(len(outputs)), 0, 0
        for run in runs:
            result = self.path(".csv")
            self.run("predict", "--model", model, run, "-o", result)
            columns = measured_data.read(result)
            stem = [name.rsplit("_", 1)[0] for name in outputs]
            left = np.array([columns[f"{s}_residual_um"] for s in stem])
            good = np.isfinite(left).all(axis=0)
            left = left[:, good]
            squares += (left ** 2).sum(axis=1)
            rows += left.shape[1]
            if f"{stem[0]}_sd_um" in columns:
                sd = np.array([columns[f"{s}_sd_um"] for s in stem])[:, good]
                held += (np.abs(left) < 1.96 * sd).mean(axis=0).sum()
        return np.sqrt(squares / rows), held / rows


def mean_rms(series_file, runs, outputs):
    """RMS of the series' mean on the runs: m times the columns."""
    series = tomllib.loads(pathlib.Path(series_file).read_text())
    squares, rows = np.zeros(len(outputs)), 0
    for run in runs:
        path, _, window = str(run).partition("@")
        columns = measured_data.read(path)
        time_s = columns["time_s"]
        base = []
        for name, power in zip(series["subjects"], series["powers"]):
            values = columns.get(name, np.zeros(len(time_s))) ** power
            base.append(values - values[0])
        base = np.column_stack(base)
        bank = np.hstack([measured_data.low_pass(time_s, base, tau) for tau in series["tau_s"]])
        bounds = [float(b) if b else np.inf for b in window.split(":")] if window else [0.0, np.inf]
        chosen = (time_s >= bounds[0]) & (time_s < bounds[1])
        for o, output in enumerate(outputs):
            left = columns[output] - columns[output][0] - \
                bank @ np.array(series["output"][output]["mean"])
            squares[o] += (left[chosen & np.isfinite(left)] ** 2).sum()
        rows += chosen.sum()
    return np.sqrt(squares / rows)


def compare(tool, name, series, train, test, oracle, outputs):
    """RMS of own, mean, prior and oracle, and the coverage of the claimed intervals."""
    own, _ = tool.residuals(tool.fit(train, outputs), test, outputs)
    prior, held = tool.residuals(tool.fit(train, outputs, "--prior", series), test, outputs)
    mean = mean_rms(series, test, outputs)
    best = tool.residuals(tool.fit(oracle, outputs), test, outputs)[0] if oracle else own * np.nan
    figures = [float(np.mean(each)) for each in (own, mean, prior, best)]
    print(f"{name}: own {figures[0]:.3g} mean {figures[1]:.3g} prior {figures[2]:.3g} "
          f"oracle {figures[3]:.3g} held {held:.2f}", file=sys.stderr)
    return figures + [held]


def simulated_sisters(tool):
    """A folder with two days per machine."""
    sisters = []
    for seed in range(SISTERS):
        folder = tool.folder / f"machine_{seed}"
        folder.mkdir()
        machine = series_type.TypeMachine(seed)
        for day in range(2):
            measured_data.write(measured_data.Run("", machine.day(day, 12)),
                                folder / f"day_{day}.csv")
        sisters.append(folder)
    return sisters


def simulated(tool):
    outputs = ["z_um", "y_um"]
    series = tool.series(simulated_sisters(tool), outputs)
    for hours in PROBED_H:
        all_figures = []
        for seed in range(100, 100 + NEW):
            machine = series_type.TypeMachine(seed)
            train = tool.written(machine.day(0, 10))
            test = [tool.written(machine.day(1, 20))]
            oracle = [tool.written(machine.day(day, 20)) for day in (2, 3)] + [train]
            all_figures.append(compare(tool, f"type, {hours} h, machine {seed}", series,
                                       [f"{train}@:{hours * HOUR_S}"], test, oracle, outputs))
        yield f"type_{hours}_h", np.mean(all_figures, axis=0)


def strangers(tool, data):
    focus = {which: [data / "telescope_focus" / f"{which}_{p}.csv" for p in "ABC"]
             for which in ("sci", "skye")}
    for new, old in (("sci", "skye"), ("skye", "sci")):
        sister = tool.folder / f"telescope_{old}"
        sister.mkdir()
        for path in focus[old]:
            (sister / path.name).symlink_to(path)
        series = tool.series([sister], ["focus_um"], "--scatter", 0.15)
        yield f"telescope_{new}", compare(tool, f"telescope {new}", series, [focus[new][0]],
                                          focus[new][1:], None, ["focus_um"])
    rates = ("1C", "3C", "4C")
    cells = {c: {r: data / "cell_under_load" / f"Q30_{c}_{r}.csv" for r in rates}
             for c in ("S001", "S002")}
    for new, old in (("S001", "S002"), ("S002", "S001")):
        sister = tool.folder / f"cell_{old}"
        sister.mkdir()
        for path in cells[old].values():
            (sister / path.name).symlink_to(path)
        series = tool.series([sister], ["diameter_um"], "--scatter", 0.15)
        yield f"cell_{new}", compare(tool, f"cell {new}", series, [cells[new]["1C"]],
                                     [cells[new]["3C"], cells[new]["4C"]], None, ["diameter_um"])
    probes = sorted((data / "probe_drift").glob("*.csv"))
    for new in probes:
        time_s = measured_data.read(new)["time_s"]
        at_s = time_s[0] + 0.3 * (time_s[-1] - time_s[0])
        yield f"probe_{new.stem}", compare(
            tool, f"probe {new.stem}", tool.series([p for p in probes if p != new], ["z_um"]),
            [f"{new}@:{at_s}"], [f"{new}@{at_s}:"], None, ["z_um"])


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--data", type=pathlib.Path, default=os.environ.get("THERMOCOMP_DATA"))
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tool = Tool(options.program, pathlib.Path(folder))
        results = []
        if "type".startswith(options.only):
            results += list(simulated(tool))
        if "strangers".startswith(options.only):
            results += list(strangers(tool, options.data))
    for name, (own, mean, prior, oracle, held) in results:
        for kind, value in (("own", own), ("mean", mean), ("prior", prior), ("oracle", oracle)):
            if np.isfinite(value):
                print(f"{name}_{kind} {value:.4g} um")
        print(f"{name}_held {held:.3f} ratio")
        print(f"{name}_prior_over_own {prior / own:.3f} ratio")
        print(f"{name}_prior_over_better {prior / min(own, mean):.3f} ratio")


if __name__ == "__main__":
    main()
