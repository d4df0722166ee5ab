#!/usr/bin/python3
"""Fits the weights of modelling/diagnosis/rank/search.cpp to the campaigns' answers.

Also evaluates them on machines that were left out.

    calibrate_posterior.py ANSWERS.json...    as kept by physical_campaign.py, measured_campaign.py
        (--weighed --json) and simulated_campaign.py (--answers)

Within a case exp(utility) of all hypotheses compete; the presence of any effect is a logistic
function of the most likely one's figures. One answer in a hundred may be beyond the weights:
otherwise a few hopeless cases lower all probabilities.
"""

import json
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests" / "diagnosis"))
# ruff: noqa: E402
import numpy as np
from measured_cases import subject_right
from measured_plants import FAMILIES
from scipy.optimize import minimize

BEYOND = 0.01
PENALTY = 1e-2
SCALE = 20.0


def compressed(score):
    return np.sign(score) * np.log1p(np.abs(score) / SCALE)


class Case:
    def __init__(self, kept):
        weighed, truth = kept["answer"]["weighed"], kept["truth"]
        if truth and truth["cause"] not in FAMILIES:
            truth = None  # no cause of the catalogue
        value = lambda name: np.array([each[name] or 0.0 for each in weighed], float)
        root = np.sqrt(len(kept["answer"]["baseline"]))
        score, witness = np.maximum(-50.0, value("score")), value("witness")
        clipped = lambda values: np.clip(values, -0.5, 3.0)
        own, seen = compressed((score - witness) / root), compressed(witness)
        share = -np.expm1(-clipped(value("left_out_of_best")))
        one_run = np.array(["run" in each for each in weighed], float)
        self.figures = np.stack([own, seen, clipped(value("left_out") / root), share,
                                 value("parameters"), one_run], axis=1)
        self.presence = np.stack([np.ones(len(own)), own, seen, share], axis=1)
        self.machine, self.is_planted = kept["machine"], truth is not None
        self.families = np.array([FAMILIES[each["cause"]] for each in weighed])
        self.family = truth and FAMILIES[truth["cause"]]
        if truth:
            truth.setdefault("groups", [[p] for p in truth["subject"].split("|")])
        self.right = np.array([self.is_planted and each["cause"] == truth["cause"] and
                               subject_right(each["subject"], truth) for each in weighed])


def likelihood(weights, cases):
    """Minus ln of the right share within each planted case, and its gradient."""
    total, slope = PENALTY * weights @ weights, 2 * PENALTY * weights
    for case in cases:
        if not case.right.any():
            continue
        utility = case.figures @ weights
        share = np.exp(utility - utility.max())
        share /= share.sum()
        right = share[case.right].sum()
        total -= np.log(right + BEYOND)
        of_right = np.where(case.right, share / max(right, 1e-300), 0.0)
        slope = slope - right / (right + BEYOND) * ((of_right - share) @ case.figures)
    return total, slope


def presence_likelihood(weights, best, planted):
    odds = best @ weights
    total = np.sum(np.logaddexp(0, odds) - planted * odds) + PENALTY * weights @ weights
    return total, best.T @ (1 / (1 + np.exp(-odds)) - planted) + 2 * PENALTY * weights


def fitted(cases):
    """@return weights of the utility, weights of presence"""
    within = minimize(likelihood, np.zeros(cases[0].figures.shape[1]), args=(cases,), jac=True,
                      method="L-BFGS-B").x
    best = np.array([c.presence[np.argmax(c.figures @ within)] for c in cases])
    planted = np.array([c.is_planted for c in cases], float)
    return within, minimize(presence_likelihood, np.zeros(best.shape[1]), args=(best, planted),
                            jac=True, method="L-BFGS-B").x


def judged(case, within, presence):
    """@return probability of the finding, whether it is right; the same for its family"""
    utility = case.figures @ within
    share = np.exp(utility - utility.max())
    share /= share.sum() * (1 + np.exp(-case.presence[np.argmax(utility)] @ presence))
    right = share[case.right].sum()
    wrong = np.where(case.right, 0.0, share).max()
    families = {f: share[case.families == f].sum() for f in set(case.families)}
    family = max(families, key=families.get)
    return max(right, wrong), right >= wrong, families[family], family == case.family


def report(cases, answers):
    planted = [a for c, a in zip(cases, answers) if c.is_planted]
    null = [a for c, a in zip(cases, answers) if not c.is_planted]
    print("%d planted: named right %.0f %%, family %.0f %%, wrong above 0.8 %.1f %%; "
          "%d untouched: %d named" % (
              len(planted), 100 * np.mean([p >= 0.5 and r for p, r, _, _ in planted]),
              100 * np.mean([p >= 0.5 and r for _, _, p, r in planted]),
              100 * np.mean([p > 0.8 and not r for p, r, _, _ in planted]),
              len(null), sum(p >= 0.5 for p, _, _, _ in null)))
    for text, at in (("names", 0), ("families", 2)):
        stated = np.array([(a[at], a[at + 1]) for a in answers])
        for low in np.arange(0.5, 1.0, 0.1):
            inside = stated[(stated[:, 0] >= low) & (stated[:, 0] < low + 0.1 + 1e-9)]
            if len(inside):
                print("  %s stated %.2f: %.2f right (%d)" % (text, *inside.mean(axis=0),
                                                           len(inside)))


def main(paths):
    kept = [each for path in paths for each in json.loads(pathlib.Path(path).read_text())]
    cases = [Case(each) for each in kept if each["answer"].get("weighed")]
    within, presence = fitted(cases)
    print("weights{%s}" % ", ".join("%.2f" % w for w in within))
    print("of_first{%s}" % ", ".join("%.2f" % w for w in presence))
    answers = [None] * len(cases)
    for machine in sorted({case.machine for case in cases}):
        others = fitted([case for case in cases if case.machine != machine])
        for i, case in enumerate(cases):
            if case.machine == machine:
                answers[i] = judged(case, *others)
    print("each machine judged by the weights of all others:")
    report(cases, answers)


if __name__ == "__main__":
    main(sys.argv[1:])
