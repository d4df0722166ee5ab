"""Machines of one type each night beside their sisters: what departs, and what falsely does.

    departures.py PROGRAM

Six machines run healthy nights, and nights with an effect planted from night 3 on, beside a series
of eight sisters, and beside a series of eight nights of their own before. A false alarm is a night on which a healthy machine newly departs: nights that follow an
alarm of the same machine are the same one. Detection: nights from the effect to the alarm.
"""

import json
import pathlib
import sys
import tempfile

import numpy as np

import series
import series_type

NIGHTS = 20
BEGINS = 3
HOURS = 8


def swapped(columns, _fields):
    columns["head_degC"], columns["screw_degC"] = columns["screw_degC"], columns["head_degC"]


def loose_sensor(columns, _fields):
    rise = columns["spindle_degC"] - columns["spindle_degC"][0]
    columns["spindle_degC"] = columns["spindle_degC"][0] + 0.6 * rise


def grown_expansion(columns, fields):
    """A joint that has come loose: the column's growth counts once more by half."""
    cells = series_type.plant.Machine.cells("column")
    rise = (fields[:, cells] - fields[0, cells]).mean(axis=1)
    columns["z_um"] = columns["z_um"] + 0.5 * 11.5 * rise


EFFECTS = {"swapped_sensors": swapped, "loose_sensor": loose_sensor, "column": grown_expansion}


def nights(tool, series_file, seed, count, change=None, begins=0):
    """Whether each night's run departs."""
    machine = series_type.TypeMachine(seed)
    said = []
    for night in range(count):
        run = tool.written(machine.day(100 + night, HOURS, change if night >= begins else None))
        answer = tool.path(".json")
        tool.run("inspect", run, "--series", series_file, "--json", answer, good=(0, 1))
        departure = json.loads(answer.read_text())["departure"]
        said.append(any(each["departs"] for each in departure.values()))
        run.unlink()
    return said


def judged(tool, kind, series_of, nights_of_healthy):
    """Prints what a series that `series_of(seed)` gives finds, and how often it errs."""
    alarms, healthy, found = 0, 0, {name: [] for name in EFFECTS}
    for seed in range(200, 206):
        series_file = series_of(seed)
        said = nights(tool, series_file, seed, nights_of_healthy)
        alarms += said[0] + sum(b and not a for a, b in zip(said, said[1:]))
        healthy += len(said)
        for name, change in EFFECTS.items():
            said = nights(tool, series_file, seed, BEGINS + 5, change, BEGINS)[BEGINS:]
            found[name].append(said.index(True) + 1 if True in said else np.nan)
    for name, after in found.items():
        print(f"{kind}_{name}_found {np.isfinite(after).mean():.3f} ratio")
        if np.isfinite(after).any():
            print(f"{kind}_{name}_after {np.nanmedian(after):.3g} nights")
    print(f"{kind}_false_alarms {365.0 * alarms / healthy:.3g} 1/year")


def main():
    with tempfile.TemporaryDirectory() as folder:
        tool = series.Tool(sys.argv[1], pathlib.Path(folder))
        sisters = tool.path(".toml")
        tool.run("series", *series.simulated_sisters(tool), "--outputs", "z_um,y_um", "-o", sisters)

        def own(seed):
            machine, result = series_type.TypeMachine(seed), tool.path(".toml")
            runs = [tool.written(machine.day(50 + night, HOURS)) for night in range(8)]
            tool.run("series", *runs, "--outputs", "z_um,y_um", "--scatter", 0.03, "-o", result)
            return result

        judged(tool, "sisters", lambda _seed: sisters, NIGHTS)
        judged(tool, "own", own, NIGHTS)


if __name__ == "__main__":
    main()
