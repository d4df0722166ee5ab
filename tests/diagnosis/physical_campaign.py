#!/usr/bin/python3
"""Hides effects that physics makes (physical_effects.py), lets the tool look at the files alone, and
counts what it says: cause and place right first, family, wrong names, by kind and by size.

physical_campaign.py PROGRAM [--cases N] [--levels 1,2] [--seed S] [--jobs 2] [--show]
                     [--json FILE] [--weighed]
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the jobs are the threads

# ruff: noqa: E402
import argparse
import json
import multiprocessing
import pathlib
import subprocess
import sys
import tempfile

import measured_campaign as measured
import physical_effects as physical
from measured_plants import FAMILIES


def examine(task):
    """@return the task as measured_campaign has it, truths (None: no machine carries it), answer"""
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


def tasks_of(options):
    levels = [int(level) for level in options.levels.split(",")]
    kinds, sizes = options.kinds.split(","), physical.SIZES
    return [(options.program, 1000 * options.seed + i, levels[(i // len(kinds)) % len(levels)],
             kinds[i % len(kinds)],
             sizes[(i // (len(kinds) * len(levels))) % len(sizes)])
            for i in range(options.cases)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--cases", type=int, default=228)
    parser.add_argument("--kinds", default=",".join(physical.KINDS))
    parser.add_argument("--levels", default="1,2,3")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--show", action="store_true")
    parser.add_argument("--json")
    parser.add_argument("--weighed", action="store_true")
    options = parser.parse_args()
    options.program = [str(pathlib.Path(options.program).resolve())]
    if options.weighed:
        options.program.append("--weighed")
    count, kept, left_out, wrong = measured.Count(), [], 0, 0
    with multiprocessing.Pool(options.jobs) as pool:
        for task, truths, answer in pool.imap(examine, tasks_of(options)):
            if answer is None:
                left_out += 1
                continue
            fine = count.add(task, truths, answer)
            first = answer["findings"][:1]
            wrong += bool(first) and not fine and first[0]["probability"] > measured.STATED
            kept.append(dict(machine=task[2], base=task[3], size=task[5], seed=task[1],
                             truth=truths[0], truths=truths, answer=answer))
            if options.show and not fine:
                print("  %d %s %s x%g: %s(%s) -> %s" % (
                    task[1], task[2], task[3], task[5], truths[0]["cause"], truths[0]["subject"],
                    measured.said(answer)), flush=True)
    count.report()
    print("wrong first names above %g: %d of %d" % (measured.STATED, wrong, len(kept)))
    print("%d cases that no machine carries were left out" % left_out)
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(kept))
    return 0


if __name__ == "__main__":
    sys.exit(main())
