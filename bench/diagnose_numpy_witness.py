"""What the readings themselves say of their faults, for diagnose_numpy.py: one matrix of all that a
reading is predicted from, whitened once a noise for all faults of a search."""

import functools

import numpy as np

SHAPES = [(ratio, tau_s) for ratio in (1.0, 30.0, 1000.0) for tau_s in (600.0, 3600.0, 20000.0)]
PRECISION, SUPPORT_MAX = 1e-6, 400.0


class Witness:
    def __init__(self, d):
        self.d, self.rows = d, len(d.time_s)

    @functools.cached_property
    def noise(self):
        return self.d.batching.Noise(SHAPES, 1, self.d.steps_s)

    @functools.cached_property
    def neighbours(self):
        """Whitened under each noise (kinds, rows, n), their products, and the columns' sizes"""
        d = self.d
        lag = lambda values, tau: d.batching.low_pass(values, np.full(values.shape[1], tau),
                                                      d.steps_s)
        every = np.hstack([np.ones((self.rows, 1)), d.temps, lag(d.temps, 1800.0),
                           lag(d.signals, 600.0), lag(d.signals, 3600.0)])
        size = np.abs(every).max(axis=0)
        size[size == 0] = 1.0
        every /= size
        white = np.stack([*self.noise.white(every, range(len(SHAPES)))])
        return white, white.transpose(0, 2, 1) @ white, size

    def says(self, sensors, errors):
        """2 ln L gained when errors (rows, n) are taken off the readings of the sensors (n)"""
        white, gram, size = self.neighbours
        kinds, total = len(SHAPES), gram.shape[1]
        white_errors = np.stack([*self.noise.white(errors, range(kinds))])
        cross = white.transpose(0, 2, 1) @ white_errors            # (kinds, total, n)
        squares = np.einsum("krn,krn->kn", white_errors, white_errors)
        says = np.empty(len(sensors))
        for k, sensor in enumerate(sensors):
            now = 1 + sensor
            keep = np.delete(np.arange(total), [now, now + self.d.temps.shape[1]])
            square = gram[:, keep[:, None], keep]
            square[:, range(len(keep)), range(len(keep))] += PRECISION
            right = np.stack([gram[:, keep, now] * size[now], cross[:, keep, k]], axis=2)
            factor = np.linalg.cholesky(square)
            shared = np.linalg.solve(factor, right)
            taken = shared.transpose(0, 2, 1) @ shared
            without = gram[:, now, now] * size[now] ** 2 - taken[:, 0, 0]
            both = cross[:, now, k] * size[now] - taken[:, 0, 1]
            left = without - 2.0 * both + squares[:, k] - taken[:, 1, 1]
            determinant = (self.noise.log_determinant - len(keep) * np.log(PRECISION) +
                           2 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1))
            best = [np.max(-self.rows * np.log(np.maximum(of, 1e-9 * self.rows) / self.rows) -
                           determinant) for of in (without, left)]
            says[k] = np.clip(best[1] - best[0], -SUPPORT_MAX, SUPPORT_MAX)
        return np.where(np.abs(errors).max(axis=0) > 0, says, -SUPPORT_MAX)
