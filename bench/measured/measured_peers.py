"""Usual fits of displacement to temperatures, each with its penalty chosen on left-out blocks of
the training rows only."""

import warnings

import numpy as np

from measured_data import Table

LOW_PASSES_S = (0.0, 300.0, 900.0, 2700.0, 8100.0)
BLOCKS = 8
warnings.filterwarnings("ignore")


def blocks_of(parts):
    """Blocks to leave out: contiguous parts of each run, eight in total."""
    of_a_run = max(1, round(BLOCKS / len(parts)))
    blocks, start = [], 0
    for part in parts:
        edges = np.linspace(0, len(part), of_a_run + 1).astype(int) + start
        blocks += [np.arange(a, b) for a, b in zip(edges, edges[1:]) if b > a]
        start += len(part)
    return blocks


def chosen(parts, x, y, choices, fit_and_predict):
    sums = []
    for choice in choices:
        total = 0.0
        for block in blocks_of(parts):
            rest = np.setdiff1d(np.arange(len(y)), block)
            total += np.sum((y[block] - fit_and_predict(x[rest], y[rest], x[block], choice)) ** 2)
        sums.append(total)
    return choices[int(np.argmin(sums))]


def scaled(train, test):
    scale = train.std(axis=0)
    scale = np.where(scale > 1e-12, scale, np.inf)
    return train / scale, test / scale


def ridge_predict(x, y, at, penalty):
    x, at = scaled(x, at)
    gain = np.linalg.solve(x.T @ x + penalty * len(x) * np.eye(x.shape[1]), x.T @ y)
    return at @ gain


def lasso_predict(x, y, at, price):
    from sklearn.linear_model import Lasso
    x, at = scaled(x, at)
    size = y.std() + 1e-12
    model = Lasso(alpha=price, fit_intercept=False, max_iter=2000, tol=1e-3, precompute=True)
    return size * (at @ model.fit(x, y / size).coef_)


def boosting_predict(x, y, at, choice):
    from sklearn.ensemble import HistGradientBoostingRegressor
    depth, rounds = choice
    model = HistGradientBoostingRegressor(max_depth=depth, max_iter=rounds, learning_rate=0.1,
                                          early_stopping=False)
    return model.fit(x, y).predict(at)


PENALTIES = tuple(10.0 ** np.arange(-7, 2))
PRICES = (0.3, 0.1, 0.03, 0.01, 0.003)
BOOSTINGS = ((2, 60), (4, 100))


def each_output(split, low_passes_s, with_signals, choices, predict):
    train = Table(split.train, split.outputs, low_passes_s, with_signals)
    test = Table(split.test, split.outputs, low_passes_s, with_signals)
    x, ys = train.stacked()
    at, truth = test.stacked()
    left = []
    for i in range(len(split.outputs)):
        y = ys[:, i]
        ok = np.isfinite(y)
        best = chosen([part[np.isfinite(out[:, i])] for part, out in zip(train.x, train.y)],
                      x[ok], y[ok], choices, predict)
        left.append(truth[:, i] - predict(x[ok], y[ok], at, best))
    return left


def none(split):
    _, truth = Table(split.test, split.outputs).stacked()
    return list(truth.T)


def ridge(split):
    return each_output(split, (0.0,), False, PENALTIES, ridge_predict)


def ridge_gains_um_per_K(split):
    """The gains of `ridge`; temperatures in ascending order, shape (outputs, temperatures)."""
    train = Table(split.train, split.outputs)
    x, ys = train.stacked()
    gains = []
    for i in range(len(split.outputs)):
        ok = np.isfinite(ys[:, i])
        parts = [part[np.isfinite(out[:, i])] for part, out in zip(train.x, train.y)]
        best = chosen(parts, x[ok], ys[ok, i], PENALTIES, ridge_predict)
        gains.append(ridge_predict(x[ok], ys[ok, i], np.eye(x.shape[1]), best))
    return train.temperatures, np.array(gains)


def conformal_lags_um(split):
    """Half width per output of split-conformal 95 % intervals around `ridge_lags`: the quantile of
    the residuals on the left-out blocks of the training rows."""
    train = Table(split.train, split.outputs, LOW_PASSES_S, True)
    x, ys = train.stacked()
    widths = []
    for i in range(len(split.outputs)):
        y, ok = ys[:, i], np.isfinite(ys[:, i])
        parts = [part[np.isfinite(out[:, i])] for part, out in zip(train.x, train.y)]
        best = chosen(parts, x[ok], y[ok], PENALTIES, ridge_predict)
        left = []
        for block in blocks_of(parts):
            rest = np.setdiff1d(np.arange(ok.sum()), block)
            left.append(np.abs(y[ok][block] - ridge_predict(x[ok][rest], y[ok][rest],
                                                            x[ok][block], best)))
        widths.append(float(np.quantile(np.concatenate(left), 0.95)))
    return widths


def ridge_lags(split):
    return each_output(split, LOW_PASSES_S, True, PENALTIES, ridge_predict)


def lasso_lags(split):
    return each_output(split, LOW_PASSES_S, True, PRICES, lasso_predict)


def boosting(split):
    return each_output(split, LOW_PASSES_S, True, BOOSTINGS, boosting_predict)


def run_free(gain, x, start):
    """d[t] = a d[t-1] + B x(t) + C x(t-1) with its own d fed back; a inside the unit circle."""
    inputs = x.shape[1]
    drive = x[1:] @ gain[1:1 + inputs] + x[:-1] @ gain[1 + inputs:]
    a = np.clip(gain[0], -1.0, 1.0)
    out = np.empty(len(x))
    out[0] = start
    for i in range(1, len(x)):
        out[i] = np.clip(a * out[i - 1] + drive[i - 1], -1e5, 1e5)
    return out


def arx_gain(parts, outs, penalty):
    left = np.vstack([np.hstack([y[:-1, None], x[1:], x[:-1]]) for x, y in zip(parts, outs)])
    right = np.concatenate([y[1:] for y in outs])
    scale = np.where(left.std(axis=0) > 1e-12, left.std(axis=0), np.inf)
    left = left / scale
    square = left.T @ left + penalty * len(left) * np.eye(left.shape[1])
    return np.linalg.solve(square, left.T @ right) / scale


def arx(split):
    """Also runs through all rows before the evaluated ones, so that its state is right."""
    train = Table(split.train, split.outputs, (0.0,), True)
    whole = [run.selected(-np.inf, run.to_s) for run in split.test]
    test = Table(whole, split.outputs, (0.0,), True)
    judged = Table(split.test, split.outputs, (0.0,), True)
    left = []
    for i in range(len(split.outputs)):
        outs = [y[:, i] for y in train.y]
        sums = []
        for penalty in PENALTIES:
            total = 0.0
            for part, out in zip(train.x, outs):
                edges = np.linspace(0, len(out), BLOCKS // len(outs) + 1).astype(int)
                for a, b in zip(edges, edges[1:]):
                    rest = [(x, y) for x, y in zip(train.x, outs) if y is not out]
                    rest += [(part[:a], out[:a]), (part[b:], out[b:])]
                    rest = [(x, y) for x, y in rest if len(y) > 1]
                    gain = arx_gain([x for x, _ in rest], [y for _, y in rest], penalty)
                    total += np.sum((out[a:b] - run_free(gain, part[a:b], out[a])) ** 2)
            sums.append(total)
        gain = arx_gain(train.x, outs, PENALTIES[int(np.argmin(sums))])
        left.append(np.concatenate([(y[:, i] - run_free(gain, x, 0.0))[-len(rows):]
                                    for x, y, rows in zip(test.x, test.y, judged.y)]))
    return left


PEERS = {"none": none, "ridge": ridge, "ridge_lags": ridge_lags, "lasso_lags": lasso_lags,
         "boosting": boosting, "arx": arx}
