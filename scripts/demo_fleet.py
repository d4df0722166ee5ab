#!/usr/bin/python3
"""Twelve simulated machines of one type, two weeks, one store: departures with reasons, the gain of
a new machine, and the rollout and rollback of its better model.

    scripts/demo_fleet.py BIN OUT

Starts a private PostgreSQL, which ends with it. Machine 5 gets an effect unknown to its model in
the second week, and the sensor at the spindle of machine 9 ages from then on. Writes OUT/fleet.png
and OUT/fleet.svg.
"""
import datetime
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parents[1]
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["THERMOCOMP_BIN"] = str(pathlib.Path(sys.argv[1]).resolve())
sys.path[:0] = [str(HERE / path) for path in ("tests/integration/fleet", "tests/integration/daemon", "bench/series",
                                              "bench/measured")]

# ruff: noqa: E402
import numpy as np

import demo_release
import measured_data
import series
import series_type
from departures import grown_expansion
from postgres import Postgres

MACHINES, DAYS, BEGINS = 12, 14, 9
PROBE_EVERY_MIN = 10
HIDDEN, AGEING = 5, 9
OUTPUTS = ["z_um", "y_um"]
NEW = series_type.TypeMachine(77)
TODAY = datetime.datetime.now(datetime.timezone.utc).date()


def ageing(day):
    """The sensor shows less of its rise each day."""
    def change(columns, _fields):
        rise = columns["spindle_degC"] - columns["spindle_degC"][0]
        columns["spindle_degC"] = columns["spindle_degC"][0] + (1.0 - 0.15 * (day - BEGINS + 1)) * rise
    return change


def day_of(machine, day):
    """Columns of a run, probed every ten minutes."""
    change = None
    if day >= BEGINS and machine == HIDDEN:
        change = grown_expansion
    if day >= BEGINS and machine == AGEING:
        change = ageing(day)
    columns = series_type.TypeMachine(machine).day(day, 24, change)
    for output in OUTPUTS:
        columns[output][np.arange(len(columns["time_s"])) % PROBE_EVERY_MIN != 0] = np.nan
    return columns


class Workshop:
    def __init__(self, programs, server, folder):
        self.programs, self.server, self.folder = programs, server, folder
        self.tool = series.Tool(str(programs / "thermocomp"), folder)
        server.create_database()
        self.fleet("init")
        self.add()

    def fleet(self, *arguments, show=False, good=(0,)):
        command = [str(self.programs / "thermocomp-fleet"), "--store", self.server.local(), *map(str, arguments)]
        done = subprocess.run(command, stdout=None if show else subprocess.PIPE, text=True)
        assert done.returncode in good, command
        return done.stdout

    def add(self):
        for machine in range(MACHINES):
            self.fleet("add", f"mill_{machine}", "--type", "mill", "--hall", 1 + machine // 6, "-o",
                       self.folder / f"{machine}.password")

    def load(self, days, *, with_model=False):
        """The model in use is the machine's own fit to its first day; the base model of the slow `diagnose`."""
        run = self.folder / "day.csv"
        for machine in range(MACHINES):
            for day in days:
                more = []
                if with_model:
                    measured_data.write(measured_data.Run("", day_of(machine, 0)), run)
                    more = ["--model", self.tool.fit([run], OUTPUTS)]
                measured_data.write(measured_data.Run("", day_of(machine, day)), run)
                begin = TODAY - datetime.timedelta(days=DAYS - day)
                self.fleet("load", f"mill_{machine}", run, "--begin", f"{begin}T00:00:00Z", *more)

    def results(self):
        """{machine: [(day, departs, probability, answer)]}"""
        found = {}
        for name, day, departs, probability, answer in self.server.ask(
                "SELECT name, night - current_date + " f"{DAYS}, departs, probability, departure FROM fleet.night_result "
                "JOIN fleet.machine ON id = machine WHERE departs IS NOT NULL ORDER BY 1, 2"):
            found.setdefault(int(name.split("_")[1]), []).append(
                (int(day), departs == "t", float(probability), json.loads(answer)))
        return found

    def print_diagnosis(self):
        for name, answer in self.server.ask("SELECT name, diagnosis FROM fleet.night_result JOIN fleet.machine "
                                            "ON id = machine WHERE diagnosis IS NOT NULL ORDER BY id"):
            found = json.loads(answer)
            named = [f"{finding['cause']} of {finding['subject']} ({finding['probability']:.2f})"
                     for finding in found["findings"]]
            print(f"diagnose of {name}'s last night: {', '.join(named) or found['verdict']}")


def reason(answer):
    """The subject with the largest share, of the output and comparison that departs most."""
    departing = [(output["probability"], f"{name} from its {kind.replace('_', ' ')}", output["subjects"])
                 for kind in ("sisters", "own_past") for name, output in answer.get(kind, {}).items()
                 if output["departs"]]
    _, what, subjects = min(departing, key=lambda each: each[0])
    if not subjects:
        return f"{what}: its residual is larger than its sisters'"
    return f"{what}: {subjects[0]['subject']}, {subjects[0]['effect_um']:.1f} um"


def print_departing(found):
    for machine, nights in sorted(found.items()):
        alarms = [(day, answer) for day, departs, _, answer in nights if departs]
        planted = {HIDDEN: "its column expands more from day 10 on",
                   AGEING: "its spindle's sensor ages from day 10 on"}.get(machine, "nothing")
        if alarms:
            day, answer = alarms[0]
            print(f"mill_{machine}: departs on {len(alarms)} of {len(nights)} nights, first on day {day + 1}: "
                  f"{reason(answer)} (planted: {planted})")
        elif machine in (HIDDEN, AGEING):
            print(f"mill_{machine}: NOT FOUND in {len(nights)} nights (planted: {planted})")
    healthy = [departs for machine, nights in found.items() if machine not in (HIDDEN, AGEING)
               for _, departs, _, _ in nights]
    print(f"the others: {sum(healthy)} of {len(healthy)} nights depart")


def new_machine(workshop, folder):
    """RMS on unseen days, with one probed day: (own fit, type's mean, both); models of own and both."""
    type_file = folder / "type.toml"
    type_file.write_text(json.loads(workshop.server.value(
        "SELECT to_json(content) FROM fleet.series WHERE kind = 'type' ORDER BY through LIMIT 1")))
    tool = workshop.tool
    train = [tool.written(NEW.day(0, 8))]
    test = [tool.written(NEW.day(day, 24)) for day in range(1, 5)]
    models = tool.fit(train, OUTPUTS), tool.fit(train, OUTPUTS, "--prior", type_file)
    own, both = (tool.residuals(model, test, OUTPUTS)[0] for model in models)
    return [float(np.mean(each)) for each in (own, series.mean_rms(type_file, test, OUTPUTS), both)], models


def draw(found, errors, out):
    with tempfile.TemporaryDirectory() as folder:
        nights, bars = pathlib.Path(folder) / "nights", pathlib.Path(folder) / "bars"
        nights.write_text("".join(f"{day + 1} {machine} {min(12, -math.log10(max(probability, 1e-12)))}\n"
                                  for machine, each in found.items() for day, _, probability, _ in each))
        bars.write_text("".join(f'"{name}" {value}\n' for name, value in
                                zip(("its own day", "its sisters", "both"), errors)))
        for form, terminal in (("png", "pngcairo size 1100,450"), ("svg", "svg size 1100,450")):
            subprocess.run(["gnuplot"], text=True, check=True, input=f"""
                set terminal {terminal}; set output "{out}/fleet.{form}"; set multiplot layout 1,2
                set title "how unusual a night is, -log10 p"; set xlabel "day"; set ylabel "machine"
                set palette defined (0 "#f4f6f8", 3 "#f2c14e", 12 "#b3261e"); set cbrange [0:12]
                set xrange [7.5:{DAYS - 0.5}]; set yrange [-0.6:{MACHINES - 0.4}]; set ytics 1; set key off
                plot "{nights}" using 1:2:3 with points pointtype 5 pointsize 2.4 palette
                set title "error of a new machine with 8 h of data"; set xlabel ""; set ylabel "RMS, um"
                set xrange [*:*]; set yrange [0:*]; set ytics auto; set style fill solid; set boxwidth 0.6; unset colorbox
                plot "{bars}" using 0:2:xtic(1) with boxes linecolor rgb "#33658a"
                """)


def main():
    programs, out = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
    out.mkdir(exist_ok=True)
    server = Postgres()
    try:
        server.require_tls()
        server.start()
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            workshop = Workshop(programs, server, folder)
            print(f"== {MACHINES} machines, {DAYS} days each, probed every {PROBE_EVERY_MIN} min", flush=True)
            workshop.load(range(DAYS - 1))
            print("== the nights", flush=True)
            with (out / "fleet_nights.log").open("w") as log:
                log.write(workshop.fleet("night", "--nights", DAYS + 1, good=(0, 1)))
                workshop.load([DAYS - 1], with_model=True)
                log.write(workshop.fleet("night", "--nights", DAYS + 1, good=(0, 1)))
            workshop.fleet("status", show=True, good=(0, 1))
            found = workshop.results()
            print_departing(found)
            workshop.print_diagnosis()
            print("== a new machine", flush=True)
            errors, (own, both) = new_machine(workshop, folder)
            print("a new machine with 8 h of data, RMS on four other days: "
                  + ", ".join(f"{name} {value:.2f} um" for name, value in
                              zip(("own fit", "mean of its sisters", "both"), errors)))
            print("== a release: its day in 48 s, a model of the office on it and off again", flush=True)
            measured_data.write(measured_data.Run("", day_of(HIDDEN, DAYS - 1)), folder / "day.csv")
            demo_release.show(programs, workshop, folder / "mill_12", NEW.day(2, 8), own, both,
                              workshop.tool.fit([folder / "day.csv"], OUTPUTS))
            draw(found, errors, out)
            print(f"picture: {out}/fleet.png and {out}/fleet.svg, nights: {out}/fleet_nights.log")
    finally:
        server.end()


if __name__ == "__main__":
    main()
