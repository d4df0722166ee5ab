"""Weighing, settling and ranking of all hypotheses, for diagnose_numpy.py: batched over subjects
and grid points of a cause, and over all candidates of all shortlists."""

import numpy as np

import diagnose_numpy_causes as causes
from diagnose_numpy_candidates import Candidates, columns_of
from diagnose_numpy_evidence import Evidence, left_of, solved
from diagnose_numpy_left_out import LeftOut
from diagnose_numpy_witness import Witness

# Of causes that differ by the subject's factor only, one stands for all; these many remain.
TWINS_KEPT = 3
SHORTLIST, POINTS, STEPS = 20, 6, 4
OUTPUT_GAIN_MIN, TIE = 6.0, 0.1


class Search:
    def __init__(self, d):
        self.d, self.rows = d, len(d.time_s)
        self.causes = causes.all_causes(d)
        self.witness = Witness(d)
        self.log_rows = np.log(self.rows)

    def accept(self, found, doubts):
        accepted = []
        for i in range(len(found)):
            one = np.array([i])
            columns = columns_of(found, one, found.shape[one])[:, 0]
            accepted.append((columns, None if found.own[i] else found.gains[i, :1]))
        self.evidence = Evidence(self.d, accepted, doubts)

    def price(self, cause):
        return cause.handicap + self.log_rows * ((cause.refined != "") + (cause.form == "shared"))

    def trials(self, square, right, setting, own, no_gain, allowed):
        """Scores, gains (n, width) and whether they act. `own` and `no_gain`: one for all or (n);
        allowed: which gains (n) are possible"""
        e, width = self.evidence, right.shape[1]
        gains = solved(square, right)
        gains = np.where(no_gain[:, None], 1.0, gains)
        squares = left_of(e.squares[setting], gains, square, right)
        score = (e.likelihood(setting, squares) - e.without[setting] -
                 np.where(own, width * self.log_rows, 0.0))
        acts = allowed(gains[:, 0]) & (~own | (score >= OUTPUT_GAIN_MIN))
        return np.where(acts, score, 0.0), gains, acts

    def grid_equations(self, cause, settings):
        """Of every point of every subject's grid, under each of the settings: square, right"""
        subject, shape, power = cause.all_points()
        subjects = len(cause.subjects)
        n = len(subject) if cause.scale is None else len(subject) // subjects
        make = cause.columns if cause.scale is None else cause.unscaled
        found = [([], []) for _ in settings]
        at_once = self.d.batching.AT_ONCE
        for first in range(0, n, at_once):
            part = slice(first, min(n, first + at_once))
            columns = make(subject[part], shape[part], power[part])
            for parts, equations in zip(found, self.evidence.equations_under(columns, settings)):
                for whole, each in zip(parts, equations):
                    whole.append(each)
        found = [[np.concatenate(each) for each in parts] for parts in found]
        if cause.scale is not None:  # every subject's columns are the same but for a factor
            times = np.repeat(cause.scale, n)[:, None]
            found = [(np.tile(square, (subjects, 1, 1)) * times[:, None] ** 2,
                      np.tile(right, (subjects, 1)) * times) for square, right in found]
        return subject, shape, power, found

    def shortlists(self, settings):
        """Under each of the settings; columns are made once."""
        lists = [[] for _ in settings]
        for cause in self.causes:
            subject, shape, power, equations = self.grid_equations(cause, settings)
            n, price = len(cause.subjects), self.price(cause)
            allowed = lambda gain: cause.possible(subject, gain) if cause.possible else True
            forms = [np.full(len(subject), cause.form == form) for form in ("own", "none")]
            for chosen, setting, of in zip(lists, settings, equations):
                score = self.trials(*of, setting, *forms, allowed)[0].reshape(n, -1)
                best = np.argmax(score, axis=1) + score.shape[1] * np.arange(n)
                worth = score.ravel()[best] - price
                places = np.flatnonzero(worth > 0)
                for i in places if cause.scale is None else places[:1]:
                    chosen.append((cause, i, shape[best[i]], power[best[i]], worth[i], setting))
        return Candidates(each for chosen in lists
                          for each in sorted(chosen, key=lambda c: -c[4])[:SHORTLIST])

    def weigh(self, c, which, shapes, repeat=1):
        """Candidates `which`, each with `repeat` of the shapes in turn."""
        where = np.repeat(which, repeat)
        n = len(where)
        score, gains, acts = np.empty(n), np.zeros((n, 2)), np.empty(n, dtype=bool)
        for width in np.unique(c.width[where]):
            at = np.flatnonzero(c.width[where] == width)
            of, setting = where[at], c.setting[where[at]]
            square, right = self.evidence.equations(columns_of(c, of, shapes[at]), setting)
            allowed = lambda gain: self.possible(c, of, gain)
            score[at], gains[at, :width], acts[at] = self.trials(square, right, setting, c.own[of],
                                                                 c.no_gain[of], allowed)
        return score, gains, acts

    def possible(self, c, which, gain):
        allowed = np.ones(len(which), dtype=bool)
        for number in np.unique(c.number[which]):
            cause = self.causes[number]
            if cause.possible:
                at = c.number[which] == number
                allowed[at] = cause.possible(c.subject[which[at]], gain[at])
        return allowed

    def brackets(self, c, alive):
        """Neighbours on the grid, on the scale on which a shape is refined."""
        which, low, high = [], [], []
        for i in alive[c.refined[alive]]:
            cause = c.cause[i]
            grid = cause.grid_of(c.subject[i])
            above = np.searchsorted(grid, c.shape[i] * (1.0 + 1e-12), side="right")
            below = np.searchsorted(grid, c.shape[i])
            ends = np.array([grid[max(0, below - 1)], grid[min(len(grid) - 1, above)]])
            if cause.refined == "logarithmic":
                if not ends[0] > 0:
                    continue
                ends = np.log(ends)
            which.append(i)
            low.append(ends[0])
            high.append(ends[1])
        return np.array(which, dtype=int), np.array(low), np.array(high)

    def refine(self, c, alive):
        """From the shapes, scores and gains that were weighed last"""
        which, low, high = self.brackets(c, alive)
        if not len(which):
            return
        logarithmic = np.array([c.cause[i].refined == "logarithmic" for i in which])
        value_of = lambda x: np.where(logarithmic, np.exp(np.where(logarithmic, x, 0.0)), x)
        score, gains, acts = self.weighed[which], c.gains[which], c.acts[which]
        at = np.where(logarithmic, np.log(np.where(logarithmic, c.shape[which], 1.0)),
                      c.shape[which])
        one = np.arange(len(which))
        for _ in range(STEPS):
            step = (high - low) / (POINTS + 1)
            x = low + step * np.arange(1, POINTS + 1)[:, None]
            trial = self.weigh(c, which, value_of(x).T.ravel(), POINTS)
            best = np.argmax(trial[0].reshape(-1, POINTS), axis=1)
            flat = one * POINTS + best
            better = np.flatnonzero(trial[0][flat] > score)
            score[better], gains[better], acts[better] = (t[flat[better]] for t in trial)
            at[better] = x[best, one][better]
            low, high = np.maximum(low, at - step), np.minimum(high, at + step)
        c.shape[which] = value_of(at)
        self.weighed[which], c.gains[which], c.acts[which] = score, gains, acts

    def choose_noise(self, c, alive):
        """The likeliest for each, of its side; without a gain to be judged with it stays"""
        e = self.evidence
        for side in np.unique(c.setting[alive] // e.kinds):
            for width in np.unique(c.width[alive]):
                at = alive[(c.setting[alive] // e.kinds == side) & (c.width[alive] == width)]
                at = at[c.own[at] | c.acts[at]]
                if not len(at):
                    continue
                settings = [*range(side * e.kinds, (side + 1) * e.kinds)]
                likelihood = []
                for setting, (square, right) in zip(settings, e.equations_under(
                        columns_of(c, at, c.shape[at]), settings)):
                    gains = np.where(c.own[at][:, None], solved(square, right), c.gains[at, :width])
                    squares = left_of(e.squares[setting], gains, square, right)
                    likelihood.append(e.likelihood(setting, squares))
                c.setting[at] = settings[0] + np.argmax(likelihood, axis=0)

    def weigh_now(self, c, which):
        self.weighed[which], c.gains[which], c.acts[which] = self.weigh(c, which, c.shape[which])

    def settle(self, c):
        self.weighed = np.empty(len(c))
        alive = np.arange(len(c))
        self.weigh_now(c, alive)
        self.refine(c, alive)
        settled = []
        for _ in range(2):
            self.choose_noise(c, alive)
            self.weigh_now(c, alive)
            alive = alive[c.acts[alive]]
            self.refine(c, alive)
            # Without a shape the second round is the first.
            settled.append(alive[~c.refined[alive]])
            alive = alive[c.refined[alive]]
        last = np.concatenate([*settled, alive])
        e = self.evidence
        without = e.without[e.likeliest[c.setting[last] // e.kinds]]
        change = np.where(c.acts[last], e.without[c.setting[last]] - without, 0.0)
        c.score[last] = self.weighed[last] + change - [self.price(c.cause[i]) for i in last]

    def settle_anew(self, c):
        c.setting -= c.setting % self.evidence.kinds
        self.settle(c)

    def hear_witnesses(self, c):
        """Candidates with what the sensors say; of faults that the displacement cannot tell apart
        those that they support best"""
        twins = lambda i: c.cause[i].twins() if c.cause[i].scale is not None else [c.subject[i]]
        heard = [(i, subject) for i in range(len(c)) for subject in
                 (twins(i) if c.cause[i].sensor else [c.subject[i]])]
        if not heard:
            return c
        place, subject = np.array(heard).T
        first, c = c.subject[place], c.take(place)
        for number in np.unique(c.number[[each.scale is not None for each in c.cause]]):
            at, scale = np.flatnonzero(c.number == number), self.causes[number].scale
            c.gains[at] *= (scale[first[at]] / scale[subject[at]])[:, None]
        c.subject = subject
        faults = np.array([i for i in range(len(c)) if c.cause[i].sensor], dtype=int)
        if len(faults):
            errors = -columns_of(c, faults, c.shape[faults])[:, :, 0] / self.d.k[subject[faults]]
            errors *= np.where(c.acts[faults], c.gains[faults, 0], 0.0)
            c.score[faults] += self.witness.says(subject[faults], errors)
        order = np.lexsort((-c.score, place))
        rank = np.arange(len(c)) - np.searchsorted(place, place)
        return c.take(order[rank < TWINS_KEPT])

    def ranked(self):
        """What came into question on each of the sides, best first"""
        e = self.evidence
        settings = sorted({*e.likeliest, *range(0, len(e.squares), e.kinds)})
        c = self.shortlists(settings)
        self.settle(c)
        c = self.hear_witnesses(c)
        return [self.chosen(c, side) for side in range(len(e.sides))]

    def chosen(self, c, side):
        once = {}
        for i in np.argsort(-c.score, kind="stable"):
            if c.setting[i] // self.evidence.kinds == side:
                once.setdefault(c.key(i), i)
        c = c.take([i for i in once.values() if c.acts[i]])
        LeftOut(self.evidence, side).measure(c)
        first = {}  # what twins leave is the same, which rounding must not order
        for i in np.flatnonzero([each.scale is not None for each in c.cause]):
            one = first.setdefault((c.number[i], c.shape[i], c.setting[i]), i)
            c.log_left[i], c.left_out_gain[i] = c.log_left[one], c.left_out_gain[one]
        order = np.argsort(c.log_left, kind="stable")
        if len(order):
            tie = int(np.sum(c.log_left <= c.log_left[order[0]] + TIE))
            order[:tie] = order[:tie][np.argsort(-c.score[order[:tie]], kind="stable")]
        return c.take(order)
