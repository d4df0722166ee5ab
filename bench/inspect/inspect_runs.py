"""Plants a fault of one reading (2 K jump, 4 K creep, 0.4 of the motion left, 3 K spikes, a stuck
channel, 20 times the noise, tenfold or negative) or displacement (a jump, one value for a while,
tenfold or negative beside the machine's other runs), or a time in minutes beside them, into each measured recording and runs `thermocomp inspect`.
Right: the most likely finding of 0.5 or more that the unchanged recording lacks names column and
kind. `--scores FILE` writes all scores, from which probability.cpp was set."""

import csv
import json
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import time

SOURCE = pathlib.Path(__file__).resolve().parents[2]
DATA = pathlib.Path(os.environ.get("THERMOCOMP_DATA", SOURCE.parent / "shared" / "data"))
PROGRAM = pathlib.Path(os.environ["THERMOCOMP_BENCH_BUILD"]) / "bin" / "thermocomp-modelling"
KINDS = ("sensor_step", "sensor_drift", "sensor_loose", "spikes", "stuck", "displacement_step",
         "noise", "frozen", "unit", "scale", "minutes")
FOUND_AS = {"spikes": ("spikes", "outliers"), "frozen": ("stuck",), "scale": ("unit",),
            "minutes": ("clock",)}
BESIDE = ("scale", "minutes")  # with the other recordings of the machine
FACTS = ("gap", "coarse", "copy")
SEEDS = 25
CASES = 2  # of each kind on each recording
MINUTE_S = 60.0


def read(path):
    with path.open() as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    names = rows[0]
    return {name: [float(row[i]) if row[i] else math.nan for row in rows[1:]]
            for i, name in enumerate(names)}


def thinned(run, step_s):
    kept, last = [], -math.inf
    for row, time_s in enumerate(run["time_s"]):
        if time_s - last >= step_s - 1e-6:
            kept.append(row)
            last = time_s
    return {name: [column[row] for row in kept] for name, column in run.items()}


def part(run, from_s, to_s):
    kept = [row for row, time_s in enumerate(run["time_s"]) if from_s <= time_s < to_s]
    return {name: [column[row] for row in kept] for name, column in run.items()}


def recordings():
    """(machine, name, run), without the hours used for evaluation."""
    spindle = thinned(read(DATA / "spindle_46h" / "hours_00_32.csv"), MINUTE_S)
    yield "spindle", "hours 0-16", part(spindle, 0, 57600)
    yield "spindle", "hours 16-32", part(spindle, 57600, 1e9)
    yield "printer", "morning", read(DATA / "printer_frame" / "2021-06-13_morning.csv")
    for name in ("Q30_S001_1C", "Q30_S001_3C", "Q30_S002_2C", "Q30_S002_C10"):
        yield "cell", name, read(DATA / "cell_under_load" / f"{name}.csv")
    for night in ("05-31", "06-01"):
        yield "mirror", night, read(DATA / "mirror_focus" / f"binospec_2019-{night}.csv")
    for name in ("sci_A", "sci_B", "sci_C", "skye_A", "skye_B", "skye_C"):
        yield "telescope", name, read(DATA / "telescope_focus" / f"{name}.csv")


def write(run, path):
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(run)
        for values in zip(*run.values()):
            writer.writerow("" if math.isnan(value) else repr(value) for value in values)


def planted(run, kind, chance):
    """(run with the fault, column, at_s); None if the recording has no such column."""
    displacement = kind in ("displacement_step", "frozen", "scale")
    columns = [n for n in run if (n.endswith("_um") if displacement else n.endswith("_degC"))
               and "target" not in n and max(run[n]) > min(run[n])]
    if not columns:
        return None
    name = chance.choice(columns)
    rows = len(run["time_s"])
    at = chance.randrange(int(0.15 * rows), int(0.85 * rows))
    values = list(run[name])
    after = range(at, rows)
    if kind == "sensor_step":
        size = chance.choice((-2.0, 2.0))
        values = [v + size * (i >= at) for i, v in enumerate(values)]
    elif kind == "displacement_step":
        spread = (sum(v * v for v in values) / rows - (sum(values) / rows) ** 2) ** 0.5
        values = [v + 0.5 * spread * (i >= at) for i, v in enumerate(values)]
    elif kind == "sensor_drift":
        at = chance.choice((0, at // 2))
        first, last = run["time_s"][at], run["time_s"][-1]
        size = chance.choice((-4.0, 4.0))
        values = [v + size * max(0.0, t - first) / (last - first)
                  for v, t in zip(values, run["time_s"])]
    elif kind == "sensor_loose":
        room = values[0]
        if max(values[at:]) - min(values[at:]) < 2.0:
            return None
        for i in after:
            values[i] = room + 0.4 * (values[i] - room)
    elif kind == "spikes":
        for i in chance.sample(range(10, rows - 10), 3):
            values[i] += chance.choice((-3.0, 3.0))
    elif kind == "noise":
        bends = sorted(abs(a - 2 * b + c) for a, b, c in zip(values, values[1:], values[2:]))
        deviation = max(20 * 0.605 * bends[len(bends) // 2], 0.2)
        for i in range(at, min(rows, at + rows // 8)):
            values[i] += chance.gauss(0, deviation)
    elif kind in ("unit", "scale"):
        factor = chance.choice((10.0, -1.0))
        values = [factor * v for v in values]
    elif kind == "minutes":
        first = run["time_s"][0]
        times = [(t - first) / 60 for t in run["time_s"]]
        return {**run, "time_s": times}, None, first
    elif kind in ("stuck", "frozen"):
        end = min(rows, at + rows // 5)
        values[at:end] = [values[at]] * (end - at)
    return {**run, name: values}, name, run["time_s"][at]


def inspect(run, folder, beside=()):
    paths = [folder / f"run{i}.csv" for i in range(1 + len(beside))]
    for path, each in zip(paths, (*beside, run)):
        write(each, path)
    done = subprocess.run([PROGRAM, "inspect", *paths, "--all", "--json", "-"],
                          capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stderr)
    findings = json.loads(done.stdout)["findings"]
    return [f for f in findings if f["run"].endswith(paths[-1].name)]


def simulated(folder):
    """Runs of the example and of the demonstration, without faults."""
    path = folder / "simulated.csv"
    for machine in ("examples", "demo"):
        for seed in range(1, SEEDS + 1):
            subprocess.run([PROGRAM.with_name("thermocomp"), "simulate",
                            SOURCE / "config" / machine / "machine.toml", "--seed", str(seed),
                            "-o", path], check=True)
            yield read(path)


def count_clean(machine, run, findings, sensor_days, named):
    """Findings of 0.8 or more, except facts about the file."""
    days = (run["time_s"][-1] - run["time_s"][0]) / 86400
    columns = sum(n.endswith(("_degC", "_K", "_um")) for n in run)
    sensor_days[machine] = sensor_days.get(machine, 0.0) + days * columns
    named[machine] = named.get(machine, 0) + sum(
        f["probability"] >= 0.8 and f["kind"] not in FACTS for f in findings)


def main():
    scores = []
    table = {}
    false_named, untouched_named, untouched_columns = 0, 0, 0
    sensor_days, clean_named = {}, {}
    cases, named_beside = 0, 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        chance = random.Random(14)
        measured = list(recordings())
        for machine, name, run in measured:
            beside = [other for also, _, other in measured
                      if also == machine and other is not run and list(other) == list(run)][:2]
            before = inspect(run, folder)
            with_others = inspect(run, folder, beside)
            named_beside += sum(f["probability"] >= 0.8 and f["kind"] not in FACTS and
                                (f["kind"], f["column"]) not in
                                {(b["kind"], b["column"]) for b in before} for f in with_others)
            count_clean(machine, run, before, sensor_days, clean_named)
            told = {(f["kind"], f["column"]) for f in before + with_others if f["probability"] >= 0.5}
            judged = {(f["kind"], f["column"]) for f in before
                      if f["probability"] >= 0.5 and f["kind"] in KINDS}
            untouched_named += len(judged)
            untouched_columns += sum(n.endswith(("_degC", "_um")) for n in run)
            print(machine, name, "untouched:", sorted(map(str, told)), file=sys.stderr)
            scores += [{"machine": machine, "run": name, "planted": None, **f} for f in before]
            for kind in KINDS:
                for _ in range(CASES):
                    case = planted(run, kind, chance)
                    if case is None or (kind in BESIDE and not beside):
                        continue
                    changed, column, at_s = case
                    found = inspect(changed, folder, beside if kind in BESIDE else ())
                    scores += [{"machine": machine, "run": name, "planted": [kind, column, at_s],
                                **f} for f in found]
                    named = [f for f in found if f["probability"] >= 0.5
                             and (f["kind"], f["column"]) not in told]
                    accepted = FOUND_AS.get(kind, (kind,))
                    right = any(f["kind"] in accepted and f["column"] == column for f in named)
                    of_column = any(f["column"] == column for f in named)
                    wrong = sum(f["column"] not in (column, None) and f["kind"] in KINDS for f in named)
                    cell = table.setdefault((machine, kind), [0, 0, 0, 0])
                    for i, value in enumerate((1, right, of_column, wrong)):
                        cell[i] += value
                    cases += 1
                    false_named += wrong
        for machine in ("probe_drift", "printer_other"):
            for path in sorted((DATA / machine).glob("*.csv")):
                run = read(path)
                count_clean(machine, run, inspect(run, folder), sensor_days, clean_named)
        for run in simulated(folder):
            count_clean("simulated", run, inspect(run, folder), sensor_days, clean_named)
        whole = read(DATA / "spindle_46h" / "hours_00_32.csv")
        start = time.monotonic()
        inspect(whole, folder)
        seconds = time.monotonic() - start
    print("machine    planted            cases  right  column  others", file=sys.stderr)
    for (machine, kind), (count, right, column, wrong) in table.items():
        print(f"{machine:10} {kind:18} {count:5} {right:6} {column:7} {wrong:7}", file=sys.stderr)
    if "--scores" in sys.argv:
        pathlib.Path(sys.argv[sys.argv.index("--scores") + 1]).write_text(json.dumps(scores))
    for kind in KINDS:
        rows = [cell for (_, each), cell in table.items() if each == kind]
        count = sum(cell[0] for cell in rows)
        print(f"found_{kind} {100 * sum(cell[1] for cell in rows) / max(count, 1):.0f} %")
    print(f"cases {cases} count")
    print(f"named_besides_per_case {false_named / cases:.2f} ratio")
    print(f"named_on_untouched_columns {100 * untouched_named / untouched_columns:.1f} %")
    for machine, days in sensor_days.items():
        print(f"clean_{machine}_named {clean_named[machine]} in_{days:.0f}_sensor_days")
    print(f"named_beside_other_runs {named_beside} count")
    print(f"inspect_spindle_32h_22_columns {seconds:.2f} s")


if __name__ == "__main__":
    main()
