#!/usr/bin/python3
"""The search of `thermocomp diagnose` once more, batched in numpy, for one run with one output.

The same hypotheses, grids, noise shapes, shortlists, refinement, witnesses, left-out blocks, rounds and
spreads as the program; diagnose.py compares the numbers. Batched: the columns of all
subjects and grid points of a cause (1024 at a time); the whitening of all columns and of all eight
blocks at once, under one noise or each under its own; cross products by one BLAS product; the
refinement, the choice of noise and the left-out blocks of all candidates of both shortlists at once;
small systems as stacks of matrices. The witnesses share one whitened matrix a noise. One after
another go only the rounds, the steps within a refinement and, within a witness, the candidates.
What is not done here and is in the program's time: common errors of all coefficients and calmed
readings (the peer makes the search as it was before them, so that its numbers differ by what they
change), other runs and outputs, missing rows, test rows, reports. Argument: the folder of
diagnose_data.py. Prints JSON: what was weighed, what was found.
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

# ruff: noqa: E402
import bisect
import json
import sys

import numpy as np

import diagnose_numpy_causes as causes

BLOCKS, SHORTLIST, POINTS, STEPS, AT_ONCE = 8, 20, 6, 4, 1024
FINDINGS_MAX, REFITS, WHOLE_GRID, NEAR, TIE = 4, 2, 40, 3, 0.1
OUTPUT_GAIN_MIN, SUPPORT_MAX = 6.0, 400.0


class Noise:
    """Gains of the filter that whitens a block, one column a noise."""

    def __init__(self, shapes, block_rows, step_s):
        ratio, tau_s = np.array(shapes).T
        self.keep = np.exp(-step_s / tau_s)
        self.gain = np.empty((block_rows, len(ratio)))
        self.scale = np.empty_like(self.gain)
        self.log_determinant = np.zeros(len(ratio))
        variance = ratio.copy()
        for row in range(block_rows):
            if row:
                variance = ratio + self.keep ** 2 * (variance - ratio)
            self.gain[row] = variance / (variance + 1.0)
            self.scale[row] = 1.0 / np.sqrt(variance + 1.0)
            self.log_determinant += np.log(variance + 1.0)
            variance = variance * (1.0 - self.gain[row])

    def white(self, columns, of, blocks):
        """columns (rows, n) under noise `of`, one for all or one a column"""
        rows = columns.shape[0] // blocks
        out = np.array(columns, order="C").reshape(blocks, rows, -1)
        if np.ndim(of) == 0 and self.gain[0, of] == 0.0:
            return out.reshape(columns.shape)
        keep, gain, scale = (np.broadcast_to(x[..., of], x.shape[:-1] + np.shape(of))
                             for x in (self.keep, self.gain, self.scale))
        state = np.zeros((blocks, out.shape[2]))
        for row in range(rows):
            here = out[:, row]
            state *= keep
            here -= state
            state += gain[row] * here
            here *= scale[row]
        return out.reshape(columns.shape)


class Candidates:
    """Hypotheses with a shape each, and what is settled of them: arrays, one place a hypothesis."""

    def __init__(self, chosen):
        """chosen: (cause, subject, shape, power, score, noise)"""
        self.cause = [c[0] for c in chosen]
        self.subject = np.array([c[1] for c in chosen], dtype=int)
        self.shape = np.array([c[2] for c in chosen], dtype=float)
        self.power = np.array([c[3] for c in chosen], dtype=float)
        self.score = np.array([c[4] for c in chosen], dtype=float)
        self.noise = np.array([c[5] for c in chosen], dtype=int)
        self.gains = np.zeros((len(chosen), 2))
        self.acts = np.zeros(len(chosen), dtype=bool)
        self.share = np.zeros(len(chosen))
        self.log_left = np.zeros(len(chosen))

    def key(self, i):
        return self.cause[i].name, self.cause[i].subjects[self.subject[i]]

    def take(self, which):
        out = Candidates([])
        out.cause = [self.cause[i] for i in which]
        for name in ("subject", "shape", "power", "score", "noise", "gains", "acts", "share",
                     "log_left"):
            setattr(out, name, getattr(self, name)[which])
        return out


def columns_of(c, which, shapes, powers=None):
    """Columns (rows, n, 2) of the candidates `which` with the shapes given; a second column is 0
    where a hypothesis has one only. Candidates of one cause are made together."""
    powers = c.power[which] if powers is None else powers
    out = None
    names = [id(c.cause[i]) for i in which]
    for one in dict.fromkeys(names):
        at = np.array([n == one for n in names])
        cause = c.cause[which[int(np.argmax(at))]]
        made = cause.make(c.subject[which][at], shapes[at], powers[at])
        if out is None:
            out = np.zeros((len(made), len(which), 2))
        out[:, at, :cause.width] = made.reshape(len(made), -1, cause.width)
    return out


class Evidence:
    """The residual with what was accepted, under every noise."""

    def __init__(self, d, found):
        self.d, rows = d, len(d.time_s)
        self.rows = rows
        self.noise_um = max(1e-3, np.sort(np.abs(np.diff(d.residual, 2)))[(rows - 2) // 2] /
                            (0.6745 * np.sqrt(6.0)))
        free = [np.ones((rows, 1))]
        self.residual = d.residual.copy()
        for i in range(len(found.cause)):
            column = columns_of(found, np.array([i]), found.shape[[i]])[:, 0, :found.cause[i].width]
            if found.cause[i].form == "own":
                free.append(column / max(1e-12, np.abs(column).max()))
            else:
                self.residual -= column @ found.gains[i, :1]
        self.common = np.hstack(free)
        self.precision = np.full(self.common.shape[1], self.noise_um ** 2 / 1e8)
        size = self.residual.std()
        shapes = [(0.0, 1.0)] + [((share * size) ** 2 / self.noise_um ** 2, tau_s)
                                 for share in (0.1, 0.3, 1.0)
                                 for tau_s in (1200.0, 3600.0, 10800.0)]
        self.noise = Noise(shapes, rows // BLOCKS, d.step_s)
        kinds = np.arange(len(shapes))
        both = np.hstack([self.common, self.residual[:, None]])
        width = both.shape[1]
        white = self.noise.white(np.tile(both, len(shapes)), np.repeat(kinds, width), BLOCKS)
        self.white = white.reshape(rows, len(shapes), width)  # common columns, residual
        gram = np.einsum("rsi,rsj->sij", self.white, self.white, optimize=True)
        gram[:, range(width - 1), range(width - 1)] += self.precision
        self.factor = np.linalg.cholesky(gram[:, :-1, :-1])
        self.inverse = np.linalg.inv(self.factor)
        self.known = (self.inverse @ gram[:, :-1, -1:])[:, :, 0]
        self.squares = gram[:, -1, -1] - np.sum(self.known ** 2, axis=1)
        self.log_determinant = (BLOCKS * self.noise.log_determinant - np.log(self.precision).sum() +
                                2 * np.log(np.diagonal(self.factor, axis1=1, axis2=2)).sum(axis=1))
        self.likeliest = int(np.argmax(self.likelihood(kinds, self.squares)))

    def likelihood(self, kind, squares):
        squares = np.maximum(squares, 1e-9 * self.rows)
        return -self.rows * np.log(squares / self.rows) - self.log_determinant[kind]

    def equations(self, columns, kind):
        """columns (rows, n, width), kind: one noise or (n) -> square (n, width, width), right"""
        rows, n, width = columns.shape
        kinds = kind if np.ndim(kind) == 0 else np.repeat(kind, width)
        white = self.noise.white(columns.reshape(rows, -1), kinds, BLOCKS)
        if np.ndim(kind) == 0:
            cross = self.white[:, kind].T @ white
            shared = self.inverse[kind] @ cross[:-1]
            right = cross[-1] - self.known[kind] @ shared
        else:
            cross = (self.white.reshape(rows, -1).T @ white).reshape(*self.white.shape[1:], -1)
            cross = cross[kinds, :, np.arange(n * width)]
            shared = np.einsum("nij,nj->in", self.inverse[kinds], cross[:, :-1])
            right = cross[:, -1] - np.einsum("ni,in->n", self.known[kinds], shared)
        white = white.reshape(rows, n, width)
        shared = shared.reshape(-1, n, width)
        square = np.empty((n, width, width))
        for a in range(width):
            for b in range(a, width):
                square[:, a, b] = square[:, b, a] = (
                    np.einsum("rn,rn->n", white[:, :, a], white[:, :, b]) -
                    np.einsum("mn,mn->n", shared[:, :, a], shared[:, :, b]))
        return square, right.reshape(n, width)


def solved(square, right, two):
    """Gains (n, width); `two`: which have two columns"""
    if square.shape[1] == 1:
        return right / np.maximum(square[:, :, 0], 1e-300)
    gains = np.zeros_like(right)
    gains[:, 0] = right[:, 0] / np.maximum(square[:, 0, 0], 1e-300)
    if np.any(two):
        gains[two] = np.linalg.solve(square[two], right[two, :, None])[:, :, 0]
    return gains


def left_of(squares, gains, square, right):
    return (squares - 2.0 * np.sum(gains * right, axis=1) +
            np.einsum("ni,nij,nj->n", gains, square, gains))


class Search:
    def __init__(self, d):
        self.d, self.rows = d, len(d.time_s)
        assert self.rows % BLOCKS == 0 and np.ptp(np.diff(d.time_s)) == 0.0
        self.causes = causes.all_causes(d)
        self.log_rows = np.log(self.rows)

    def trials(self, cause_of, subject, two, square, right, kind):
        """Scores, gains and whether they act, one a group of columns. cause_of: a cause or (n)."""
        e, n = self.evidence, len(right)
        every = [cause_of] if isinstance(cause_of, causes.Cause) else cause_of
        per = lambda value: np.broadcast_to(np.array([value(c) for c in every]), n)
        own, no_gain = per(lambda c: c.form == "own"), per(lambda c: c.form == "none")
        gains = solved(square, right, two)
        gains[no_gain] = np.eye(1, gains.shape[1])
        allowed = np.ones(n, dtype=bool)
        for cause in {id(c): c for c in every}.values():
            if cause.possible:
                at = per(lambda c: c is cause)
                allowed[at] = cause.possible(subject[at], gains[at, 0])
        squares = left_of(e.squares[kind], gains, square, right)
        score = (e.likelihood(kind, squares) - e.likelihood(kind, e.squares[kind]) -
                 np.where(own, (1.0 + two) * self.log_rows, 0.0))
        acts = allowed & (~own | (score >= OUTPUT_GAIN_MIN))
        return np.where(acts, score, 0.0), gains, acts

    def price(self, cause):
        return cause.handicap + self.log_rows * ((cause.refined != "") + (cause.form == "shared"))

    def profile(self, kinds):
        """The shortlist under each of the kinds of noise; columns are made once."""
        lists = [[] for _ in kinds]
        for cause in self.causes:
            points = [cause.points(i) for i in range(len(cause.subjects))]
            each = len(points[0][0])
            shape, power = (np.concatenate([p[j] for p in points]) for j in (0, 1))
            subject = np.repeat(np.arange(len(points)), each)
            scores = np.empty((len(kinds), len(subject)))
            for first in range(0, len(subject), AT_ONCE):
                part = slice(first, first + AT_ONCE)
                columns = cause.make(subject[part], shape[part], power[part])
                columns = columns.reshape(self.rows, -1, cause.width)
                two = np.full(columns.shape[1], cause.width == 2)
                for k, kind in enumerate(kinds):
                    square, right = self.evidence.equations(columns, kind)
                    scores[k, part] = self.trials(cause, subject[part], two, square, right, kind)[0]
            for k, kind in enumerate(kinds):
                by_subject = scores[k].reshape(-1, each)
                best = np.argmax(by_subject, axis=1) + each * np.arange(len(points))
                for i, at in enumerate(best):
                    worth = scores[k, at] - self.price(cause)
                    if scores[k, at] > 0 and worth > 0:
                        lists[k].append((cause, i, shape[at], power[at], worth, kind))
        shortlists = [sorted(each, key=lambda c: -c[4])[:SHORTLIST] for each in lists]
        return Candidates([c for each in shortlists for c in each])

    def weigh(self, c, which, shapes, repeat=1):
        """Candidates `which`, each with `repeat` of the shapes in turn."""
        where = np.repeat(which, repeat)
        columns = columns_of(c, where, shapes)
        kind = c.noise[where]
        two = np.array([c.cause[i].width == 2 for i in where])
        square, right = self.evidence.equations(columns, kind)
        return self.trials([c.cause[i] for i in where], c.subject[where], two, square, right, kind)

    def brackets(self, c, alive):
        """Neighbours on the grid, on the scale on which a shape is refined."""
        which, low, high = [], [], []
        for i in alive:
            cause = c.cause[i]
            if not cause.refined:
                continue
            grid = list(cause.grid[c.subject[i]] if cause.grid.ndim == 2 else cause.grid)
            above = bisect.bisect_right(grid, c.shape[i] * (1.0 + 1e-12))
            below = bisect.bisect_left(grid, c.shape[i])
            ends = (grid[max(0, below - 1)], grid[min(len(grid) - 1, above)])
            if cause.refined == "logarithmic":
                if not ends[0] > 0:
                    continue
                ends = np.log(ends)
            which.append(i)
            low.append(ends[0])
            high.append(ends[1])
        return np.array(which, dtype=int), np.array(low), np.array(high)

    def refine(self, c, alive):
        which, low, high = self.brackets(c, alive)
        if not len(which):
            return
        logarithmic = np.array([c.cause[i].refined == "logarithmic" for i in which])
        value_of = lambda x: np.where(logarithmic[:, None], np.exp(np.where(logarithmic[:, None], x,
                                                                            0.0)), x)
        score, gains, acts = self.weigh(c, which, c.shape[which])
        at = np.where(logarithmic, np.log(np.where(logarithmic, c.shape[which], 1.0)),
                      c.shape[which])
        for _ in range(STEPS):
            step = (high - low) / (POINTS + 1)
            x = low[:, None] + step[:, None] * np.arange(1, POINTS + 1)
            trial = self.weigh(c, which, value_of(x).ravel(), POINTS)
            scores = trial[0].reshape(-1, POINTS)
            best = np.argmax(scores, axis=1)
            one = np.arange(len(which))
            better = scores[one, best] > score
            flat = (one * POINTS + best)[better]
            score[better], gains[better], acts[better] = (t[flat] for t in trial)
            at[better] = x[one, best][better]
            low, high = np.maximum(low, at - step), np.minimum(high, at + step)
        c.shape[which] = value_of(at[:, None])[:, 0]
        c.gains[which], c.acts[which] = gains, acts

    def likeliest_noise(self, c, alive):
        e = self.evidence
        columns = columns_of(c, alive, c.shape[alive])
        n, kinds = len(alive), len(e.squares)
        every = np.tile(columns, (1, kinds, 1))
        kind = np.repeat(np.arange(kinds), n)
        square, right = e.equations(every, kind)
        two = np.tile([c.cause[i].width == 2 for i in alive], kinds)
        own = np.tile([c.cause[i].form == "own" for i in alive], kinds)
        gains = np.where(own[:, None], solved(square, right, two), np.tile(c.gains[alive],
                                                                           (kinds, 1)))
        squares = left_of(e.squares[kind], gains, square, right)
        likelihood = e.likelihood(kind, squares).reshape(kinds, n)
        # What does not act has no gain to be judged with: its noise stays.
        usable = own[:n] | c.acts[alive]
        c.noise[alive] = np.where(usable, np.argmax(likelihood, axis=0), c.noise[alive])

    def settle(self, c):
        alive = np.arange(len(c.cause))
        self.refine(c, alive)
        for _ in range(2):
            self.likeliest_noise(c, alive)
            _, gains, acts = self.weigh(c, alive, c.shape[alive])
            c.gains[alive], c.acts[alive] = gains, acts
            alive = alive[acts]
            if not len(alive):
                return
            self.refine(c, alive)
        score, c.gains[alive], c.acts[alive] = self.weigh(c, alive, c.shape[alive])
        e = self.evidence
        change = (e.likelihood(c.noise[alive], e.squares[c.noise[alive]]) -
                  e.likelihood(e.likeliest, e.squares[e.likeliest]))
        c.score[alive] = (score - [self.price(c.cause[i]) for i in alive] +
                          np.where(c.acts[alive], change, 0.0))

    def settle_anew(self, c):
        c.noise[:] = 0
        every = np.arange(len(c.cause))
        _, c.gains, c.acts = self.weigh(c, every, c.shape)
        self.settle(c)

    def witnesses(self, c):
        """What the readings themselves say of their faults."""
        d, rows = self.d, self.rows
        faults = [i for i in range(len(c.cause)) if c.cause[i].sensor]
        if not faults:
            return
        temps = np.hstack([d.inputs, d.others])
        lag = lambda values, tau: causes.low_pass(values, np.full(values.shape[1], tau), d.step_s)
        from_all = np.hstack([np.ones((rows, 1)), temps, lag(temps, 1800.0), lag(d.signals, 600.0),
                              lag(d.signals, 3600.0)])
        size = np.abs(from_all).max(axis=0)
        from_all = from_all / np.where(size > 0, size, 1.0)
        errors = np.zeros((rows, len(faults)))
        for k, i in enumerate(faults):
            column = columns_of(c, np.array([i]), c.shape[[i]])[:, 0, 0]
            errors[:, k] = -column / d.k[c.subject[i]] * c.gains[i, 0]
        of = c.subject[faults]
        everything = np.hstack([from_all, d.inputs[:, of], errors])
        noise = Noise([(ratio, tau_s) for ratio in (1.0, 30.0, 1000.0)
                       for tau_s in (600.0, 3600.0, 20000.0)], rows, d.step_s)
        n, first = len(faults), from_all.shape[1]
        best = np.full((2, n), -np.inf)
        for kind in range(9):
            white = noise.white(everything, kind, 1)
            gram = white.T @ white
            for k in range(n):
                keep = np.ones(first, dtype=bool)
                keep[[1 + of[k], 1 + temps.shape[1] + of[k]]] = False
                mine = np.r_[np.flatnonzero(keep), first + k, first + n + k]
                g = gram[np.ix_(mine, mine)]
                own = g[:-2, :-2] + 1e-6 * np.eye(len(mine) - 2)
                factor = np.linalg.cholesky(own)
                shared = np.linalg.solve(factor, g[:-2, -2:])
                g = g[-2:, -2:] - shared.T @ shared
                log_determinant = (noise.log_determinant[kind] - len(own) * np.log(1e-6) +
                                   2 * np.log(np.diag(factor)).sum())
                for which, squares in enumerate((g[0, 0], g[0, 0] - 2 * g[0, 1] + g[1, 1])):
                    squares = max(squares, 1e-9 * rows)
                    value = -rows * np.log(squares / rows) - log_determinant
                    best[which, k] = max(best[which, k], value)
        says = np.clip(best[1] - best[0], -SUPPORT_MAX, SUPPORT_MAX)
        c.score[faults] += np.where(np.abs(errors).max(axis=0) > 0, says, -SUPPORT_MAX)

    def left_shapes(self, cause, i, shape, power):
        grid, powers = cause.points(i)
        if len(grid) == 1 and not cause.refined:
            return [(shape, power)]
        whole = cause.grid[i] if cause.grid.ndim == 2 else cause.grid
        if len(whole) > WHOLE_GRID:
            nearest = int(np.argmin(np.abs(whole - shape)))
            chosen = slice(max(0, nearest - NEAR), nearest + NEAR + 1)
            grid, powers = grid[chosen], powers[chosen]
        return [*zip(grid, powers), (shape, power)]

    def measure_left_out(self, c):
        fitted = np.array([cause.one_run for cause in c.cause])
        for which, blocks in ((np.flatnonzero(fitted), False), (np.flatnonzero(~fitted), True)):
            if len(which):
                ratio = self.left_out(c, which, blocks)
                c.share[which] = 1.0 - np.sqrt(ratio)
                c.log_left[which] = 0.5 * np.log(np.maximum(ratio, 1e-12))

    def left_out(self, c, which, by_block):
        """Squares with over squares without, in rows that were left out of fit and shape."""
        e, rows = self.evidence, self.rows
        shapes = [self.left_shapes(c.cause[i], c.subject[i], c.shape[i], c.power[i]) if by_block
                  else [(c.shape[i], c.power[i])] for i in which]
        count = np.array([len(s) for s in shapes])
        where = np.repeat(which, count)
        shape, power = np.array([point for each in shapes for point in each]).T
        raw = columns_of(c, where, shape, power)
        n, m, cut = len(where), e.common.shape[1], BLOCKS if by_block else 1
        kind = c.noise[where]
        white = e.noise.white(raw.reshape(rows, -1), np.repeat(kind, 2), BLOCKS)
        white = white.reshape(cut, -1, n, 2)
        known = e.white.reshape(cut, -1, *e.white.shape[1:])
        flat = known.reshape(cut, known.shape[1], -1).transpose(0, 2, 1)
        cross = (flat @ white.reshape(cut, -1, 2 * n)).reshape(cut, *e.white.shape[1:], n, 2)
        cross = cross[:, kind, :, np.arange(n)]                    # (n, cut, common + 1, 2)
        own = np.einsum("crna,crnb->ncab", white, white)
        base = (known.transpose(0, 2, 3, 1) @ known.transpose(0, 2, 1, 3))[:, kind]
        gram = np.empty((n, cut, m + 3, m + 3))                    # common, own, residual
        order = np.r_[np.arange(m), m + 2]
        gram[np.ix_(range(n), range(cut), order, order)] = base.transpose(1, 0, 2, 3)
        gram[:, :, order, m:m + 2] = cross
        gram[:, :, m:m + 2, order] = cross.transpose(0, 1, 3, 2)
        gram[:, :, m:m + 2, m:m + 2] = own
        total = gram.sum(axis=1, keepdims=True)
        total[:, :, range(m), range(m)] += e.precision
        rest = (total - gram if by_block else total).reshape(-1, m + 3, m + 3)
        carried = np.linalg.solve(rest[:, :m, :m], rest[:, :m, m:])
        reduced = rest[:, m:, m:] - rest[:, m:, :m] @ carried
        cause = [c.cause[i] for i in where for _ in range(cut)]
        two = np.array([each.width == 2 for each in cause])
        gains = solved(reduced[:, :2, :2], reduced[:, :2, 2], two)
        gains[[each.form == "none" for each in cause]] = (1.0, 0.0)
        misfit = left_of(reduced[:, 2, 2], gains, reduced[:, :2, :2], reduced[:, :2, 2])
        best = np.stack([first + np.argmin(part, axis=0) for first, part in zip(
            np.cumsum(count) - count, np.split(misfit.reshape(n, cut), np.cumsum(count)[:-1]))])
        taken = best * cut + np.arange(cut)                        # (candidates, cut)
        before = carried[taken][:, :, 1:, 2]
        after = before - np.einsum("kcmi,kci->kcm", carried[taken][:, :, 1:, :2], gains[taken])
        left = [e.residual[:, None, None] - np.einsum("rm,kcm->rkc", e.common[:, 1:], before)]
        left.append(e.residual[:, None, None] - np.einsum("rm,kcm->rkc", e.common[:, 1:], after) -
                    np.einsum("rkca,kca->rkc", raw[:, best], gains[taken]))
        squares = [self.squares_outside(each, cut) for each in left]
        return squares[1] / squares[0]

    def squares_outside(self, left, cut):
        """left (rows, k, cut): squares in each block, the mean outside of it taken off"""
        rows, size = len(left), len(left) // cut
        total = 0.0
        for block in range(cut):
            inside = left[block * size:(block + 1) * size, :, block]
            outside = left[:, :, block].sum(axis=0)
            count = rows
            if cut > 1:
                outside, count = outside - inside.sum(axis=0), rows - size
            total = total + np.sum((inside - outside / count) ** 2, axis=0)
        return total

    def ranked(self):
        c = self.profile([self.evidence.likeliest, 0])
        self.settle(c)
        self.witnesses(c)
        once = {}
        for i in np.argsort(-c.score, kind="stable"):
            once.setdefault(c.key(i), i)
        c = c.take(np.array([i for i in once.values() if c.acts[i]], dtype=int))
        self.measure_left_out(c)
        order = np.argsort(c.log_left, kind="stable")
        if len(order):
            tie = int(np.sum(c.log_left <= c.log_left[order[0]] + TIE))
            order[:tie] = order[:tie][np.argsort(-c.score[order[:tie]], kind="stable")]
        return c.take(order)

    def accept(self, found, but=None):
        keep = np.array([i for i in range(len(found.cause)) if i != but], dtype=int)
        self.evidence = Evidence(self.d, found.take(keep))

    def earned(self, c, first):
        explained = columns_of(c, np.array([0]), c.shape[:1])[:, 0] @ c.gains[0]
        least = max(self.evidence.noise_um, 0.005 * self.d.measured.std(),
                    0.0 if first else 0.2 * self.d.residual.std())
        return (c.share[0] >= 0.12 and (c.score[0] >= 25.0 or c.share[0] >= 0.7) and
                explained.std() > least)

    def joined(self, a, b):
        out = Candidates([])
        out.cause = a.cause + b.cause
        for name in ("subject", "shape", "power", "score", "noise", "gains", "acts", "share",
                     "log_left"):
            setattr(out, name, np.concatenate([getattr(a, name), getattr(b, name)]))
        return out

    def settle_each(self, found):
        """Every finding beside the others."""
        i = 0
        while i < len(found.cause):
            self.accept(found, i)
            one = found.take(np.array([i]))
            self.settle_anew(one)
            parts = [found.take(np.arange(i)), found.take(np.arange(i + 1, len(found.cause)))]
            found = self.joined(parts[0], self.joined(one, parts[1]) if one.acts[0] else parts[1])
            i += bool(one.acts[0])
        return found

    def spread(self, one):
        """Standard deviation of the shape, from the curvature of the likelihood."""
        cause = one.cause[0]
        if not cause.refined or not one.score[0] > 0:
            return 0.0
        logarithmic = cause.refined == "logarithmic"
        size = 1.0 if logarithmic else cause.grid.ravel()[-1] - cause.grid.ravel()[0]
        steps = 1e-3 * size * 2.0 ** np.arange(10)
        moves = np.r_[0.0, steps, -steps]
        shapes = one.shape[0] * np.exp(moves) if logarithmic else one.shape[0] + moves
        score = self.weigh(one, np.array([0]), shapes, len(shapes))[0]
        fall = score[0] - 0.5 * (score[1:11] + score[11:])
        seen = np.flatnonzero(fall > 4.0)
        return float(steps[seen[0]] / np.sqrt(fall[seen[0]])) if len(seen) else size

    def run(self):
        found, weighed = Candidates([]), []
        for number in range(1, FINDINGS_MAX + 1):
            self.accept(found)
            c = self.ranked()
            known = {found.key(i) for i in range(len(found.cause))}
            c = c.take(np.array([i for i in range(len(c.cause)) if c.key(i) not in known],
                                dtype=int))
            weighed += [dict(round=number, cause=c.cause[i].name, subject=c.key(i)[1],
                             score=c.score[i], left_out_gain=c.share[i], log_left=c.log_left[i])
                        for i in range(min(12, len(c.cause)))]
            if not len(c.cause) or not self.earned(c, not found.cause):
                break
            found = self.joined(found, c.take(np.array([0])))
            for _ in range(REFITS if len(found.cause) > 1 else 0):
                found = self.settle_each(found)
        found = self.settle_each(found)
        spreads = []
        for i in range(len(found.cause)):
            self.accept(found, i)
            spreads.append(self.spread(found.take(np.array([i]))))
        findings = [dict(cause=found.cause[i].name, subject=found.key(i)[1], shape=found.shape[i],
                         gain=found.gains[i, 0], shape_sd=spreads[i])
                    for i in range(len(found.cause))]
        return dict(weighed=weighed, findings=findings)


if __name__ == "__main__":
    print(json.dumps(Search(causes.Data(sys.argv[1])).run()))
