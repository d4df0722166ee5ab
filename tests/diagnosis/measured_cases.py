"""One effect planted in data of real machines; the tool gets only files and model."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one thread per job

# ruff: noqa: E402
import json
import pathlib
import subprocess
import tempfile

import measured_machines
import numpy as np
from measured_plants import CAUSES, FAMILIES, Impossible, Planted

ATTEMPTS = 12
PROBED_EACH_S = 1800.0
STATED = 0.8  # a finding in untouched data with a higher probability is an error


def machine_of(name, random):
    return measured_machines.MACHINES[name](random)


def spared(machine, cause, random):
    """Temperature withheld from the model, if any."""
    if cause != "missing_temperature" and random.uniform() < 0.7:
        return ()
    if len(machine.temperatures) < 2:
        return ()
    return (str(random.choice(machine.temperatures)),)


def second_cause(first, random):
    family = lambda cause: FAMILIES["hysteresis" if cause.startswith("hysteresis") else cause]
    return str(random.choice([c for c in CAUSES if family(c) != family(first)]))


def planted_case(seed, machines, base, cause, times, kind):
    """Tries another machine if one cannot carry the cause.
    @return the machine with its effects, its model, and the truths
    @throws Impossible if no attempt can carry it"""
    for attempt in range(ATTEMPTS):
        random = np.random.default_rng([seed, attempt])
        machine = machine_of(str(random.choice(machines)), random)
        model = measured_machines.base_model(machine, base, spared(machine, cause, random))
        try:
            first = Planted(machine, model, cause, times, random)
            truths = [first.truth]
            if kind == "pair":
                other = second_cause(cause, random)
                truths.append(Planted(machine, model, other, times, random, first.size_um).truth)
            if kind == "sparse":
                machine.keep_probings(PROBED_EACH_S)
            return machine, model, truths
        except Impossible:
            continue
    raise Impossible


def untouched_case(seed, machines, base):
    random = np.random.default_rng([seed, 0])
    machine = machine_of(str(random.choice(machines)), random)
    return machine, measured_machines.base_model(machine, base, spared(machine, None, random))


def write(folder, machine, model):
    model.write(folder / "model.toml")
    train, test = [], []
    for number, (run, rows) in enumerate(zip(machine.runs, machine.train)):
        name = "run%d.csv" % number
        np.savetxt(folder / name, np.stack(list(run.values()), axis=1), fmt="%.8g", delimiter=",",
                   header=",".join(run), comments="")
        time_s = run["time_s"]
        if rows.stop == len(time_s):
            train.append(name)
        elif rows.stop:
            train.append("%s@:%g" % (name, time_s[rows.stop]))
            test.append("%s@%g:" % (name, time_s[rows.stop]))
        else:
            test.append(name)
    return ["--model", "model.toml", "--train", *train, "--test", *test]


def diagnosed(program, machine, model):
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        command = [program[0], "diagnose", *write(folder, machine, model), *program[1:], "--json",
                   "answer.json"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if done.returncode != 0:
            raise RuntimeError(" ".join(command) + ": " + done.stderr)
        return json.loads((folder / "answer.json").read_text())


def with_groups(truths, machine):
    """The truths with the places that cannot be distinguished from their subjects."""
    for truth in truths:
        truth["groups"] = [sorted(machine.group(p)) if p.endswith("_degC") else [p]
                           for p in truth["subject"].split("|")]
    return truths


def examine(task):
    """@return the task, the truths (None: untouched or impossible), the answer"""
    program, seed, machines, base, cause, times, kind = task
    named = lambda machine: (program, seed, machine.name, base, cause, times, kind)
    if cause is None:
        machine, model = untouched_case(seed, machines, base)
        if kind == "sparse":
            machine.keep_probings(PROBED_EACH_S)
        return named(machine), None, diagnosed(program, machine, model)
    try:
        machine, model, truths = planted_case(seed, machines, base, cause, times, kind)
    except Impossible:
        return task, None, None
    return named(machine), with_groups(truths, machine), diagnosed(program, machine, model)


def subject_right(subject, truth):
    places = subject.split("|")
    if len(places) != len(truth["groups"]):
        return False
    return any(all(p in g for p, g in zip(places, order))
               for order in (truth["groups"], truth["groups"][::-1]))


def right(finding, truth):
    return finding["cause"] == truth["cause"] and subject_right(finding["subject"], truth)


def summary(answer):
    found = answer["findings"]
    return ", ".join("%s(%s) %.2f" % (f["cause"], f["subject"], f.get("probability", np.nan))
                     for f in found) or answer["verdict"]
