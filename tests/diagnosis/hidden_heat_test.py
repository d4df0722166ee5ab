#!/usr/bin/python3
"""Short thermal campaign: every kind of thermal error once, and untouched machines. Exit status 1
when more than WRONG_MAX are missed or an untouched one has a finding.

    hidden_heat_test.py PROGRAM [--few]    --few: a handful of cases, for sanitizer builds
"""

import pathlib
import sys

import cases  # first: sets the number of threads
import hidden_heat as hidden

LEVEL = 2
WRONG_MAX = 1
NULLS = 3
FEW = ("wrong_heat_source", "wrong_conductance")


def examine(task):
    return cases.examined(task, hidden.make, ("--thermal", "machine.toml"))


def main(program, few):
    causes = FEW if few else hidden.CAUSES + hidden.FAULTS
    return cases.short_campaign(program, examine, LEVEL, causes, 1 if few else NULLS,
                                0 if few else WRONG_MAX)


if __name__ == "__main__":
    sys.exit(main(str(pathlib.Path(sys.argv[1]).resolve()), "--few" in sys.argv[2:]))
