"""The tuned peer of diagnose_numpy.py: recursions over time in stretches, for evenly spaced rows.

A recursion is cut into as many stretches as each has rows. All stretches advance together, and what
one hands on to the next is added after: a low pass forgets by a factor, and play is a clipping, of
which two in a row are one. So 1440 rows take 76 steps of numpy, not 1440. Whitening is a product
with a matrix a stretch."""

import math

import numpy as np

AT_ONCE = 128  # columns that are made, whitened and multiplied together
FIRST_SEARCHES = ((True, False),)  # with and without errors of the coefficients, in one search
STRETCH_MAX = 16


def stretches(values):
    """(rows, n) -> (m, m, n), the last row repeated to fill"""
    m = math.isqrt(len(values) - 1) + 1
    out = np.empty((m * m, values.shape[1]))
    out[:len(values)] = values
    out[len(values):] = values[-1]
    return out.reshape(m, m, -1)


def low_pass(values, taus_s, steps_s):
    """values (rows, n), taus_s (n), 0 of which passes the values on, steps_s (rows - 1)"""
    rows, first = len(values), values[0]
    share = -np.expm1(-steps_s[0] / np.maximum(taus_s, 1e-300))
    keep = 1.0 - share
    out = stretches(values)
    out *= share
    for k in range(1, out.shape[1]):
        out[:, k] += keep * out[:, k - 1]
    fades = np.cumprod(np.broadcast_to(keep, (out.shape[1], len(share))), axis=0)
    state = first
    for stretch in out:
        stretch += fades * state
        state = stretch[-1]
    return out.reshape(-1, len(share))[:rows]


def play(values, widths):
    """values (rows, n), widths (n)"""
    rows, state = len(values), values[0]
    low = stretches(values)
    high = low + 0.5 * widths
    low -= 0.5 * widths
    for k in range(1, low.shape[1]):
        bottom, top = low[:, k].copy(), high[:, k].copy()
        for bound in (low, high):
            np.maximum(bound[:, k - 1], bottom, out=bound[:, k])
            np.minimum(bound[:, k], top, out=bound[:, k])
    for bottom, top in zip(low, high):
        np.maximum(state, bottom, out=bottom)
        np.minimum(bottom, top, out=bottom)
        state = bottom[-1]
    return low.reshape(-1, low.shape[2])[:rows]


class Noise:
    """The filter that whitens blocks, for several shapes (ratio, tau_s) of noise: `kind` is one's
    place. Its state is linear in the rows before: within a stretch of rows white values are a
    product with a matrix, and what a stretch hands on is one number a column."""

    def __init__(self, shapes, blocks, steps_s):
        ratio, tau_s = np.array(shapes).T
        block_rows = (len(steps_s) + 1) // blocks
        keep = np.exp(-steps_s[0] / tau_s)
        variance = [ratio]
        while len(variance) < block_rows:
            later = ratio + keep ** 2 * (variance[-1] / (variance[-1] + 1.0) - ratio)
            if np.all(np.abs(later - variance[-1]) <= 1e-15 * later):
                later = np.broadcast_to(later, (block_rows - len(variance), len(ratio)))
                variance.extend(later)
            else:
                variance.append(later)
        variance = np.array(variance)
        self.plain = ratio == 0.0
        self.log_determinant = blocks * np.log(variance + 1.0).sum(axis=0)
        size = max(n for n in range(1, STRETCH_MAX + 1) if block_rows % n == 0)
        form = lambda values: values.T.reshape(len(ratio), -1, size)
        gain, scale = form(variance / (variance + 1.0)), form(1.0 / np.sqrt(variance + 1.0))
        keep = keep[:, None, None]
        kept, added = keep * (1.0 - gain), keep * gain
        before = np.zeros((*gain.shape[:2], size + 1, size))  # what rows leave in the state
        fade = np.ones((*gain.shape[:2], size + 1))
        for row in range(size):
            before[:, :, row + 1] = kept[:, :, row, None] * before[:, :, row]
            before[:, :, row + 1, row] = added[:, :, row]
            fade[:, :, row + 1] = kept[:, :, row] * fade[:, :, row]
        self.within = scale[..., None] * (np.eye(size) - before[:, :, :-1])
        self.handed_on = before[:, :, -1:]
        self.fade = fade[:, :, -1]
        self.received = -(scale * fade[:, :, :-1])[..., None]

    def white(self, columns, kinds):
        """columns (rows, n), rows of whole blocks -> the same under each of the kinds"""
        return (self.white_under(columns, kind) for kind in kinds)

    def white_under(self, columns, kind):
        if self.plain[kind]:
            return columns
        within, fade = self.within[kind], self.fade[kind]
        stretches = columns.reshape(-1, *within.shape[:2], columns.shape[1])
        state = (self.handed_on[kind] @ stretches)[:, :, 0]
        for i in range(1, len(fade)):
            state[:, i] += fade[i] * state[:, i - 1]
        out = within @ stretches
        out[:, 1:] += self.received[kind][1:] * state[:, :-1, None]
        return out.reshape(columns.shape)
