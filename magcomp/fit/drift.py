"""What a sensor's drift makes of coefficients that were fitted without it.

A vehicle that stands still shows its compass nothing but the current and the drift, and a current
that goes up once and down once looks like a slow drift (docs/method.md, Sweeps).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from magcomp.fit.robust import spread_of
from magcomp.fit.wander import DRIFTS_MGAUSS, DRIFTS_S
from magcomp.model import FloatArray

PASSING_MGAUSS, PASSING_S = (0.3, 0.6, 1.2, 2.5, 5.0, 10.0), (0.3, 1.0, 3.0)
"""Errors of a current that steps, as large as these in the field and as long."""

_MOST_BINS = 80


def covariance_of_drift(time: FloatArray, left: FloatArray, design: FloatArray) -> FloatArray:
    """Covariance of least squares' coefficients through a drift that the residuals show.

    Parameters
    ----------
    time
        Of each reading, ascending, shape (n,).
    left
        What the fit leaves of each, mGauss, axes alike, shape (n, 3).
    design
        Columns that were fitted, shape (n, k).

    Returns
    -------
    ndarray, shape (k, k)
        For each axis alike; next to nothing where no drift makes the residuals likelier.

    Notes
    -----
    Drifts of each size and time count by their restricted likelihood, beside the white noise that
    neighbours show and the likeliest of what passes within seconds; all are first-order
    Gauss–Markov processes.

    Examples
    --------
    A sensor that drifts by 2 mGauss in a minute, while the current goes up once:

    >>> rng = np.random.default_rng(1)
    >>> time = np.arange(0.0, 60.0, 0.2)
    >>> noise = rng.normal(size=(300, 3))
    >>> design = np.column_stack([np.ones(300), time / 3.0])
    >>> bool(covariance_of_drift(time, noise, design)[1, 1] ** 0.5 < 0.03)
    True
    >>> slow = 2.0 * np.sin(time / 10.0)[:, None]
    >>> bool(0.03 < covariance_of_drift(time, noise + slow, design)[1, 1] ** 0.5 < 0.3)
    True
    """
    first = np.unique(np.linspace(0, len(time), _MOST_BINS, endpoint=False).astype(np.intp))
    count = np.diff(np.r_[first, len(time)])[:, None]
    binned, middle, columns = (
        np.add.reduceat(each, first, axis=0) / count
        for each in (left, time[:, None], np.asarray(design, dtype=np.float64))
    )
    white = np.diag(np.mean(spread_of(np.diff(left, axis=0) / np.sqrt(2.0)) ** 2) / count[:, 0])
    apart = np.abs(middle - middle.T)

    def likelihoods(tried: Sequence[FloatArray], beside: FloatArray) -> FloatArray:
        found = [_restricted(binned, columns, white + beside + each) for each in tried]
        return np.exp(np.array(found) - max(found))

    def likeliest(tried: Sequence[FloatArray], beside: FloatArray) -> FloatArray:
        return tried[int(np.argmax(likelihoods(tried, beside)))]

    passing, drifting = (
        [np.zeros_like(apart), *(s**2 * np.exp(-apart / t) for s in sizes for t in times)]
        for sizes, times in ((PASSING_MGAUSS, PASSING_S), (DRIFTS_MGAUSS, DRIFTS_S))
    )
    # What passes within seconds would else be taken for a drift of many times its size.
    passes = likeliest(passing, drifting[0])
    passes = likeliest(passing, likeliest(drifting, passes))
    drifts = np.average(drifting, axis=0, weights=likelihoods(drifting, passes))
    gain = np.linalg.lstsq(columns, np.eye(len(columns)), rcond=None)[0]
    return np.asarray(gain @ drifts @ gain.T)


def _restricted(left: FloatArray, columns: FloatArray, covariance: FloatArray) -> float:
    """Logarithm of how likely residuals are, what the columns may take up left out."""
    root = np.linalg.cholesky(covariance)
    alone, taken = np.linalg.solve(root, left), np.linalg.solve(root, columns)
    turned, upper = np.linalg.qr(taken)
    rest = alone - turned @ (turned.T @ alone)
    each = np.sum(np.log(np.diag(root))) + np.sum(np.log(np.abs(np.diag(upper))))
    return float(-0.5 * np.sum(rest**2) - left.shape[1] * each)
