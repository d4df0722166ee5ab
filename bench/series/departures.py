"""Machines of one type night by night: what departs, and what falsely does.

    departures.py PROGRAM

A series of eight machines; six others run healthy nights, and nights with an effect planted. Each is
compared with its sisters, and with its own past: three healthy nights before. A false alarm is a
night on which a healthy machine newly departs: nights that follow an alarm of the same machine are
the same one. Detection: nights from the effect to the alarm.
"""

import json
import pathlib
import sys
import tempfile

import numpy as np

import series
import series_type

NIGHTS = 40
BEGINS = 3  # healthy nights before, where a night is compared with the machine's own past
WATCHED = 5
KINDS = ("sisters", "own_past")
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


def own_past(tool, series_file, seed):
    """The series of one machine: its first nights, and what its sisters say of the rest."""
    machine, own = series_type.TypeMachine(seed), tool.path(".toml")
    past = [tool.written(machine.day(90 + night, HOURS)) for night in range(BEGINS)]
    tool.run("series", *past, "--machine", f"machine {seed}", "--prior", series_file, "-o", own)
    return own


def nights(tool, priors, seed, count, change=None):
    """Whether each night's run departs, one list a prior."""
    machine = series_type.TypeMachine(seed)
    said = [[] for _ in priors]
    for night in range(count):
        run, answer = tool.written(machine.day(100 + night, HOURS, change)), tool.path(".json")
        for prior, of_prior in zip(priors, said):
            tool.run("inspect", run, "--series", prior, "--json", answer, good=(0, 1))
            departure = json.loads(answer.read_text())["departure"]
            of_prior.append(any(each["departs"] for each in departure.values()))
        run.unlink()
    return said


def main():
    with tempfile.TemporaryDirectory() as folder:
        tool = series.Tool(sys.argv[1], pathlib.Path(folder))
        sisters = tool.path(".toml")
        tool.run("series", *series.simulated_sisters(tool), "--outputs", "z_um,y_um", "-o", sisters)
        priors = {seed: (sisters, own_past(tool, sisters, seed)) for seed in range(200, 206)}
        alarms, healthy = np.zeros(2), 0
        for seed in priors:
            both = nights(tool, priors[seed], seed, NIGHTS)
            alarms += [said[0] + sum(b and not a for a, b in zip(said, said[1:])) for said in both]
            healthy += NIGHTS
            print(f"healthy {seed}: {both}", file=sys.stderr)
        after = {}
        for name, change in EFFECTS.items():
            both = [nights(tool, priors[seed], seed, WATCHED, change) for seed in priors]
            for kind, said in zip(KINDS, zip(*both)):
                after[f"{name}_{kind}"] = [each.index(True) + 1 if True in each else np.nan
                                           for each in said]
            print(f"{name}: {both}", file=sys.stderr)
    for name, found in after.items():
        print(f"{name}_found {np.isfinite(found).mean():.3f} ratio")
        if np.isfinite(found).any():
            print(f"{name}_after {np.nanmedian(found):.3g} nights")
    for kind, count in zip(KINDS, alarms):
        print(f"{kind}_false_alarms_a_machine_year {365.0 * count / healthy:.3g} 1/year")


if __name__ == "__main__":
    main()
