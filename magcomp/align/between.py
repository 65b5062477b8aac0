"""What a series most likely was between the moments it was told at.

A straight line from one telling to the next keeps all of their chance deviations in the readings
between, where the true series has others: a slope fitted against such a line comes out too small.
The mean to be expected, given how fast the series forgets, leaves an error that is independent of
it (docs/method.md, Motor by motor).
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from magcomp.model import FloatArray, Series

_FORGETS_S = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4, 12.8, 25.6)
_LAGS = 12
_NEIGHBOURS = 2
_LEAST_PAIRS = 10
_LEAST_ROWS = _LAGS + 2 * _NEIGHBOURS
_SMALL = 1e-6
_AT_A_TIME = 20_000


def expected(series: Series, at: FloatArray, *, lasting: bool = True) -> FloatArray:
    """The mean to be expected at other times, of columns that are told together.

    Parameters
    ----------
    series
        Columns of shape (n, k), at ascending times.
    at
        Seconds, shape (m,).
    lasting
        Whether what one step does not keep lasts at least for a while, or is gone at once. The
        series itself does not tell.

    Returns
    -------
    ndarray
        Shape (m, k); the columns' means far from all times at which they were told.

    Notes
    -----
    The columns are mixed into ways of varying that are independent of each other both at once and
    one step apart, the slow ones apart from the quick. Each has the autocovariance of two
    first-order Gauss–Markov processes, and where not ``lasting`` of one that forgets at once, of
    which no reading keeps anything, and is predicted from its two neighbours on either side.

    Examples
    --------
    >>> time = np.arange(100.0)
    >>> slow = Series(time, np.sin(time / 20.0)[:, None])
    >>> bool(abs(expected(slow, np.array([50.5]))[0, 0] - np.sin(50.5 / 20.0)) < 0.01)
    True
    """
    mean = series.value.mean(axis=0)
    if len(series) < _LEAST_ROWS:
        return np.broadcast_to(mean, (len(at), len(mean))).copy()
    scores, back = _ways(series.value - mean)
    found = [_predicted(series.time, way, at, lasting=lasting) for way in scores.T]
    return np.asarray(
        mean + np.stack(found, axis=1) @ back if found else np.tile(mean, (len(at), 1))
    )


def _ways(centred: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Independent ways of varying, (n, m), and how much of each the columns have, (m, k)."""
    at_once = centred.T @ centred / len(centred)
    later = centred[1:].T @ centred[:-1] / (len(centred) - 1)
    size, axes = np.linalg.eigh(at_once)
    there = size > _SMALL * max(float(size[-1]), np.finfo(np.float64).tiny)
    unit, root = axes[:, there], np.sqrt(size[there])
    white = unit / root
    turn = np.linalg.eigh(white.T @ (later + later.T) @ white)[1]
    return centred @ (white @ turn), (unit * root @ turn).T


def _predicted(time: FloatArray, way: FloatArray, at: FloatArray, *, lasting: bool) -> FloatArray:
    passing, forgets, shares = _memory(time, way, lasting=lasting)

    def covariance(apart: FloatArray) -> FloatArray:
        one, other = (s * np.exp(np.abs(apart) / -f) for s, f in zip(shares, forgets, strict=True))
        return np.asarray(one + other)

    alone = max(passing, _SMALL * float(np.mean(way**2))) * np.eye(2 * _NEIGHBOURS)

    def at_some(at: FloatArray) -> FloatArray:
        first = np.clip(np.searchsorted(time, at) - _NEIGHBOURS, 0, len(time) - 2 * _NEIGHBOURS)
        near = first[:, None] + np.arange(2 * _NEIGHBOURS)
        told = time[near]
        among = covariance(told[:, :, None] - told[:, None, :]) + alone
        weights = np.linalg.solve(among, covariance(told - at[:, None])[:, :, None])[:, :, 0]
        return np.asarray(np.einsum("ij,ij->i", weights, way[near]))

    # A matrix a reading: of a log of hours a part at a time.
    parts = np.split(at, range(_AT_A_TIME, len(at), _AT_A_TIME))
    return np.concatenate([at_some(part) for part in parts])


def _memory(
    time: FloatArray, way: FloatArray, *, lasting: bool
) -> tuple[float, FloatArray, FloatArray]:
    """What a way of varying forgets at once and what it keeps for a while.

    Returns
    -------
    float
        Variance of what is gone before a compass has taken its reading.
    ndarray, shape (2,)
        Time constants of two processes, seconds.
    ndarray, shape (2,)
        Their variances.
    """
    step = float(np.median(np.diff(time)))
    lags, products = [0.0], [float(np.mean(way**2))]
    for count in range(1, _LAGS + 1):
        apart = time[count:] - time[:-count]
        usual = np.abs(apart - count * step) < 0.5 * step
        if np.count_nonzero(usual) >= _LEAST_PAIRS:
            lags.append(float(np.mean(apart[usual])))
            products.append(float(np.mean((way[count:] * way[:-count])[usual])))
    # The nearest lags matter most: they are where most readings lie.
    weight = 1.0 / np.sqrt(1.0 + np.arange(len(lags)))
    wanted = np.array(products) * weight
    at_once = (np.array(lags) == 0.0) * weight
    best, found = np.inf, (products[0], np.ones(2), np.zeros(2))
    for pair in combinations(_FORGETS_S, 2):
        forgets = np.array(pair)
        kept = np.exp(-np.array(lags)[:, None] / forgets) * weight[:, None]
        columns = np.column_stack([at_once * (not lasting), kept])
        shares = np.maximum(np.linalg.lstsq(columns, wanted, rcond=None)[0], 0.0)
        left = float(np.sum((columns @ shares - wanted) ** 2))
        if left < best:
            best, found = left, (float(shares[0]), forgets, shares[1:])
    return found
