"""Test RMS on measured machines: usual fits, `thermocomp fit` without further options, and a ridge
model extended by `thermocomp diagnose`.

    measured.py PROGRAM [--data FOLDER] [--splits TEXT] [--further] [--peers NAME,...]

The last lines: each split's RMS by method (mean over its outputs); the error claimed by `fit`
relative to the one on the test rows (median over outputs of their ratio; `told_as_range` if no
figure is given); the number of rows called outside, the error inside and outside, and for 95 %
intervals: coverage, mean width relative to split-conformal intervals around ridge regression with
lags, the coverage of those, and the ratio of the interval scores (width plus 40 times the excess).
Both kinds are also widened, by one factor each for all splits, to a mean coverage of 95 %, and
compared again. Then ours relative to the best peer of the split: median, maximum, geometric mean;
relative to no model; rows that are worse than no model without being called outside; and the number
of claimed errors that are right within 0.7 to 1.5.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"

# ruff: noqa: E402
import numpy as np

import measured_data as data
import measured_peers as peers

SOURCE = pathlib.Path(__file__).resolve().parents[2]


def rms(values):
    return float(np.sqrt(np.nanmean(np.square(values))))


def arguments(runs, folder, prefix):
    """Runs of one file are written once."""
    paths, given = {}, []
    for run in runs:
        key = id(run.columns["time_s"])
        if key not in paths:
            paths[key] = folder / f"{prefix}{len(paths)}_{run.name}.csv"
            data.write(run, paths[key])
        given.append(data.selection(run, paths[key]))
    return given


def left_by(program, model, runs, split):
    """Residual rows, measured rows, their claimed standard deviation (one per row and output), and
    `outside` flags."""
    left = {name: [] for name in split.outputs}
    moved = {name: [] for name in split.outputs}
    stated = {name: [] for name in split.outputs}
    outside = []
    for run in runs:
        out = model.with_name("predicted.csv")
        subprocess.run([program, "predict", "--model", model, run, "-o", out], check=True,
                       capture_output=True)
        columns = data.read(out)
        outside.append(columns.get("outside", np.zeros(len(columns["time_s"]))))
        for name in split.outputs:
            stem, unit = name.rsplit("_", 1)
            left[name].append(columns[f"{stem}_residual_{unit}"])
            moved[name].append(columns[f"{stem}_measured_{unit}"])
            stated[name].append(columns.get(f"{stem}_sd_{unit}", np.zeros(len(outside[-1]))))
    return ([np.concatenate(left[name]) for name in split.outputs],
            [np.concatenate(moved[name]) for name in split.outputs],
            [np.concatenate(stated[name]) for name in split.outputs],
            np.concatenate(outside) > 0.5)


def run(what, arguments_of):
    start = time.monotonic()
    done = subprocess.run(arguments_of, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{what}: {done.stderr}")
    print(done.stdout + done.stderr, file=sys.stderr)
    return time.monotonic() - start


def write_ridge(split, path):
    """Ridge regression of all temperatures as a model file: the base model for `diagnose`."""
    def quoted(names):
        return "[" + ", ".join(f'"{name}"' for name in names) + "]"
    names, gains = peers.ridge_gains_um_per_K(split)
    rows = ",\n  ".join("[" + ", ".join(f"{g:.12g}" for g in row) + "]" for row in gains)
    path.write_text(f"format = 1\ninputs = {quoted(names)}\noutputs = {quoted(split.outputs)}\n"
                    f'reference = "first_sample"\nmatrix_um_per_K = [\n  {rows}\n]\n')


def diagnosed(program, split, train, test, folder):
    """Test residual of the ridge model extended by `diagnose`."""
    base = folder / "ridge.toml"
    write_ridge(split, base)
    out = folder / "diagnosed"
    seconds = run(f"{split.name}: diagnose", [program, "diagnose", "--model", base, "--train",
                                              *train, "--test", *test, "--out", out])
    return left_by(program, out / "model.toml", test, split)[0], seconds


def fitted(program, split, train, model):
    """Fits without further options; the JSON answer and the time [s]."""
    start = time.monotonic()
    done = subprocess.run([program, "fit", *train, "--outputs", ",".join(split.outputs), "-o",
                           model, "--json"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{split.name}: fit: {done.stderr}")
    print(done.stderr, file=sys.stderr)
    return json.loads(done.stdout), time.monotonic() - start


def share_covered(left, sd, rows):
    """Coverage of 95 % intervals on the rows, mean over outputs; NaN without rows."""
    if not rows.any():
        return float("nan")
    return float(np.mean([np.mean(np.abs(e[rows]) <= 1.96 * s[rows]) for e, s in zip(left, sd)]))


def widening(errors, share=0.95):
    """Common factor for all intervals that gives the coverage, mean over the splits.

    errors -- errors over half widths, one array per split
    """
    low, high = 1e-3, 1e4
    while high / low > 1.001:
        middle = np.sqrt(low * high)
        holds = np.mean([np.mean(each <= middle) for each in errors])
        low, high = (middle, high) if holds < share else (low, middle)
    return high


def interval_score_um(left, half_um):
    """Mean over outputs; lower is better, lowest for intervals that cover 95 %."""
    return float(np.mean([np.nanmean(2 * h + 40 * np.maximum(0.0, np.abs(e) - h))
                          for e, h in zip(left, half_um)]))


def judge(program, split, names, folder):
    """RMS of each method, mean over outputs; and of ours for rows not called outside."""
    figures = {}
    left_by_peer = {}
    for name in names:
        left_by_peer[name] = peers.PEERS[name](split)
        figures[name] = float(np.mean([rms(left) for left in left_by_peer[name]]))
        print(f"{split.name} {name} {figures[name]:.3f}", file=sys.stderr, flush=True)
    folder.mkdir()
    train, test = arguments(split.train, folder, "train"), arguments(split.test, folder, "test")
    model = folder / "model.toml"
    answer, seconds = fitted(program, split, train, model)
    left, moved, sd, outside = left_by(program, model, test, split)
    figures["family"] = answer["family"]
    figures["runs"] = len(train)
    figures["stated"] = float(np.median([rms(e) / answer["left_out_rms_um"][name]
                                         for name, e in zip(split.outputs, left)]))
    figures["covered_inside"] = share_covered(left, sd, ~outside)
    figures["covered_outside"] = share_covered(left, sd, outside)
    if "ridge_lags" in names:
        widths_um = peers.conformal_lags_um(split)
        of_ridge = left_by_peer["ridge_lags"]
        figures["errors"] = np.concatenate([np.abs(e) / (1.96 * s) for e, s in zip(left, sd)])
        figures["errors_conformal"] = np.concatenate(
            [np.abs(e) / w for e, w in zip(of_ridge, widths_um)])
        figures["width"] = float(np.mean([np.mean(1.96 * s) / w for s, w in zip(sd, widths_um)]))
        figures["conformal"] = float(np.mean([np.mean(np.abs(e) <= w)
                                              for e, w in zip(of_ridge, widths_um)]))
        figures["score"] = (interval_score_um(left, [1.96 * s for s in sd]) /
                            interval_score_um(of_ridge, widths_um))
    figures["fit"] = float(np.mean([rms(each) for each in left]))
    left_diagnosed, figures["diagnose_seconds"] = diagnosed(program, split, train, test, folder)
    figures["diagnose"] = float(np.mean([rms(each) for each in left_diagnosed]))
    inside = ~outside
    figures["inside"] = float(np.mean([rms(e[inside]) for e in left])) if inside.any() else 0.0
    figures["none_inside"] = (float(np.mean([rms(e[inside]) for e in moved]))
                              if inside.any() else 0.0)
    figures["outside"] = float(np.mean([rms(e[outside]) for e in left])) if outside.any() else 0.0
    figures["outside_share"] = float(outside.mean())
    figures["seconds"] = seconds
    return figures


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--data", default=os.environ.get(
        "THERMOCOMP_DATA", SOURCE.parent / "shared" / "data"), type=pathlib.Path)
    parser.add_argument("--splits", default="")
    parser.add_argument("--further", action="store_true", help="other splits of the same data")
    parser.add_argument("--peers", default=",".join(peers.PEERS))
    options = parser.parse_args()
    if not options.data.is_dir():
        print(f"no measured data in {options.data} (THERMOCOMP_DATA): nothing to measure")
        return 77
    names = options.peers.split(",")
    ratios, lines, worse, stated = {"fit": [], "diagnose": []}, [], 0, []
    covered, over_none = {"inside": [], "outside": []}, []
    errors = {"errors": [], "errors_conformal": []}
    intervals = {"width": [], "conformal": [], "score": []}
    over_best = {name: [] for name in names if name != "none"}
    with tempfile.TemporaryDirectory() as folder:
        for split in (data.further_splits if options.further else data.all_splits)(options.data):
            if options.splits not in split.name:
                continue
            figures = judge(options.program, split, names, pathlib.Path(folder) / split.name)
            best = min(figures[name] for name in names)
            for of in (ratios, over_best):
                for name, of_splits in of.items():
                    of_splits.append(figures[name] / best)
            worse += figures["inside"] > figures["none_inside"]
            for name in [*names, "fit", "diagnose"]:
                lines.append(f"{split.name}_{name} {figures[name]:.3f} um")
            for name, of_splits in ratios.items():
                lines.append(f"{split.name}_{name}_over_best_peer {of_splits[-1]:.3f} ratio")
            lines.append(f"{split.name}_diagnose_over_ridge "
                         f"{figures['diagnose'] / figures['ridge']:.3f} ratio")
            lines.append(f"{split.name}_family {figures['family']} name")
            lines.append(f"{split.name}_true_over_stated {figures['stated']:.3f} "
                         f"{'ratio' if figures['runs'] >= 3 else 'told_as_range'}")
            lines.append(f"{split.name}_fit_over_none {figures['fit'] / figures['none']:.3f} ratio")
            for where in ("inside", "outside"):
                covered[where].append(figures[f"covered_{where}"])
                lines.append(f"{split.name}_covered_{where} {covered[where][-1]:.3f} share")
            for name, of_splits in intervals.items():
                of_splits.append(figures.get(name, float("nan")))
            for name, of_splits in errors.items():
                of_splits += [figures[name]] if name in figures else []
            over_none.append(figures["fit"] / figures["none"])
            lines.append(f"{split.name}_width_over_conformal {intervals['width'][-1]:.2f} ratio")
            lines.append(f"{split.name}_interval_score_over_conformal "
                         f"{intervals['score'][-1]:.2f} ratio")
            if figures["runs"] >= 3:  # with fewer, `fit` gives a range in words
                stated.append(figures["stated"])
            lines.append(f"{split.name}_outside {figures['outside_share']:.3f} share")
            lines.append(f"{split.name}_fit_inside {figures['inside']:.3f} um")
            lines.append(f"{split.name}_fit_outside {figures['outside']:.3f} um")
            lines.append(f"{split.name}_fit_seconds {figures['seconds']:.1f} s")
            lines.append(f"{split.name}_diagnose_seconds {figures['diagnose_seconds']:.1f} s")
    print("\n".join(lines))
    for name, of_splits in {**over_best, **ratios}.items():
        print(f"{name}_over_best_peer_median {np.median(of_splits):.3f} ratio")
        print(f"{name}_over_best_peer_largest {max(of_splits):.3f} ratio")
        print(f"{name}_over_best_peer_mean {np.exp(np.mean(np.log(of_splits))):.3f} ratio")
    print(f"fit_over_none_largest {max(over_none):.3f} ratio")
    for where, of_splits in covered.items():
        print(f"covered_{where}_mean {np.nanmean(of_splits):.3f} share")
    print(f"width_over_conformal_median {np.nanmedian(intervals['width']):.2f} ratio")
    if errors["errors"]:
        wider, wider_conformal = (widening(of_splits) for of_splits in errors.values())
        print(f"widening_to_95 {wider:.2f} ratio")
        print(f"conformal_widening_to_95 {wider_conformal:.2f} ratio")
        print(f"width_over_conformal_at_95_median "
              f"{np.nanmedian(intervals['width']) * wider / wider_conformal:.2f} ratio")
    print(f"conformal_covered_mean {np.nanmean(intervals['conformal']):.3f} share")
    print(f"interval_score_over_conformal_median {np.nanmedian(intervals['score']):.2f} ratio")
    print(f"splits_worse_than_none_inside {worse} splits")
    right = sum(0.7 <= ratio <= 1.5 for ratio in stated)
    print(f"stated_figures_right {right} of_{len(stated)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
