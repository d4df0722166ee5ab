"""What candidates leave of rows that they were not fitted to, for diagnose_numpy.py. All candidates
under one setting at once: their shapes, the eight blocks and the common columns are stacked."""

import numpy as np

from diagnose_numpy_candidates import columns_of
from diagnose_numpy_evidence import BLOCKS, left_of, own_products, solved

WHOLE_GRID, NEAR = 40, 3


def shapes_of(c, i):
    cause, shape = c.cause[i], (c.shape[i], c.power[i])
    grid, powers = cause.points(c.subject[i])
    if cause.one_run or (len(grid) == 1 and not cause.refined):
        return [shape]
    whole = cause.grid_of(c.subject[i])
    if len(whole) > WHOLE_GRID:
        nearest = int(np.argmin(np.abs(whole - shape[0])))
        chosen = slice(max(0, nearest - NEAR), nearest + NEAR + 1)
        grid, powers = grid[chosen], powers[chosen]
    return [*zip(grid, powers), shape]


def in_blocks(values):
    return values.reshape(BLOCKS, -1, *values.shape[1:])


def centred(blocks):
    """Values in each block, their mean outside of it taken off"""
    inside = blocks.sum(axis=1)
    outside = inside.sum(axis=0) - inside
    mean = outside / (blocks.shape[1] * (BLOCKS - 1))
    return blocks - mean[:, None]


class Products:
    """Cross products of common columns and residual (last) under one setting: of all rows, and of
    those without each block"""

    def __init__(self, e, setting):
        side, kind = e.sides[setting // e.kinds], setting % e.kinds
        self.white = in_blocks(side.white[kind])
        blocks = self.white.transpose(0, 2, 1) @ self.white
        self.m = m = blocks.shape[1] - 1
        self.all = blocks.sum(axis=0, keepdims=True)
        self.all[:, range(m), range(m)] += side.precision[kind]
        self.without = self.all - blocks

    def carried(self, rest, cross):
        """What the common columns carry of each of the others and of the residual (last)"""
        m = self.m
        others = np.concatenate([cross[:, :m], rest[:, :m, m:]], axis=2)
        return np.linalg.solve(rest[:, :m, :m], others)

    def fit(self, rest, cross, own, carried):
        """Normal equations with the common columns taken out: square (b, n, width, width), right
        (b, n, width), squares (b, 1). cross (b, m + 1, n x width), own (b, n, width, width)"""
        n, width = own.shape[1:3]
        form = lambda values: values.reshape(len(values), -1, n, width)
        of_columns = carried[:, :, :-1]
        if width == 1:
            taken = np.sum(cross[:, :-1] * of_columns, axis=1)[:, :, None, None]
        else:
            taken = np.einsum("bmni,bmnj->bnij", form(cross[:, :-1]), form(of_columns))
        square = own - taken
        known = rest[:, -1:, :-1]
        right = form(cross[:, -1:] - known @ of_columns)[:, 0]
        squares = rest[:, -1, -1:] - (known @ carried[:, :, -1:])[:, :, 0]
        return square, right, squares


class LeftOut:
    """Of the candidates of one side"""

    def __init__(self, e, number):
        self.e, self.side, self.known = e, e.sides[number], {}
        self.common, self.residual = in_blocks(self.side.common), in_blocks(e.residual)
        self.common_centred, self.residual_centred = centred(self.common), centred(self.residual)
        products = self.products(e.likeliest[number])
        rest = products.without
        before = np.linalg.solve(rest[:, :-1, :-1], rest[:, :-1, -1:])
        self.accepted_before = before[:, self.side.free]

    def products(self, setting):
        if setting not in self.known:
            self.known[setting] = Products(self.e, setting)
        return self.known[setting]

    def measure(self, c):
        """c.left_out_gain and c.log_left"""
        groups = {}
        for i, cause in enumerate(c.cause):
            groups.setdefault((c.setting[i], cause.width, cause.one_run), []).append(i)
        for (setting, _, one_run), which in groups.items():
            which = np.array(which)
            measured, beside, after, alone = self.squares(c, which, setting, one_run)
            # What only undoes what it makes the coefficients do has explained nothing.
            before = np.minimum(measured, beside)
            c.left_out_gain[which] = 1.0 - np.sqrt(np.maximum(after / before, alone / measured))
            c.log_left[which] = 0.5 * np.log(np.maximum(after / measured, 1e-12))

    def squares(self, c, which, setting, one_run):
        e, products = self.e, self.products(setting)
        shapes = [shapes_of(c, i) for i in which]
        count = np.array([len(each) for each in shapes])
        where = np.repeat(which, count)
        shape, power = np.array([point for each in shapes for point in each]).T
        raw = columns_of(c, where, shape, power)
        white, = e.noise.white(raw.reshape(e.rows, -1), [setting % e.kinds])
        cross = products.white.transpose(0, 2, 1) @ in_blocks(white)
        own = np.stack([own_products(part) for part in in_blocks(white.reshape(raw.shape))])
        all_cross, all_own = cross.sum(axis=0, keepdims=True), own.sum(axis=0, keepdims=True)
        without = products.carried(products.without, all_cross - cross)
        if one_run:  # located within a run: fitted to all rows
            fit = (products.all, all_cross, all_own, products.carried(products.all, all_cross))
        else:
            fit = (products.without, all_cross - cross, all_own - own, without)
        square, right, squares = products.fit(*fit)
        gains = solved(square, right)
        gains[:, c.no_gain[where]] = 1.0
        misfit = np.maximum(left_of(squares, gains, square, right), 1e-12)
        ends = np.cumsum(count)
        best = np.stack([first + np.argmin(misfit[:, first:last], axis=1)
                         for first, last in zip(ends - count, ends)], axis=1)
        gains = np.take_along_axis(gains, best[:, :, None], axis=1)
        shape = (BLOCKS, len(which))
        return self.left(raw, without, np.broadcast_to(best, shape),
                         np.broadcast_to(gains, shape + gains.shape[2:]), one_run)

    def left(self, raw, carried, best, gains, one_run):
        """Squares of what there is, of what errors of the coefficients leave, of what the
        candidates leave of that and of what they leave by themselves: (4, candidates)"""
        block = np.arange(BLOCKS)[:, None]
        of_columns = carried[:, :, :-1].reshape(BLOCKS, -1, *raw.shape[1:])[block, :, best]
        common = carried[:, :, -1:] - np.einsum("bkmw,bkw->bmk", of_columns, gains)
        explained = np.einsum("bkrw,bkw->brk", in_blocks(raw)[block, :, best], gains)
        columns, residual = self.common, self.residual
        if not one_run:
            columns, residual = self.common_centred, self.residual_centred
            inside = in_blocks(raw).sum(axis=1)
            outside = (inside.sum(axis=0) - inside)[block, best] / (len(raw) - explained.shape[1])
            explained -= np.sum(outside * gains, axis=2)[:, None]
        free = columns[:, :, self.side.free]
        measured = np.broadcast_to(residual[:, :, None] - free @ self.accepted_before,
                                   explained.shape)
        accepted_taken = residual[:, :, None] - free @ common[:, self.side.free]
        coefficients = self.side.coefficients
        beside = accepted_taken - columns[:, :, coefficients] @ common[:, coefficients]
        left = np.stack([measured, beside, beside - explained, accepted_taken - explained])
        if one_run:
            left -= left.mean(axis=(1, 2), keepdims=True)
        return np.einsum("qbrk,qbrk->qk", left, left)
