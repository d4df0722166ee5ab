#!/usr/bin/python3
"""The short campaign: every cause once, silence on untouched machines. Exit status 1 when it is
worse than docs/measurements.md promises of these seeds.

hidden_effects_test.py PROGRAM [--few]    --few: a handful of cases, for sanitizer builds
"""

import pathlib
import sys

import campaign
import hidden_effects as hidden

LEVEL = 2
WRONG_MAX = 3  # of 18
NULLS = 6
FEW = ("missing_heat_source", "sensor_swap", "displacement_step")


def main(program, few):
    return campaign.short_campaign(program, campaign.examine, LEVEL, FEW if few else hidden.CAUSES,
                                   1 if few else NULLS, 0 if few else WRONG_MAX)


if __name__ == "__main__":
    sys.exit(main(str(pathlib.Path(sys.argv[1]).resolve()), "--few" in sys.argv[2:]))
