#!/usr/bin/python3
"""Counts the findings on machines whose model was fitted to the diagnosed rows.

    fitted_campaign.py PROGRAM [--count N] [--seed S]    N machines with an effect and N untouched ones
        at each of the levels 1 and 2
"""

import argparse
import collections
import multiprocessing
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests" / "diagnosis"))
# ruff: noqa: E402
import cases
import fitted_model_test
import hidden_effects as hidden
import simulated_campaign
from measured_campaign import print_reliability

WAYS_TO_FIT = ((0.0, False), (1e-3, False), (0.0, True))  # ridge, offset of each run


def counted(task):
    """@return hidden effect or None, first finding or None"""
    program, level, seed, causes, way = task
    with tempfile.TemporaryDirectory() as temporary:
        truth, answer = fitted_model_test.examined(program, pathlib.Path(temporary), level, seed, causes, *way)
    return (truth["hidden"] or [None])[0], (answer["findings"] or [None])[0]


def count(program, machines, seed):
    tasks = [(program, level, seed + 100000 * level + 10000 * planted + i,
              [hidden.CAUSES[i % len(hidden.CAUSES)]] if planted else [],
              WAYS_TO_FIT[i % len(WAYS_TO_FIT)])
             for level in (1, 2) for planted in (True, False) for i in range(machines)]
    total, stated = collections.Counter(), []
    with multiprocessing.Pool(2) as pool:
        for done, (planted, first) in enumerate(pool.imap(counted, tasks), 1):
            simulated_campaign.progress(done, len(tasks))
            kind = "planted" if planted else "untouched"
            right = bool(planted and first and cases.same(first, planted))
            total[kind] += 1
            total[kind, "named"] += first is not None
            total[kind, "right"] += right
            if first:
                stated.append((first["probability"], right))
    print("planted: %d of %d named, %d right; untouched: %d of %d named" % (
        total["planted", "named"], total["planted"], total["planted", "right"],
        total["untouched", "named"], total["untouched"]))
    print_reliability("names", stated)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=909192)
    given = parser.parse_args()
    count(str(pathlib.Path(given.program).resolve()), given.count, given.seed)
