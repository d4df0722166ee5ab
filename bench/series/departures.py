"""Workshops of machines of one type night by night: departures, their delay, and false alarms.

    departures.py PROGRAM [--workshops N] [--first SEED]

Compared like in `thermocomp-fleet night`: twelve machines per workshop, nights of 24 h with a
probing every 10 min; after seven nights a series of the sisters (the other half of the workshop)
and one of the machine's own past. A false alarm: a healthy machine departs that did not the night
before. Planted effects: nights from the effect to the alarm, on every machine of every third
workshop. `2_nights`: an alarm only in the second consecutive night.
"""

import argparse
import json
import pathlib
import sys
import tempfile

import numpy as np

import series  # first: sets the path of the next two
import measured_data
import series_type

MACHINES = 12
PAST = 7
HEALTHY = 10  # nights
WATCHED = 5  # nights with an effect
PROBE_EVERY_MIN = 10
PLAY_UM = 8.0


def swapped(columns, _fields, _night):
    columns["head_degC"], columns["screw_degC"] = columns["screw_degC"], columns["head_degC"]


def scaled_rise(columns, place, scale):
    columns[place] = columns[place][0] + scale * (columns[place] - columns[place][0])


def loose_sensor(columns, _fields, _night):
    scaled_rise(columns, "spindle_degC", 0.6)


def ageing(columns, _fields, night):
    """A sensor that loses 5 % of its rise each night."""
    scaled_rise(columns, "spindle_degC", 1.0 - 0.05 * (night + 1))


def grown_expansion(columns, fields, _night=0, share=0.5):
    """A joint that has come loose: the column's growth counts half as much again."""
    cells = series_type.plant.Machine.cells("column")
    rise = (fields[:, cells] - fields[0, cells]).mean(axis=1)
    columns["z_um"] = columns["z_um"] + share * 11.5 * rise


def grown_little(columns, fields, _night):
    grown_expansion(columns, fields, share=0.2)


def play(columns, _fields, _night):
    """A guide with a backlash of PLAY_UM."""
    at, followed = columns["z_um"][0], []
    for value in columns["z_um"]:
        at = min(max(at, value - PLAY_UM / 2), value + PLAY_UM / 2)
        followed.append(at)
    columns["z_um"] = np.array(followed)


EFFECTS = {"swapped_sensors": swapped, "loose_sensor": loose_sensor, "ageing_sensor": ageing,
           "column_0.5": grown_expansion, "column_0.2": grown_little, "play": play}


class Workshop:
    def __init__(self, tool, first_seed):
        self.tool = tool
        self.seeds = range(first_seed, first_seed + MACHINES)
        past = {seed: [self.night(seed, night) for night in range(PAST)] for seed in self.seeds}
        statistics = {}
        for seed in self.seeds:
            statistics[seed] = tool.path(".toml")
            tool.run("series", "--machine", f"machine {seed}", *past[seed], "-o", statistics[seed])
        sisters = [tool.path(".toml") for _ in range(2)]
        for group in range(2):
            tool.run("series", "-o", sisters[group],
                     *(statistics[seed] for seed in self.seeds if seed % 2 != group))
        self.priors = {}
        for seed in self.seeds:
            own = tool.path(".toml")
            tool.run("series", "--machine", "its past", "--prior", sisters[seed % 2], "-o", own,
                     *past[seed])
            self.priors[seed] = (sisters[seed % 2], own)

    def night(self, seed, night, effect=None, since=0):
        change = effect and (lambda columns, fields: effect(columns, fields, night - since))
        columns = series_type.TypeMachine(seed).day(night, 24, change)
        for output in series_type.plant.OUTPUTS:
            columns[output][np.arange(len(columns["time_s"])) % PROBE_EVERY_MIN != 0] = np.nan
        path = self.tool.path(".csv")
        measured_data.write(measured_data.Run("", columns), path)
        return path

    def departs(self, seed, nights, effect=None):
        """Departures from sisters and from its own past, shape (nights, 2)."""
        said = []
        for night in nights:
            run, answer = self.night(seed, night, effect, nights[0]), self.tool.path(".json")
            of_night = []
            for prior in self.priors[seed]:
                self.tool.run("inspect", run, "--series", prior, "--json", answer, good=(0, 1))
                departure = json.loads(answer.read_text())["departure"]
                of_night.append(any(each["departs"] for each in departure.values()))
            run.unlink()
            said.append(of_night)
        return np.array(said)


def rules(said):
    """One row per rule: alarms by night."""
    either = said.any(axis=1)
    return {"sisters": said[:, 0], "own_past": said[:, 1], "either": either,
            "2_nights": either & np.concatenate([[False], either[:-1]])}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--workshops", type=int, default=12)
    parser.add_argument("--first", type=int, default=5000)
    options = parser.parse_args()
    alarms, healthy = {}, 0
    found = {}
    for workshop in range(options.workshops):
        with tempfile.TemporaryDirectory() as folder:
            shop = Workshop(series.Tool(options.program, pathlib.Path(folder)),
                            options.first + workshop * MACHINES)
            for seed in shop.seeds:
                for rule, said in rules(shop.departs(seed, range(PAST, PAST + HEALTHY))).items():
                    new = said & ~np.concatenate([[False], said[:-1]])
                    alarms[rule] = alarms.get(rule, 0) + int(new.sum())
                healthy += HEALTHY
                if workshop % 3 != 0:
                    continue
                for name, effect in EFFECTS.items():
                    nights = range(PAST + 20, PAST + 20 + WATCHED)
                    for rule, said in rules(shop.departs(seed, nights, effect)).items():
                        found.setdefault((name, rule), []).append(
                            1 + int(np.argmax(said)) if said.any() else np.inf)
        print(f"workshop {workshop}: {alarms} in {healthy} machine-nights", file=sys.stderr)
    for (name, rule), nights in found.items():
        print(f"{name}_{rule}_found {np.isfinite(nights).mean():.3f} ratio")
        if np.isfinite(np.median(nights)):
            print(f"{name}_{rule}_after {np.median(nights):.3g} nights")
    print(f"healthy {healthy} machine-nights")
    for rule, count in alarms.items():
        print(f"{rule}_false_alarms {count} alarms")
        print(f"{rule}_false_alarms_a_machine_year {365.0 * count / healthy:.3g} 1/year")


if __name__ == "__main__":
    main()
