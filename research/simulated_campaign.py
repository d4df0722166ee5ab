#!/usr/bin/python3
"""Hides effects by seed and counts the findings of the tool, which gets only the files.

    simulated_campaign.py PROGRAM [--thermal] [--cases N] [--null N] [--outside N] [--double N]
                          [--levels 1,2,3] [--seed S] [--jobs 2] [--keep FOLDER] [--show]
                          [--answers FILE]

PROGRAM is thermocomp-modelling. --thermal changes the heat flow of machines, and the tool compares
temperatures. Counts are per level. --keep leaves the files in FOLDER and uses existing ones; --show
prints every wrong answer; --answers keeps all answers, except to effects outside the catalogue, for
calibrate_posterior.py.
"""

import argparse
import collections
import json
import multiprocessing
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests" / "diagnosis"))
# ruff: noqa: E402
from cases import NULL_SEED, examined, summary, same  # first: sets the number of threads
import hidden_effects
import hidden_heat
import numpy as np

DOUBLE_SEED = 90000
OUTSIDE_SEED = 70000


def examine(task):
    return examined(task, hidden_effects.make, ("--model", "model.toml", "--weighed"))


def examine_heat(task):
    return examined(task, hidden_heat.make, ("--thermal", "machine.toml"))


# Examination of a case; causes of single cases, effects outside, causes of pairs; numbers of
# single, untouched, outside and double cases at each level; the unit.
DISPLACEMENT = (examine, (hidden_effects.CAUSES, hidden_effects.OUTSIDE, hidden_effects.ALWAYS),
                (144, 100, 40, 40), "um")
HEAT = (examine_heat, (hidden_heat.CAUSES + hidden_heat.FAULTS, hidden_heat.OUTSIDE,
                       hidden_heat.CAUSES), (90, 50, 20, 30), "K")


def errors(finding, truth):
    """Relative error of every parameter that both have."""
    out = {}
    for name, value in truth["parameters"].items():
        found = finding["parameters"].get(name)
        if isinstance(value, dict) and isinstance(found, dict):
            shared = [o for o in value if o in found]
            out[name] = max([abs(found[o] / value[o] - 1) for o in shared], default=1.0)
        elif isinstance(value, (int, float)) and isinstance(found, (int, float)) and value:
            out[name] = abs(found / value - 1)
    return out


def tasks_of(options, level, catalogue):
    """@param catalogue  causes of single cases, effects outside, causes of pairs"""
    causes, outside, of_pairs = catalogue
    pair = lambda i: [str(c) for c in np.random.default_rng(i + 7).choice(of_pairs, 2,
                                                                          replace=False)]
    kinds = [("single", 0, options.cases, lambda i: [causes[i % len(causes)]]),
             ("null", NULL_SEED, options.null, lambda i: []),
             ("outside", OUTSIDE_SEED, options.outside, lambda i: [outside[i % len(outside)]]),
             ("double", DOUBLE_SEED, options.double, pair)]
    return [(options.program, options.keep, kind, level, base + options.seed + i, hide(i))
            for kind, base, count, hide in kinds for i in range(count)]


def progress(done, total):
    if sys.stderr.isatty() or done == total or done % 100 == 0:
        print("\r%d of %d" % (done, total), end="\n" if done == total else "", file=sys.stderr)


class Count:
    def __init__(self, level, show, unit="um"):
        self.level, self.show = level, show
        self.test_rms = "test_rms_" + unit
        self.total = collections.Counter()
        self.right = collections.Counter()
        self.by_cause = collections.defaultdict(lambda: [0, 0])
        self.confusion = collections.Counter()
        self.errors = collections.defaultdict(list)
        self.ratios, self.extra, self.named_second = [], 0, 0

    def add(self, task, truth, answer):
        kind, level, seed, causes = task[2:]
        right = getattr(self, "_" + kind)(truth, answer)
        self.total[kind] += 1
        self.right[kind] += right
        if not right and self.show:
            print("  level %d %s seed %d: %s -> %s" % (
                level, kind, seed, ", ".join("%s(%s)" % (t["cause"], t["subject"]) for t in
                                             truth["hidden"]) or "nothing", summary(answer)))

    def _single(self, truth, answer):
        hidden_one, found = truth["hidden"][0], answer["findings"]
        hit = bool(found) and same(found[0], hidden_one)
        self.extra += max(0, len(found) - 1)
        self.by_cause[hidden_one["cause"]][0] += hit
        self.by_cause[hidden_one["cause"]][1] += 1
        first = found[0]["cause"] if found else answer["verdict"]
        if first == hidden_one["cause"] and not hit:
            first += " (subject)"
        self.confusion[(hidden_one["cause"], first)] += 1
        if hit:
            for name, error in errors(found[0], hidden_one).items():
                self.errors[hidden_one["cause"] + "." + name].append(error)
        else:
            self.named_second += any(same(f, hidden_one) for f in found[1:]) or any(
                same(a, hidden_one) for f in found[:1] for a in f["alternatives"])
        if "run" not in hidden_one["parameters"]:
            for output, oracle in truth["oracle_" + self.test_rms].items():
                after = answer["extended"][output][self.test_rms]
                self.ratios.append(after / oracle)
        return hit

    def _null(self, truth, answer):
        return answer["verdict"] != "effect"

    def _outside(self, truth, answer):
        self.confusion[("(outside)", answer["findings"][0]["cause"] if answer["findings"] else
                        answer["verdict"])] += 1
        return answer["verdict"] == "unexplained"

    def _double(self, truth, answer):
        return all(any(same(f, t) for f in answer["findings"]) for t in truth["hidden"])

    def report(self):
        def line(kind, text):
            if self.total[kind]:
                print("level %d: %s: %d of %d (%.1f %%)" % (
                    self.level, text, self.right[kind], self.total[kind],
                    100.0 * self.right[kind] / self.total[kind]))
        line("single", "cause and subject right as the first finding")
        line("null", "nothing hidden, silent")
        line("outside", "outside the catalogue, called unexplained")
        line("double", "two hidden, both found")
        if self.total["single"]:
            print("level %d: %d further findings; %d of the missed are second finding or "
                  "alternative" % (self.level, self.extra, self.named_second))
        if self.ratios:
            print("level %d: test RMS after over that without the effect: median %.3f, 90 %% below "
                  "%.2f" % (self.level, np.median(self.ratios), np.quantile(self.ratios, 0.9)))
        print_confusion(self.confusion)
        for name, values in sorted(self.errors.items()):
            print("  error of %s: median %.3f, 90 %% below %.3f (%d)" % (
                name, np.median(values), np.quantile(values, 0.9), len(values)))


def print_confusion(confusion):
    for cause in sorted({truth for truth, _ in confusion}):
        row = sorted(((n, first) for (truth, first), n in confusion.items() if truth == cause),
                     reverse=True)
        print("  %-22s -> %s" % (cause, ", ".join("%s %d" % (first, n) for n, first in row)))


def kept_answer(task, truth, answer):
    """In the form of measured_campaign.py; None for an effect outside the catalogue."""
    if task[2] == "outside":
        return None
    hidden_ones = truth["hidden"] or [None]
    return dict(machine="simulated level %d" % task[3], base="simulated", size="simulated",
                seed=task[4], truth=hidden_ones[0], truths=truth["hidden"], answer=answer)


def counted(tasks, examine, levels, show, unit, jobs, answers):
    """@param answers  a file that receives the answers, or None"""
    kept = []
    counts = {level: Count(level, show, unit) for level in levels}
    with multiprocessing.Pool(jobs) as pool:
        for done, (task, truth, answer) in enumerate(pool.imap(examine, tasks), 1):
            counts[task[3]].add(task, truth, answer)
            kept.append(kept_answer(task, truth, answer))
            progress(done, len(tasks))
    for count in counts.values():
        count.report()
    if answers:
        pathlib.Path(answers).write_text(json.dumps([k for k in kept if k]))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--thermal", action="store_true")
    for name in ("cases", "null", "outside", "double"):
        parser.add_argument("--" + name, type=int)
    parser.add_argument("--levels", default="1,2,3")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", help="folder that keeps the files")
    parser.add_argument("--show", action="store_true")
    parser.add_argument("--answers", help="file that receives findings and weights")
    options = parser.parse_args()
    examine, catalogue, numbers, unit = HEAT if options.thermal else DISPLACEMENT
    for name, number in zip(("cases", "null", "outside", "double"), numbers):
        if getattr(options, name) is None:
            setattr(options, name, number)
    options.program = str(pathlib.Path(options.program).resolve())
    if options.keep:
        options.keep = str(pathlib.Path(options.keep).resolve())
    levels = [int(level) for level in options.levels.split(",")]
    tasks = [task for level in levels for task in tasks_of(options, level, catalogue)]
    counted(tasks, examine, levels, options.show, unit, options.jobs, options.answers)


if __name__ == "__main__":
    main()
