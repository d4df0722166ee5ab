"""The residual under every noise, for diagnose_numpy.py: whitening and normal equations."""

import numpy as np

BLOCKS = 8
WANDER_SHARES, WANDER_TAUS_S = (0.1, 0.3, 1.0), (1200.0, 3600.0, 10800.0)
ACCEPTED_SD_UM = 1e4  # of an offset too


def own_products(white):
    """(rows, n, width) -> (n, width, width)"""
    n, width = white.shape[1:]
    square = np.empty((n, width, width))
    for a in range(width):
        for b in range(a, width):
            square[:, a, b] = square[:, b, a] = np.einsum("rn,rn->n", white[:, :, a],
                                                          white[:, :, b])
    return square


class Side:
    """The settings in which the coefficients are doubted, or those in which they are right: one a
    kind of noise."""

    def __init__(self, e, doubted):
        coefficients = e.coefficients if doubted else 0
        self.coefficients = slice(1, 1 + coefficients)
        self.free = slice(1 + coefficients, None)
        pick = np.r_[0:1 + coefficients, 1 + e.coefficients:e.common.shape[1]]
        self.common = e.common[:, pick]
        self.white = e.white[:, :, np.r_[pick, -1]]  # residual last
        m, kinds = len(pick), len(e.white)
        gram = self.white.transpose(0, 2, 1) @ self.white
        self.precision = np.full((kinds, m), e.d.noise_um ** 2 / ACCEPTED_SD_UM ** 2)
        if doubted:
            self.precision[:, self.coefficients] = 1e12
            squares = self.solve(e, gram)[1]
            self.precision[:, self.coefficients] = (squares / e.rows)[:, None]
        (inverse, known), self.squares, self.log_determinant = self.solve(e, gram)
        # The common columns made independent, and what they leave of the residual: whitened columns
        # need be multiplied with these only.
        independent = self.white[:, :, :-1] @ inverse.transpose(0, 2, 1)
        rest = self.white[:, :, -1:] - independent @ known
        self.basis = np.concatenate([independent, rest], axis=2)

    def solve(self, e, gram):
        m = gram.shape[1] - 1
        square = gram[:, :-1, :-1].copy()
        square[:, range(m), range(m)] += self.precision
        factor = np.linalg.cholesky(square)
        inverse = np.linalg.inv(factor)
        known = inverse @ gram[:, :-1, -1:]
        squares = gram[:, -1, -1] - np.sum(known[:, :, 0] ** 2, axis=1)
        log_determinant = (e.noise.log_determinant -
                           np.log(self.precision).sum(axis=1) +
                           2 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1))
        return (inverse, known), squares, log_determinant


class Evidence:
    """The residual with what was accepted. A setting is a kind of noise on one of the sides; its
    number is side x kinds + kind."""

    def __init__(self, d, accepted, doubts):
        """accepted: (columns (rows, width), gains or None where free); doubts: one a side"""
        self.d, self.rows = d, len(d.time_s)
        self.residual = d.residual.copy()
        free = []
        for columns, gains in accepted:
            if gains is None:
                free.append(columns / max(1e-12, np.abs(columns).max()))
            else:
                self.residual -= columns @ gains
        doubted = d.coefficient_columns if any(doubts) else np.empty((self.rows, 0))
        self.coefficients = doubted.shape[1]
        self.common = np.hstack([np.ones((self.rows, 1)), doubted, *free])
        size = self.residual.std()
        shapes = [(0.0, 1.0)] + [((share * size / d.noise_um) ** 2, tau_s)
                                 for share in WANDER_SHARES for tau_s in WANDER_TAUS_S]
        self.noise = d.batching.Noise(shapes, BLOCKS, d.steps_s)
        self.kinds = len(shapes)
        both = np.hstack([self.common, self.residual[:, None]])
        self.white = np.stack([*self.noise.white(both, range(self.kinds))])
        self.sides = [Side(self, doubted) for doubted in doubts]
        self.squares = np.concatenate([side.squares for side in self.sides])
        self.log_determinant = np.concatenate([side.log_determinant for side in self.sides])
        self.basis = [basis for side in self.sides for basis in side.basis]
        every = np.arange(len(self.squares))
        self.without = self.likelihood(every, self.squares)
        by_side = self.without.reshape(-1, self.kinds)
        self.likeliest = self.kinds * np.arange(len(doubts)) + np.argmax(by_side, axis=1)

    def likelihood(self, setting, squares):
        squares = np.maximum(squares, 1e-9 * self.rows)
        return -self.rows * np.log(squares / self.rows) - self.log_determinant[setting]

    def equations_under(self, columns, settings):
        """columns (rows, n, width) -> (square (n, width, width), right (n, width)) of each of the
        settings; whitened once a kind of noise"""
        rows, n, width = columns.shape
        flat, found = columns.reshape(rows, -1), {}
        kinds = sorted({setting % self.kinds for setting in settings})
        for kind, white in zip(kinds, self.noise.white(flat, kinds)):
            alike = [setting for setting in settings if setting % self.kinds == kind]
            own = own_products(white.reshape(columns.shape))
            bases = np.hstack([self.basis[s] for s in alike]) if alike[1:] else self.basis[alike[0]]
            cross, first = bases.T @ white, 0
            for setting in alike:
                last = first + self.basis[setting].shape[1] - 1
                shared = cross[first:last].reshape(-1, n, width)
                square = own - np.einsum("mna,mnb->nab", shared, shared) if width > 1 else (
                    own - np.einsum("mn,mn->n", shared[:, :, 0], shared[:, :, 0])[:, None, None])
                found[setting] = square, cross[last].reshape(n, width)
                first = last + 1
        return [found[setting] for setting in settings]

    def equations(self, columns, setting):
        """The same, each of the n under its own setting"""
        different = np.unique(setting)
        if len(different) == 1:
            return self.equations_under(columns, list(different))[0]
        n, width = columns.shape[1:]
        square, right = np.empty((n, width, width)), np.empty((n, width))
        for one in different:
            at = np.flatnonzero(setting == one)
            square[at], right[at] = self.equations_under(columns[:, at], [one])[0]
        return square, right


def solved(square, right):
    """Gains (..., width)"""
    if square.shape[-1] == 1:
        return right / np.maximum(square[..., 0], 1e-300)
    return np.linalg.solve(square, right[..., None])[..., 0]


def left_of(squares, gains, square, right):
    if square.shape[-1] == 1:
        return squares + gains[..., 0] * (square[..., 0, 0] * gains[..., 0] - 2.0 * right[..., 0])
    return (squares - 2.0 * np.sum(gains * right, axis=-1) +
            np.einsum("...i,...ij,...j->...", gains, square, gains))
