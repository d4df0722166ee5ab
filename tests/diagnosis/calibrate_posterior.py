#!/usr/bin/python3
"""Weights of the posterior of a diagnosis: those under which what was planted is likeliest.

calibrate_posterior.py ANSWERS.json...     written by
    measured_campaign.py PROGRAM --weighed --json ANSWERS.json     also of --kind pair
    campaign.py PROGRAM --answers ANSWERS.json

Prints the weights of modelling/diagnosis/evidence/posterior.cpp, for the first finding (from
machines with one effect or none) and for later ones (from all), and how well they do on the cases
they come from and on machines that were left out of the fit one after the other.
"""

import collections
import json
import pathlib
import sys

import numpy as np

import campaign
import measured_campaign
from measured_plants import FAMILIES

WEIGHED = 12  # explanations of a round that count
SCORE_SCALE = 20.0
AS_LITTLE = 0.1  # left of rows left out, in ln
WEIGHTS = ("left_out", "first_place", "behind", "witness", "share", "share_of_best", "parameters",
           "same_cause", "other_causes", "none")
STEPS = 3000
PENALTY = 0.15  # of a weight's square: two features of single outputs are the same
# A second effect beside another on simulated machines, of which there are few cases, counts so many
# times: then two cases in five have one.
TIMES_SIMULATED_PAIR = 6


def hidden_in(kept):
    return kept.get("truths") or ([kept["truth"]] if kept["truth"] else [])


def rounds_of(kept, later):
    """What was weighed in the first round, or in each one after something was named."""
    weighed = [each for each in kept["answer"]["weighed"] if not each["beside_fit"]]
    if later:
        numbers = {each["round"] for each in weighed} - {1} if kept["answer"]["findings"] else ()
    else:
        numbers = (1,) if len(hidden_in(kept)) < 2 else ()
    return [[each for each in weighed if each["round"] == number] for number in sorted(numbers)]


def cases_of(paths, later):
    """One dictionary a case: machine, size, features (the last row: nothing), which of them are
    right, families."""
    cases = []
    for path in paths:
        for kept in json.loads(pathlib.Path(path).read_text()):
            truths = hidden_in(kept)
            simulated = kept["base"] == "simulated"
            right = campaign.same if simulated else measured_campaign.right
            times = TIMES_SIMULATED_PAIR if later and simulated and len(truths) > 1 else 1
            for weighed in rounds_of(kept, later):
                weighed = weighed[:WEIGHED]
                hits = [any(right(w, truth) for truth in truths) for w in weighed]
                cases += times * [dict(
                    machine=kept["machine"], size=kept["size"], truth=kept["truth"],
                    features=features(weighed), hits=np.array(hits + [not any(hits)]),
                    families=[FAMILIES[w["cause"]] for w in weighed])]
    return cases


def features(weighed):
    rows = np.zeros((len(weighed) + 1, len(WEIGHTS)))
    best = max((each["score"] for each in weighed), default=0.0)
    for place, each in enumerate(weighed):
        witness = each["witness"]
        same, others = rivals(each, weighed)
        rows[place, :-1] = (np.clip(-each["log_left"], -0.5, 3.0), place == 0,
                            -np.log1p((best - each["score"]) / SCORE_SCALE),
                            np.sign(witness) * np.log1p(abs(witness) / SCORE_SCALE),
                            np.clip(each["left_out_gain"], -0.5, 1.0),
                            np.clip(each["left_out_gain_of_best"], -0.5, 1.0),
                            -np.log1p(each["free_parameters"]), -np.log(same), -np.log1p(others))
    rows[-1, -1] = 1.0
    return rows


def rivals(of, weighed):
    """Of the same cause, itself among them, and of others."""
    same, others = 0.0, 0.0
    for other in weighed:
        near = 1.0 / (1.0 + max(0.0, of["score"] - other["score"]) / SCORE_SCALE)
        if other["cause"] == of["cause"]:
            same += near * (other["log_left"] < of["log_left"] + AS_LITTLE)
        else:
            others += near * (other["log_left"] < of["log_left"])
    return same, others


def probabilities(case, weights):
    utility = case["features"] @ weights
    odds = np.exp(utility - utility.max())
    return odds / odds.sum()


def fitted(cases):
    """By steepest descent with the step length of Barzilai and Borwein, halved while it leads up."""
    # (cases, explanations and nothing); what is not there is out of reach and never right
    features = np.zeros((len(cases), WEIGHED + 1, len(WEIGHTS)))
    hits = np.zeros(features.shape[:2])
    absent = np.full(features.shape[:2], -np.inf)
    for i, case in enumerate(cases):
        count = len(case["hits"])
        features[i, :count], hits[i, :count] = case["features"], case["hits"]
        absent[i, :count] = 0.0

    def loss(weights):
        utility = features @ weights + absent
        odds = np.exp(utility - utility.max(axis=1, keepdims=True))
        stated = odds / odds.sum(axis=1, keepdims=True)
        right = (stated * hits).sum(axis=1)
        slope = np.einsum("ij,ijk->k", stated * hits / right[:, None] - stated, features)
        return -np.log(right).sum() + PENALTY * weights @ weights, -slope + 2 * PENALTY * weights
    weights = np.zeros(len(WEIGHTS))
    value, slope = loss(weights)
    length = 1e-3
    for _ in range(STEPS):
        trial, (trial_value, trial_slope) = weights, (np.inf, slope)
        while not trial_value <= value and length > 1e-12:
            trial = weights - length * slope
            trial_value, trial_slope = loss(trial)
            length *= 0.5
        moved, turned = trial - weights, trial_slope - slope
        weights, value, slope = trial, trial_value, trial_slope
        if moved @ moved < 1e-14 * (1.0 + weights @ weights):
            break
        length = abs(moved @ moved / (moved @ turned)) if moved @ turned else 1e-3
    return weights


def judged(cases, weights_of):
    """@param weights_of  the weights for a machine"""
    count = collections.Counter()
    stated = []
    for case in cases:
        all_of = probabilities(case, weights_of(case["machine"]))
        of = all_of[:-1]
        best = int(np.argmax(of)) if len(of) else None
        hit = best is not None and bool(case["hits"][best])
        share = float(of[case["hits"][:-1]].sum()) if hit else float(of.max(initial=0.0))
        if share >= 0.5:
            stated.append((share, hit and case["truth"] is not None))
        key = case["size"] if case["truth"] else "untouched"
        count[key, "all"] += 1
        count[key, "named"] += share >= 0.5
        count[key, "above 0.8"] += share > measured_campaign.STATED
        if case["truth"]:
            count[key, "right"] += hit and share >= 0.5
            families = collections.Counter()
            for probability, family in zip(of, case["families"]):
                families[family] += probability
            count[key, "family"] += families[FAMILIES[case["truth"]["cause"]]] >= 0.5
    for key in sorted({key for key, _ in count}, key=str):
        print("  %-10s" % key, ", ".join("%s %d" % (what, n) for (k, what), n in count.items()
                                         if k == key))
    measured_campaign.print_reliability("names", stated)


def main():
    for later in (False, True):
        cases = cases_of(sys.argv[1:], later)
        weights = fitted(cases)
        print("later findings" if later else "first finding",
              " ".join("%s %.2f" % of for of in zip(WEIGHTS, weights)))
        print("cases it comes from")
        judged(cases, lambda _: weights)
        machines = sorted({case["machine"] for case in cases})
        without = {m: fitted([c for c in cases if c["machine"] != m]) for m in machines}
        print("each machine with the weights of the others")
        judged(cases, lambda machine: without[machine])


if __name__ == "__main__":
    main()
