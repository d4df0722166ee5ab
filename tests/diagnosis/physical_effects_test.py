#!/usr/bin/python3
"""Physical effects, three and ten times the model's remainder. Exit status 1 when fewer than
RIGHT_MIN are named first, or more than WRONG_MAX wrongly with confidence.

    physical_effects_test.py PROGRAM [--few]    --few: a handful of cases, for sanitizer builds
"""

import pathlib
import sys

import measured_cases as measured
import physical_cases
import physical_effects as physical

LEVEL, SEED = 2, 4300
SIZES = (3.0, 10.0)
RIGHT_MIN = 13  # of 19 kinds; 16 when this was set
WRONG_MAX = 1


def main(program, few):
    right = wrong = 0
    kinds = physical.KINDS[:3] if few else physical.KINDS
    for i, kind in enumerate(kinds):
        _, truths, answer = physical_cases.examine(
            ([program], SEED + i, LEVEL, kind, SIZES[i % len(SIZES)]))
        if answer is None:
            print("%s: no machine carries it" % kind)
            continue
        found = answer["findings"]
        fine = bool(found) and measured.right(found[0], truths[0])
        right += fine
        wrong += bool(found) and not fine and found[0]["probability"] > measured.STATED
        print("%s: %s of %s, said: %s" % (kind, truths[0]["cause"], truths[0]["subject"],
                                          measured.summary(answer)))
    print("%d of %d right, %d wrong with confidence" % (right, len(kinds), wrong))
    return 1 if wrong > WRONG_MAX or (not few and right < RIGHT_MIN) else 0


if __name__ == "__main__":
    sys.exit(main(str(pathlib.Path(sys.argv[1]).resolve()), "--few" in sys.argv[2:]))
