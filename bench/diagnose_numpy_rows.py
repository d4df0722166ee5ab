"""The plain peer of diagnose_numpy.py: recursions over time as a loop over rows, on all columns at
once. Each row has its own step, so that rows need not be evenly spaced."""

import numpy as np

AT_ONCE = 1024  # columns that are made, whitened and multiplied together
FIRST_SEARCHES = ((True,), (False,))  # with errors of the coefficients, then without: two searches
NARROW = 8  # columns, up to which numbers are quicker than arrays


def add_before(values, factors):
    """values[i] += factors[i - 1] values[i - 1], row by row"""
    before, scratch = values[0], np.empty_like(values[0])
    for factor, now in zip(factors, values[1:]):
        np.multiply(before, factor, scratch)
        np.add(now, scratch, now)
        before = now


def narrow(values, factors):
    """The same of one column: numbers are quicker by themselves than as arrays of one"""
    before = float(values[0])
    return [before := now + factor * before
            for now, factor in zip(values[1:].tolist(), factors.tolist())]


def low_pass(values, taus_s, steps_s):
    """values (rows, n), taus_s (n), 0 of which passes the values on, steps_s (rows - 1)"""
    different, which = np.unique(steps_s, return_inverse=True)
    share = -np.expm1(-different[:, None] / np.maximum(taus_s, 1e-300))
    keep = 1.0 - share
    out = np.empty_like(values)
    out[0] = values[0]
    np.multiply(values[1:], share if len(share) == 1 else share[which], out=out[1:])
    if values.shape[1] <= NARROW:
        for column in range(values.shape[1]):
            out[1:, column] = narrow(out[:, column], keep[which, column])
        return out
    kept = [*keep]
    add_before(out, [kept[place] for place in which.tolist()])
    return out


def play(values, widths):
    """values (rows, n), widths (n)"""
    half, out = 0.5 * widths, np.empty_like(values)
    before, scratch = values[0], np.empty_like(values[0])
    for value, now in zip(values, out):
        np.subtract(value, half, scratch)
        np.maximum(before, scratch, scratch)
        np.add(value, half, now)
        np.minimum(scratch, now, now)
        before = now
    return out


class Noise:
    """The Kalman filter that whitens blocks of rows, for several shapes (ratio, tau_s) of noise:
    `kind` is one's place. With a row's gain, what it tells beyond the rows before it is
    v(i) = y(i) - keep y(i - 1) + keep (1 - gain) v(i - 1). Every block begins anew: blocks, and
    kinds, are columns too."""

    def __init__(self, shapes, blocks, steps_s):
        ratio, tau_s = np.array(shapes).T
        steps_s = np.r_[steps_s, 0.0].reshape(blocks, -1)
        # (rows of a block, kinds, blocks, 1)
        keep = np.exp(-steps_s.T[:, None, :, None] / tau_s[:, None, None])
        kept = keep ** 2
        fresh = ratio[:, None, None] * (1.0 - kept)
        variance = np.empty_like(keep)
        variance[0] = ratio[:, None, None]
        for row in range(len(keep) - 1):
            before = variance[row]
            variance[row + 1] = fresh[row] + kept[row] * (before / (before + 1.0))
        self.plain = ratio == 0.0
        self.log_determinant = np.log(variance + 1.0).sum(axis=(0, 2, 3))
        self.keep, self.passed_on = keep, keep / (variance + 1.0)
        self.scale = 1.0 / np.sqrt(variance + 1.0)

    def white(self, columns, kinds):
        """columns (rows, n), rows of whole blocks -> the same under each of the kinds"""
        wandering = [kind for kind in kinds if not self.plain[kind]]
        values = columns.reshape(self.keep.shape[2], -1, columns.shape[1]).transpose(1, 0, 2)
        rows, blocks, n = values.shape
        white = np.empty((len(wandering), blocks, rows, n))
        if wandering:
            keep, passed_on, scale = (each[:, wandering]
                                      for each in (self.keep, self.passed_on, self.scale))
            out = white.transpose(2, 0, 1, 3)
            out[0] = values[0]
            np.multiply(values[:-1, None], -keep[:-1], out=out[1:])
            out[1:] += values[1:, None]
            add_before(out, passed_on)
            out *= scale
        found = iter(white.reshape(-1, *columns.shape))
        return [columns if self.plain[kind] else next(found) for kind in kinds]
