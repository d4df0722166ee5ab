#!/usr/bin/python3
"""`thermocomp diagnose` once more, batched in numpy, for one run with one output and evenly spaced
rows without gaps. Arguments: the folder of diagnose_data.py and, for the plain way, --plain. Prints
JSON, much as the program does.

The same hypotheses, grids, noise shapes, errors of coefficients, shortlists, refinement, witnesses,
left-out blocks, rounds, spreads and test rows as in the program; diagnose.py compares the numbers.
Batched: the columns of all subjects and grid points of a cause; all candidates of the shortlists,
refined together; blocks and shapes of all candidates under one noise. Columns that differ by a
factor only are weighed once. What cannot enter the numbers of a single output is left out.

Two ways differ in what is below. diagnose_numpy_rows.py is plain: recursions (low pass, play,
whitening) are loops over rows, on all columns at once and right for any spacing of rows, and the
first search is made twice, with and without errors of the coefficients. diagnose_numpy_stretches.py
is tuned to evenly spaced rows: stretches of rows advance together, whitening is a product with
matrices, and columns of the first search are made and whitened once for both."""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

# ruff: noqa: E402
import json
import pathlib
import sys

import numpy as np

import diagnose_numpy_causes as causes
import diagnose_numpy_rows as rows
import diagnose_numpy_stretches as stretches
from diagnose_numpy_candidates import Candidates, columns_of
from diagnose_numpy_data import Data
from diagnose_numpy_evidence import left_of
from diagnose_numpy_search import Search

FINDINGS_MAX, REFITS, WEIGHED_SHOWN, DOUBT_SHARE, NORMAL_95 = 4, 2, 12, 0.2, 1.96
RESAMPLES, TEST_BLOCKS = 400, 16


def rms(values):
    return float(np.sqrt(np.mean(values ** 2)))


class Diagnosis:
    """The rounds of a search and what they found"""

    def __init__(self, d):
        self.d, self.search = d, Search(d)

    def run(self):
        """As Search::run: whether the coefficients are doubted shows in the first round."""
        doubted, right = self.first_searches()
        least = lambda c: c.log_left[0] if len(c) else 0.0
        if least(doubted) < least(right) - DOUBT_SHARE:
            result = self.run_from(doubted, True)
            if not result["unexplained"]:
                return result
        return self.run_from(right, False)

    def first_searches(self):
        """What came into question with errors of the coefficients, and without"""
        ranked = []
        for doubts in self.d.batching.FIRST_SEARCHES:
            self.search.accept(Candidates(), doubts)
            ranked += self.search.ranked()
        return ranked

    def accept(self, found):
        self.search.accept(found, (self.doubted,))

    def run_from(self, c, doubted):
        self.doubted, found, others, weighed = doubted, Candidates(), [], []
        c.setting %= self.search.evidence.kinds
        for number in range(1, FINDINGS_MAX + 1):
            if number > 1:
                self.accept(found)
                c = self.search.ranked()[0]
            known = {found.key(i) for i in range(len(found))}
            c = c.take([i for i in range(len(c)) if c.key(i) not in known])
            weighed += [dict(round=number, cause=c.cause[i].name, subject=c.key(i)[1],
                             score=c.score[i], left_out_gain=c.left_out_gain[i],
                             log_left=c.log_left[i]) for i in range(min(WEIGHED_SHOWN, len(c)))]
            if not len(c) or not self.earned(c, not len(found)):
                break
            found = found.joined(c.take([0]))
            others.append([(c.key(i), c.score[i]) for i in range(1, len(c))])
            for _ in range(REFITS if len(found) > 1 else 0):
                found, others, _ = self.settle_each(found, others)
        named = self.convincing(found)
        found, others, spreads = self.settle_each(found, others, True)
        left = np.prod((1.0 - found.left_out_gain) ** 2)
        unexplained_share, unexplained = self.unexplained_share(found), False
        if not named or 1.0 - left < 0.3:
            found, unexplained_share, unexplained = Candidates(), 1.0, self.structure_left()
        return dict(doubted=doubted, weighed=weighed, found=found, others=others, spreads=spreads,
                    unexplained=unexplained, unexplained_share=unexplained_share)

    def earned(self, c, first):
        explained = columns_of(c, np.array([0]), c.shape[:1])[:, 0] @ c.gains[0, :c.width[0]]
        least = max(self.d.noise_um, 0.005 * self.d.measured.std(),
                    0.0 if first else 0.2 * self.d.residual.std())
        return (c.left_out_gain[0] >= 0.12 and (c.score[0] >= 25.0 or c.left_out_gain[0] >= 0.7) and
                explained.std() > least)

    @staticmethod
    def convincing(found):
        share, likelihood = found.left_out_gain / 0.55, np.minimum(1.0, found.score / 90.0)
        clear = (share >= 1.0) | (share + likelihood >= 1.55)
        clear |= (likelihood >= 1.0) & (found.left_out_gain >= 0.2)
        together = 1.0 - np.prod(1.0 - found.left_out_gain)
        return bool(np.any(clear) or (together >= 0.65 and found.score.sum() >= 90.0))

    def settle_each(self, found, others, with_spreads=False):
        """Every finding beside the others"""
        i, spreads, others = 0, [], list(others)
        while i < len(found):
            rest, one = found.without(i), found.take([i])
            self.accept(rest)
            self.search.settle_anew(one)
            if not one.acts[0]:
                found = rest
                del others[i]
                continue
            after = found.take(np.arange(i + 1, len(found)))
            found = found.take(np.arange(i)).joined(one).joined(after)
            if with_spreads:
                spreads.append((self.shape_sd(one), self.gain_sd(one)))
            i += 1
        return found, others, spreads

    def shape_sd(self, one):
        """From the curvature of the likelihood, where it can be seen above rounding."""
        cause = one.cause[0]
        if not cause.refined or not one.score[0] > 0:
            return 0.0
        logarithmic = cause.refined == "logarithmic"
        grid = cause.grid_of(one.subject[0])
        size = 1.0 if logarithmic else grid[-1] - grid[0]
        steps = 1e-3 * size * 2.0 ** np.arange(10)
        moves = np.r_[0.0, steps, -steps]
        shapes = one.shape[0] * np.exp(moves) if logarithmic else one.shape[0] + moves
        score = self.search.weigh(one, np.array([0]), shapes, len(shapes))[0]
        fall = score[0] - 0.5 * (score[1:11] + score[11:])
        seen = np.flatnonzero(fall > 4.0)
        return float(steps[seen[0]] / np.sqrt(fall[seen[0]])) if len(seen) else size

    def gain_sd(self, one):
        e, gains = self.search.evidence, one.gains[:, :one.width[0]]
        square, right = e.equations(columns_of(one, np.array([0]), one.shape), one.setting)
        squares = left_of(e.squares[one.setting], gains, square, right)
        variance = max(0.0, squares[0]) / e.rows
        return np.sqrt(variance * np.diag(np.linalg.inv(square[0])))

    def unexplained_share(self, found):
        left = self.d.residual.copy()
        for i in range(len(found)):
            one = np.array([i])
            left -= columns_of(found, one, found.shape[one])[:, 0] @ found.gains[i, :found.width[i]]
        variance = lambda values: max(0.0, values.var() - self.d.noise_um ** 2)
        before = variance(self.d.residual)
        return min(1.0, max(0.0, variance(left) / before)) if before > 0 else 1.0

    def structure_left(self):
        structure = np.sqrt(max(0.0, self.d.residual.var() - self.d.noise_um ** 2))
        return bool(structure > 0.03 * self.d.measured.std() and structure > 1.5 * self.d.noise_um)


def alternatives(found, i, others):
    """(cause, subject) and support of those that came close"""
    shown = {}
    for key, score in others:
        support = np.exp(-0.05 * (found.score[i] - score))
        if support < 0.001 or len(shown) >= 4:
            break
        shown.setdefault(key, min(1.0, support))
    return [dict(cause=cause, subject=subject, relative_support=support)
            for (cause, subject), support in shown.items()]


def test_figures(before, after):
    """RMS of the test rows and the interval of its reduction, by resampling of blocks of rows"""
    length = max(1, len(before) // TEST_BLOCKS)
    starts = np.arange(0, len(before), length)
    squares = np.stack([np.add.reduceat(before ** 2, starts), np.add.reduceat(after ** 2, starts)])
    drawn = np.random.default_rng(1).integers(len(starts), size=(RESAMPLES, len(starts)))
    sums = squares[:, drawn].sum(axis=2)
    reductions = np.sort(1.0 - np.sqrt(sums[1] / sums[0]))
    ends = [reductions[int(share * (RESAMPLES - 1))] for share in (0.025, 0.975)]
    return dict(before=rms(before), after=rms(after), reduction=1.0 - rms(after) / rms(before),
                ci95=ends)


def findings_of(result, test):
    """What was found, and the residual of the test rows with all of it taken off"""
    found, residual, findings = result["found"], test.residual, []
    of_test = causes.all_causes(test) if len(found) else []
    for i, (spread, gain_sd) in zip(range(len(found)), result["spreads"]):
        cause, shape, gains = found.cause[i], found.shape[i], found.gains[i, :found.width[i]]
        finding = dict(cause=cause.name, subject=found.key(i)[1], shape=shape, power=found.power[i],
                       gains=[*gains], alternatives=alternatives(found, i, result["others"][i]),
                       left_out_gain=found.left_out_gain[i], score=found.score[i],
                       gains_ci95=[[g - NORMAL_95 * sd, g + NORMAL_95 * sd]
                                   for g, sd in zip(gains, gain_sd)])
        if cause.refined:
            move = NORMAL_95 * spread
            finding["shape_ci95"] = ([shape * np.exp(-move), shape * np.exp(move)]
                                     if cause.refined == "logarithmic" else
                                     [shape - move, shape + move])
        if not cause.one_run:
            point = found.subject[[i]], found.shape[[i]], found.power[[i]]
            explained = of_test[cause.number].columns(*point)[:, 0] @ gains
            after = residual - (explained - explained[0])
            finding["test_rms_um"] = test_figures(residual, after)
            residual = after
        findings.append(finding)
    return findings, residual


def main(folder, batching):
    train = Data(folder, "train.csv", True, batching)
    test = Data(folder, "test.csv", False, batching)
    result = Diagnosis(train).run()
    findings, residual = findings_of(result, test)
    peak = lambda values: float(np.abs(values).max())
    verdict = "effect" if findings else "unexplained" if result["unexplained"] else "none"
    print(json.dumps(dict(
        verdict=verdict, findings=findings, weighed=result["weighed"],
        coefficients_doubted=result["doubted"],
        baseline=dict(train_rms_um=rms(train.residual), test_rms_um=rms(test.residual),
                      test_peak_um=peak(test.residual)),
        extended=dict(test_rms_um=rms(residual), test_peak_um=peak(residual)),
        unexplained_fraction=result["unexplained_share"]), indent=2))


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]), rows if "--plain" in sys.argv[2:] else stretches)
