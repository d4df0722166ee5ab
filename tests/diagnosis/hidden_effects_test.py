"""The short campaign: every cause once, silence on untouched data. Exit status 1 when it is worse
than what docs/diagnosis.md promises of these seeds."""

import pathlib
import sys
import tempfile

import campaign
import hidden_effects as hidden

LEVEL = 2
RIGHT_MIN = 14  # of 18
NULLS = 6


def main(program):
    right = 0
    false_alarms = []
    with tempfile.TemporaryDirectory() as folder:
        for seed, cause in enumerate(hidden.CAUSES):
            place = pathlib.Path(folder) / cause
            truth = hidden.make(place, seed, LEVEL, [cause]).truth[0]
            answer = campaign.diagnose(program, place)
            first = answer["findings"][0] if answer["findings"] else None
            hit = first is not None and campaign.same(first, truth)
            right += hit
            print("%s of %s: %s" % (truth["cause"], truth["subject"], "found" if hit else
                                    first and (first["cause"], first["subject"])), flush=True)
        for seed in range(NULLS):
            place = pathlib.Path(folder) / ("null%d" % seed)
            hidden.make(place, 50000 + seed, LEVEL, [])
            answer = campaign.diagnose(program, place)
            if answer["verdict"] == "effect":
                false_alarms.append(answer["findings"][0])
    print("%d of %d right, %d false alarms of %d" % (right, len(hidden.CAUSES), len(false_alarms),
                                                    NULLS))
    return 0 if right >= RIGHT_MIN and not false_alarms else 1


if __name__ == "__main__":
    sys.exit(main(str(pathlib.Path(sys.argv[1]).resolve())))
