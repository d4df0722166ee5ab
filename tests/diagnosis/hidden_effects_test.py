#!/usr/bin/python3
"""The short campaign: every cause once, silence on untouched machines. Exit status 1 when it is
worse than docs/diagnosis.md promises of these seeds.

hidden_effects_test.py PROGRAM [--few]    --few: a handful of cases, for sanitizer builds
"""

import multiprocessing
import pathlib
import sys

import campaign
import hidden_effects as hidden

LEVEL = 2
WRONG_MAX = 3  # of 18
NULLS = 6
FEW = ("missing_heat_source", "sensor_swap", "displacement_step")


def main(program, few):
    causes = FEW if few else hidden.CAUSES
    tasks = [(program, None, "single", LEVEL, seed, [cause]) for seed, cause in enumerate(causes)]
    tasks += [(program, None, "null", LEVEL, campaign.NULL_SEED + seed, [])
              for seed in range(1 if few else NULLS)]
    count = campaign.Count(LEVEL, show=True)
    with multiprocessing.Pool(2) as pool:
        for task, truth, answer in pool.imap(campaign.examine, tasks):
            count.add(task, truth, answer)
    count.report()
    wrong = count.total["single"] - count.right["single"]
    silent = count.right["null"] == count.total["null"]
    return 0 if wrong <= (0 if few else WRONG_MAX) and silent else 1


if __name__ == "__main__":
    sys.exit(main(str(pathlib.Path(sys.argv[1]).resolve()), "--few" in sys.argv[2:]))
