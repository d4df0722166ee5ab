#!/usr/bin/python3
"""Changes the heat flow of machines by seed, lets the tool look at files and network alone, and counts
what it says.

thermal_campaign.py PROGRAM: options as those of campaign.py.
"""

import campaign  # first: it settles the number of threads
import hidden_heat as hidden

CAUSES = hidden.CAUSES + hidden.FAULTS


def examine(task):
    return campaign.examined(task, hidden.make, ("--thermal", "machine.toml"))


def main():
    catalogue = CAUSES, hidden.OUTSIDE, hidden.CAUSES
    campaign.long_campaign(__doc__, examine, catalogue, (90, 50, 20, 30), "K")


if __name__ == "__main__":
    main()
