#!/usr/bin/python3
"""Changes the heat flow of machines by seed, lets the tool look at files and network alone, and counts
what it says.

thermal_campaign.py PROGRAM [--cases N] [--null N] [--outside N] [--double N] [--levels 1,2,3]
                    [--seed S] [--jobs 2] [--keep FOLDER] [--show]
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the jobs are the threads

# ruff: noqa: E402
import json
import multiprocessing
import pathlib
import sys
import tempfile

import numpy as np

import campaign
import hidden_heat as hidden

CAUSES = hidden.CAUSES + hidden.FAULTS


def examine(task):
    """@return (task, what was hidden, the answer)"""
    program, keep, _, level, seed, causes = task
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(keep or temporary) / ("%d_%d_%s" % (level, seed, "+".join(causes)))
        facts = folder / "truth.json"
        if not facts.exists():
            hidden.make(folder, seed, level, causes)
        answer = campaign.diagnose(program, folder, ("--thermal", "machine.toml"))
        return task, json.loads(facts.read_text()), answer


def tasks_of(program, options, level):
    kinds = [("single", 0, options.cases, lambda i: [CAUSES[i % len(CAUSES)]]),
             ("null", campaign.NULL_SEED, options.null, lambda i: []),
             ("outside", campaign.OUTSIDE_SEED, options.outside,
              lambda i: [hidden.OUTSIDE[i % len(hidden.OUTSIDE)]]),
             ("double", campaign.DOUBLE_SEED, options.double,
              lambda i: [str(c) for c in np.random.default_rng(i + 7).choice(
                  hidden.CAUSES, 2, replace=False)])]
    return [(program, options.keep, kind, level, base + options.seed + i, causes(i))
            for kind, base, count, causes in kinds for i in range(count)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--cases", type=int, default=90)
    parser.add_argument("--null", type=int, default=50)
    parser.add_argument("--outside", type=int, default=20)
    parser.add_argument("--double", type=int, default=30)
    parser.add_argument("--levels", default="1,2,3")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", help="folder that keeps the files")
    parser.add_argument("--show", action="store_true")
    options = parser.parse_args()
    program = str(pathlib.Path(options.program).resolve())
    if options.keep:
        options.keep = str(pathlib.Path(options.keep).resolve())
    levels = [int(level) for level in options.levels.split(",")]
    counts = {level: campaign.Count(level, options.show, "K") for level in levels}
    tasks = [task for level in levels for task in tasks_of(program, options, level)]
    with multiprocessing.Pool(options.jobs) as pool:
        for done, (task, truth, answer) in enumerate(pool.imap(examine, tasks), 1):
            counts[task[3]].add(task, truth, answer)
            campaign.progress(done, len(tasks))
    for count in counts.values():
        count.report()


if __name__ == "__main__":
    sys.exit(main())
