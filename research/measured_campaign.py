#!/usr/bin/python3
"""Plants one effect in data of real machines and counts the findings of the tool.

    measured_campaign.py PROGRAM [--cases N] [--untouched N] [--machines spindle,printer,cell,mirror]
                         [--bases ridge,few,lags,bank] [--causes A,B] [--sizes 1.5,3] [--seed S]
                         [--kind single|pair|outside|sparse|outputs]
                         [--jobs 2] [--show] [--json FILE] [--weighed]

PROGRAM is thermocomp-modelling; it gets only files and model. Data: $THERMOCOMP_DATA, else
shared/data beside the source. The base model is fitted to the untouched rows of the whole set, so
that its remainder is the machine's own. --show prints every wrong answer; --json keeps all answers,
with --weighed for calibrate_posterior.py.
"""

import argparse
import collections
import json
import multiprocessing
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests" / "diagnosis"))
# ruff: noqa: E402
from measured_cases import STATED, examine, right, summary  # first: sets the threads
import measured_machines
import numpy as np
from measured_plants import CAUSES, FAMILIES, OUTSIDE

KINDS = ("single", "pair", "outside", "sparse", "outputs")


def covered(finding, truth):
    """For every shared parameter with an interval: True if it contains the planted value."""
    out = []
    for name, value in truth["parameters"].items():
        interval = finding.get("parameters_ci95", {}).get(name)
        if isinstance(value, float) and isinstance(interval, list) and name != "run":
            out.append(interval[0] <= value <= interval[1])
        elif isinstance(value, dict) and isinstance(interval, dict):
            out += [interval[o][0] <= v <= interval[o][1] for o, v in value.items()
                    if o in interval]
    return out


class Count:
    def __init__(self):
        self.total = collections.Counter()
        self.right = collections.Counter()
        self.family = collections.Counter()
        self.confusion = collections.Counter()
        self.stated = []  # (probability, right) of every finding
        self.stated_family = []
        self.covers = []
        self.untouched, self.invented, self.named_untouched = 0, 0, 0
        self.one_of_two = 0

    def add(self, task, truths, answer):
        cause, kind = task[4], task[6]
        found = answer["findings"]
        if cause is None:
            self.untouched += 1
            self.named_untouched += bool(found)
            self.invented += any(f.get("probability", 1.0) > STATED for f in found)
            self.stated += [(f["probability"], False) for f in found if "probability" in f]
            return not found
        if kind == "outside":
            return self.judge(task, truths[0], found, answer, not found, not found)
        if kind == "pair":
            hit = all(any(right(f, truth) for f in found) for truth in truths)
            self.one_of_two += any(right(f, truth) for f in found for truth in truths)
            family = all(any(f["family"] == truth["family"] for f in found) for truth in truths)
            return self.judge(task, truths[0], found, answer, hit, family, truths)
        truth = truths[0]
        hit = bool(found) and right(found[0], truth)
        family = bool(found) and FAMILIES.get(found[0]["cause"]) == truth["family"]
        if not found and answer.get("families"):
            weighed = answer["families"]
            likeliest = max(weighed, key=lambda f: weighed[f])
            family = likeliest == truth["family"] and weighed[likeliest] >= 0.5
        if hit:
            self.covers += covered(found[0], truth)
        return self.judge(task, truth, found, answer, hit, family)

    def judge(self, task, truth, found, answer, hit, family, truths=None):
        """Counts one planted machine. @return True if it was right"""
        _, _, machine, base, _, times, _ = task
        truths = truths or [truth]
        for key in ((times, "all"), (times, machine), (times, base), (times, truth["cause"])):
            self.total[key] += 1
            self.right[key] += hit
            self.family[key] += family
        summary = found[0]["cause"] if found else answer["verdict"]
        self.confusion[(truth["cause"], summary + (" (subject)" if summary == truth["cause"] and not hit
                                                else ""))] += 1
        for finding in found:
            if "probability" in finding:
                self.stated.append((finding["probability"], any(right(finding, t) for t in truths)))
                self.stated_family.append((finding["family_probability"],
                                           any(finding["family"] == t["family"] for t in truths)))
        return hit

    def report(self):
        for key in sorted(self.total, key=str):
            count = self.total[key]
            print("size %-4g %-22s cause and subject %3d of %3d (%3.0f %%), family %3.0f %%" % (
                key[0], key[1], self.right[key], count, 100.0 * self.right[key] / count,
                100.0 * self.family[key] / count))
        if self.one_of_two:
            print("one of two found at least: %d" % self.one_of_two)
        if self.untouched:
            print("untouched: %d of %d named, %d above probability %g" % (
                self.named_untouched, self.untouched, self.invented, STATED))
        for text, stated in (("names", self.stated), ("families", self.stated_family)):
            print_reliability(text, stated)
        if self.covers:
            print("intervals (95 %%) hold %.0f %% of %d planted values" % (
                100.0 * np.mean(self.covers), len(self.covers)))
        for cause in sorted({truth for truth, _ in self.confusion}):
            row = sorted(((n, first) for (truth, first), n in self.confusion.items()
                          if truth == cause), reverse=True)
            print("  %-22s -> %s" % (cause, ", ".join("%s %d" % (f, n) for n, f in row)))


def print_reliability(text, stated):
    for low in np.arange(0.0, 1.0, 0.1):
        inside = [(p, r) for p, r in stated if low <= p < low + 0.1 or (p == 1.0 and low > 0.85)]
        if inside:
            print("  %s stated %.2f: %.2f right (%d)" % (
                text, np.mean([p for p, _ in inside]), np.mean([r for _, r in inside]),
                len(inside)))


def tasks_of(options):
    machines, bases = options.machines.split(","), options.bases.split(",")
    causes, sizes = options.causes.split(","), options.sizes.split(",")
    if options.kind == "outside":
        causes = OUTSIDE
    if options.kind in ("sparse", "outputs"):
        machines = ["spindle_outputs" if options.kind == "outputs" else "spindle"]
    tasks = []
    for i in range(options.cases):
        # One draw per case, so that the cycles are independent.
        random = np.random.default_rng([options.seed, i])
        tasks.append((options.program, 100000 * options.seed + i, machines,
                      str(random.choice(bases)), causes[i % len(causes)],
                      float(sizes[(i // len(causes)) % len(sizes)]), options.kind))
    for i in range(options.untouched):
        random = np.random.default_rng([options.seed, 50000 + i])
        tasks.append((options.program, 100000 * options.seed + 50000 + i,
                      machines, str(random.choice(bases)), None, 0.0, options.kind))
    return tasks


def arguments(words=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--cases", type=int, default=408)
    parser.add_argument("--untouched", type=int, default=100)
    parser.add_argument("--machines", default="spindle,spindle,spindle,printer,printer,cell,mirror")
    parser.add_argument("--bases", default="ridge,few,lags")
    parser.add_argument("--causes", default=",".join(CAUSES))
    parser.add_argument("--sizes", default="1.5,3")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS, default="single")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--show", action="store_true")
    parser.add_argument("--json")
    parser.add_argument("--weighed", action="store_true")
    options = parser.parse_args(words)
    options.program = [str(pathlib.Path(options.program).resolve())]
    if options.weighed:
        options.program.append("--weighed")
    return options


def main():
    options = arguments()
    if not measured_machines.DATA.is_dir():
        print("measured campaign: no data at %s" % measured_machines.DATA)
        return 0
    count, kept, impossible = Count(), [], 0
    with multiprocessing.Pool(options.jobs) as pool:
        for task, truth, answer in pool.imap(examine, tasks_of(options)):
            if answer is None:
                impossible += 1
                continue
            fine = count.add(task, truth, answer)
            kept.append(dict(machine=task[2], base=task[3], size=task[5], seed=task[1],
                             truth=truth and truth[0], truths=truth, answer=answer))
            if options.show and not fine:
                print("  %s %s %s %s x%g: %s -> %s" % (
                    task[1], *task[2:4], truth and [t["cause"] for t in truth], task[5],
                    truth and [t["subject"] for t in truth], summary(answer)), flush=True)
    count.report()
    print("%d cases that their machine cannot carry were left out" % impossible)
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(kept))
    return 0


if __name__ == "__main__":
    sys.exit(main())
