#!/usr/bin/python3
"""Hides physical effects (physical_effects.py) and counts the findings by kind and size.

The tool gets only the files. Counted: cause and place right first, family, wrong findings.

    physical_campaign.py PROGRAM [--cases N] [--levels 1,2] [--seed S] [--jobs 2] [--show]
                         [--json FILE] [--weighed]
"""

import argparse
import json
import multiprocessing
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests" / "diagnosis"))
# ruff: noqa: E402
import physical_effects as physical
from measured_campaign import Count
from measured_cases import STATED, summary
from physical_cases import examine


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
    count, kept, left_out, wrong = Count(), [], 0, 0
    with multiprocessing.Pool(options.jobs) as pool:
        for task, truths, answer in pool.imap(examine, tasks_of(options)):
            if answer is None:
                left_out += 1
                continue
            fine = count.add(task, truths, answer)
            first = answer["findings"][:1]
            wrong += bool(first) and not fine and first[0]["probability"] > STATED
            kept.append(dict(machine=task[2], base=task[3], size=task[5], seed=task[1],
                             truth=truths[0], truths=truths, answer=answer))
            if options.show and not fine:
                print("  %d %s %s x%g: %s(%s) -> %s" % (
                    task[1], task[2], task[3], task[5], truths[0]["cause"], truths[0]["subject"],
                    summary(answer)), flush=True)
    count.report()
    print("wrong first names above %g: %d of %d" % (STATED, wrong, len(kept)))
    print("%d cases that no machine carries were left out" % left_out)
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(kept))
    return 0


if __name__ == "__main__":
    sys.exit(main())
