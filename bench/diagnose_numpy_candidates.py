"""Hypotheses with a shape each, for diagnose_numpy.py: arrays, one place a hypothesis."""

import numpy as np

ARRAYS = ("subject", "shape", "power", "score", "setting", "gains", "acts", "left_out_gain",
          "log_left")


class Candidates:
    def __init__(self, chosen=()):
        """chosen: (cause, subject, shape, power, score, setting)"""
        chosen = list(chosen)
        cause, subject, shape, power, score, setting = zip(*chosen) if chosen else ((),) * 6
        n = len(chosen)
        arrays = (np.array(subject, dtype=int), np.array(shape, dtype=float),
                  np.array(power, dtype=float), np.array(score, dtype=float),
                  np.array(setting, dtype=int), np.zeros((n, 2)), np.zeros(n, dtype=bool),
                  np.zeros(n), np.zeros(n))
        self.assign(cause, dict(zip(ARRAYS, arrays)))

    def assign(self, cause, arrays):
        self.cause = list(cause)
        self.__dict__.update(arrays)
        self.width = np.array([each.width for each in self.cause], dtype=int)
        self.own = np.array([each.form == "own" for each in self.cause], dtype=bool)
        self.no_gain = np.array([each.form == "none" for each in self.cause], dtype=bool)
        self.refined = np.array([each.refined != "" for each in self.cause], dtype=bool)
        self.number = np.array([each.number for each in self.cause], dtype=int)

    def __len__(self):
        return len(self.cause)

    def key(self, i):
        return self.cause[i].name, self.cause[i].subjects[self.subject[i]]

    def take(self, which):
        out = Candidates.__new__(Candidates)
        which = np.asarray(which, dtype=int)
        out.assign([self.cause[i] for i in which],
                   {name: getattr(self, name)[which] for name in ARRAYS})
        return out

    def joined(self, other):
        out = Candidates.__new__(Candidates)
        out.assign(self.cause + other.cause,
                   {name: np.concatenate([getattr(self, name), getattr(other, name)])
                    for name in ARRAYS})
        return out

    def without(self, i):
        return self.take(np.delete(np.arange(len(self)), i))


def columns_of(c, which, shapes, powers=None):
    """Columns (rows, n, width) of the candidates `which`, of one width, with the shapes given.
    Those of one cause are made together."""
    powers = c.power[which] if powers is None else powers
    numbers, subjects = c.number[which], c.subject[which]
    different = np.unique(numbers)
    if len(different) == 1:
        return c.cause[which[0]].columns(subjects, shapes, powers)
    out = None
    for number in different:
        at = np.flatnonzero(numbers == number)
        made = c.cause[which[at[0]]].columns(subjects[at], shapes[at], powers[at])
        if out is None:
            out = np.empty((len(made), len(which), made.shape[2]))
        out[:, at] = made
    return out
