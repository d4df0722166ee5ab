"""Physical effects (physical_effects.py); the tool gets only the files."""

import json
import pathlib
import subprocess
import tempfile

import measured_cases as measured  # first: sets the number of threads
import physical_effects as physical
from measured_plants import FAMILIES


def examine(task):
    """@return the task as in measured_campaign, truths (None: no machine carries it), answer"""
    program, seed, level, kind, times = task
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        case = physical.make(folder, seed, level, kind, times)
        named = (program, seed, "level %d" % level, kind, kind, times, "single")
        if case is None:
            return named, None, None
        truths = case.truth
        for truth in truths:
            truth["family"] = FAMILIES[truth["cause"]]
        truths = measured.with_groups(truths, case)
        done = subprocess.run(
            [*program[:1], "diagnose", "--model", "model.toml", "--train", "train_a.csv",
             "train_b.csv", "--test", "test.csv", *program[1:], "--json", "answer.json"],
            cwd=folder, capture_output=True, text=True)
        if done.returncode != 0:
            raise RuntimeError("%s: %s" % (task, done.stderr))
        answer = json.loads((folder / "answer.json").read_text())
        for finding in answer["findings"]:
            finding.setdefault("family", FAMILIES.get(finding["cause"]))
        return named, truths, answer
