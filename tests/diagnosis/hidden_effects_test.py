#!/usr/bin/python3
"""Short campaign: every cause once, untouched machines, and a machine on which another peak of the
right cause is more likely. Exit status 1 when more than WRONG_MAX causes or that machine's are
missed, or an untouched machine has a finding.

    hidden_effects_test.py PROGRAM [--few]    --few: a handful of cases, for sanitizer builds
"""

import pathlib
import sys

import cases  # first: sets the number of threads
import hidden_effects as hidden

LEVEL = 2
WRONG_MAX = 1
NULLS = 6
# A heat of 51 min; the model's misfit makes one of 2 min more likely, which explains nothing.
QUICK_PEAK = 1, 120003, "missing_heat_source"
FEW = ("missing_heat_source", "sensor_swap", "displacement_step")


def examine(task):
    return cases.examined(task, hidden.make)


def named_beside_quick_peak(program):
    level, seed, cause = QUICK_PEAK
    _, truth, answer = examine((program, None, "single", level, seed, [cause]))
    return cases.is_right(truth, answer)


def main(program, few):
    if not few and not named_beside_quick_peak(program):
        return 1
    return cases.short_campaign(program, examine, LEVEL, FEW if few else hidden.CAUSES,
                                1 if few else NULLS, 0 if few else WRONG_MAX)


if __name__ == "__main__":
    sys.exit(main(str(pathlib.Path(sys.argv[1]).resolve()), "--few" in sys.argv[2:]))
