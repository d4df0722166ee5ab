#!/usr/bin/python3
"""When to probe, and when the machine is warm, on simulated days of the demonstration's machine.

Probing: a month of 20 shifts with different speeds and ambient temperatures; a model fitted to
three other shifts. A probing removes the present error. Compared: probing each hour, and when the
model may have drifted by a limit since the last probing (daemon/status/warm_up.hpp), with the limit
that gives the same error. Warm: 20 days of constant load; the daemon's and the true minutes.

    when_to_probe.py BIN
"""
import csv
import math
import pathlib
import random
import re
import statistics
import subprocess
import sys
import tempfile
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(sys.argv[1])
MACHINE = (ROOT / "config/demo/machine.toml").read_text()
DAYS, TRAINED, AXES = 20, 3, ("x", "y", "z")
WARM_UM = 5.0
CONSTANT_RPM, CONSTANT_FEED = "[[signal]]\nname = \"spindle_rpm\"\nkind = \"steps\"\ntimes_s = [0, 900]\nvalues = [0, {}]\n", \
    "[[signal]]\nname = \"feed_mm_per_min\"\nkind = \"steps\"\ntimes_s = [0, 900]\nvalues = [0, {}]\n"


def run(*arguments):
    done = subprocess.run([str(each) for each in arguments], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{arguments}: {done.stderr}")
    return done.stdout


def room(text, chance):
    text = re.sub(r"mean_degC = 21.0", f"mean_degC = {chance.uniform(19, 23):.2f}", text)
    return re.sub(r"daily_swing_K = 3.0", f"daily_swing_K = {chance.uniform(1, 5):.2f}", text)


def shift(seed):
    """Another job: other speeds and feeds at the same times."""
    chance = random.Random(seed)
    text = room(MACHINE, chance)
    factor = lambda value: str(round(int(value) * chance.uniform(0.3, 1.2)))
    return re.sub(r"values = \[(0, \d{4}.*?)\]", lambda found: "values = [" + ", ".join(
        factor(value) for value in found[1].split(", ")) + "]", text)


def constant_day(seed):
    chance = random.Random(1000 + seed)
    text = room(MACHINE, chance)
    for name, new in (("spindle_rpm", CONSTANT_RPM.format(chance.randint(2000, 9000))),
                      ("feed_mm_per_min", CONSTANT_FEED.format(chance.randint(500, 6000)))):
        text = re.sub(rf'\[\[signal\]\]\nname = "{name}".*?repeat_s = 7200\n', new, text, flags=re.S)
    text = re.sub(r"\[\[room.draught\]\].*?change_K = -1.5\n", "", text, flags=re.S)
    text = re.sub(r"daily_swing_K = [\d.]+", "daily_swing_K = 0.0", text)
    return text.replace("duration_h = 8.0", "duration_h = 12.0")


def simulated(folder, name, text, seed):
    machine = folder / f"{name}.toml"
    machine.write_text(text.replace('"plant.toml"', f'"{ROOT / "config/demo/plant.toml"}"'))
    run(BIN / "thermocomp", "simulate", machine, "--seed", seed, "-o", folder / f"{name}.csv")
    return folder / f"{name}.csv"


def columns(path):
    with path.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return {key: [float(row[key] or "nan") for row in rows] for key in rows[0]}


def probed(days, due):
    """RMS of the remaining error, and count of probings. A day begins with offset zero and no probing."""
    squares, count, probings = 0.0, 0, 0
    for time_s, measured, predicted in days:
        bias, at_s, at_um = 0.0, time_s[0], predicted[0]
        for now_s, measured_um, predicted_um in zip(time_s, measured, predicted):
            if due(now_s - at_s, abs(predicted_um - at_um)):
                bias, at_s, at_um = measured_um - predicted_um, now_s, predicted_um
                probings += 1
            squares += (measured_um - predicted_um - bias) ** 2
            count += 1
    return math.sqrt(squares / count), probings


def when_to_probe(folder):
    train = [simulated(folder, f"train{i}", shift(500 + i), 500 + i) for i in range(TRAINED)]
    model = folder / "model.toml"
    run(BIN / "thermocomp-modelling", "fit", *train, "--outputs", ",".join(f"{a}_um" for a in AXES), "-o", model)
    with model.open("rb") as file:
        claims = tomllib.load(file)["made_from"]["output"]
    days = {axis: [] for axis in AXES}
    for day in range(DAYS):
        path = simulated(folder, f"day{day}", shift(day), day)
        run(BIN / "thermocomp", "predict", "--model", model, path, "-o", folder / "out.csv")
        measured, predicted = columns(path), columns(folder / "out.csv")
        for axis in AXES:
            days[axis].append((measured["time_s"], measured[f"{axis}_um"], predicted[f"{axis}_predicted_um"]))
    for axis in AXES:
        claim = claims[f"{axis}_um"]
        share = claim["left_out_rms_um"] / claim["no_model_rms_um"]
        none_um, _ = probed(days[axis], lambda age_s, moved_um: False)
        hourly_um, hourly = probed(days[axis], lambda age_s, moved_um: age_s >= 3600)
        low, high = 0.01, 50.0  # limits with a smaller and a larger error than hourly probing
        for _ in range(30):
            middle = math.sqrt(low * high)
            left_um, _ = probed(days[axis], lambda age_s, moved_um: share * moved_um > middle)
            low, high = (middle, high) if left_um < hourly_um else (low, middle)
        left_um, needed = probed(days[axis], lambda age_s, moved_um: share * moved_um > low)
        print(f"{axis}: without {none_um:.2f} um; each hour {hourly_um:.2f} um, {hourly} probings; "
              f"when due (beyond {low:.2f} um) {left_um:.2f} um, {needed} probings", file=sys.stderr)
        print(f"probe_due.{axis} {needed / hourly:.2f} of hourly probings")


def warm(folder):
    files = [simulated(folder, f"constant{i}", constant_day(i), i) for i in range(DAYS)]
    lines = run(BIN / "bench_warm_up", "z_um", WARM_UM, *files).splitlines()
    off, first, unknown = [], [], 0
    for file in files:
        rows = [[float(each) for each in line.split()[1:]] for line in lines if line.split()[0] == str(file)]
        known = [(said, true) for minute, said, true in rows if not math.isnan(said) and true > 0]
        unknown += sum(math.isnan(said) for _, said, _ in rows)
        off += [said - true for said, true in known]
        became = next(minute for minute, said, _ in rows if said == 0)
        first.append(became - (rows[0][2]))
    print(f"warm: {len(off)} moments, {unknown} not known; minutes said less true: quartiles "
          f"{[round(each, 1) for each in statistics.quantiles(off, n=4)]}, worst {min(off):.0f}, {max(off):.0f}",
          file=sys.stderr)
    print(f"warm.median_off {statistics.median(abs(each) for each in off):.1f} min")
    print(f"warm.called_warm_early_worst {-min(first):.0f} min")
    print(f"warm.called_warm_late_worst {max(first):.0f} min")


def main():
    folder = pathlib.Path(tempfile.mkdtemp(prefix="probe"))
    when_to_probe(folder)
    warm(folder)


main()
