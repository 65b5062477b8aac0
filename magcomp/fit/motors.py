"""One vector a motor: how far the vectors differ, and whether a flight can tell them apart.

Least squares gives each motor a vector of its own, however little the motors ever differed in
what they draw. What a flight does not show is better taken as alike: the differences get a prior
around nothing whose width is the likeliest (docs/method.md, Motor by motor).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from magcomp.fit.field_model import SIZE
from magcomp.fit.robust import Estimate
from magcomp.model import MOTOR, FloatArray

_WIDTHS = np.concatenate([[0.0], np.geomspace(0.01, 100.0, 41)])
"""Widths tried for the differences, in units of their own median standard error."""

_SMALL = 1e-6
"""Of the differences' own variance: keeps the matrix from being singular at no width."""

_WHITE = 1.5
"""Mean square by which the mean of its neighbours misses a row of noise, of the noise's own."""

_LEAST_ROWS = 3

Found = TypeVar("Found", bound=Estimate)


def contrasts(parts: int) -> FloatArray:
    """Orthonormal ways in which so many motors can differ from each other, shape (k − 1, k).

    Examples
    --------
    >>> rows = contrasts(4)
    >>> bool(np.allclose(rows @ rows.T, np.eye(3)) and np.allclose(rows.sum(axis=1), 0.0))
    True
    """
    rows = np.zeros((parts - 1, parts))
    for row in range(parts - 1):
        rows[row, : row + 1] = 1.0
        rows[row, row + 1] = -(row + 1.0)
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def differences_of(size: int) -> FloatArray:
    """From all parameters to the differences between motors, shape (3 (k − 1), size)."""
    parts = 1 + (size - SIZE) // 3
    among = np.concatenate([np.arange(size)[MOTOR], np.arange(SIZE, size)])
    made = np.zeros((3 * (parts - 1), size))
    made[:, among] = np.kron(contrasts(parts), np.eye(3))
    return made


def blur(parts: FloatArray) -> float:
    """Share of the differences between motors that is lost between two rows, 0 … 1.

    Parameters
    ----------
    parts
        What each motor draws, at the times it is told, shape (n, k).

    Notes
    -----
    By how well a row is told by its neighbours: not at all where the outputs are told more seldom
    than the motors change. Then the differences come out too small by an unknown share.

    Examples
    --------
    >>> slow, fast = np.sin(np.arange(100.0) / 20), np.array([1.0, -1.0] * 50)
    >>> blur(np.column_stack([slow, -slow])) < 1e-4, blur(np.column_stack([fast, -fast]))
    (True, 1.0)
    """
    if len(parts) < _LEAST_ROWS:
        return 1.0
    apart = parts - parts.mean(axis=1, keepdims=True)
    told = apart[1:-1] - (apart[:-2] + apart[2:]) / 2.0
    whole = float(np.mean((apart - apart.mean(axis=0)) ** 2))
    return min(1.0, (float(np.mean(told**2)) / (_WHITE * whole)) ** 2) if whole > 0.0 else 1.0


def alike_where_unseen(found: Found, lost: float = 0.0) -> Found:
    """The estimate with a prior that motors disturb alike, as wide as makes it likeliest.

    Parameters
    ----------
    found
        Made without such a prior; its parameters end with the other motors' vectors.
    lost
        From :func:`blur`: the covariance is wider by this share of the differences.

    Notes
    -----
    The differences d = A·p are taken as 0 ± τ: a Kalman update of parameters and covariance. τ
    maximises the density of the d that was found, N(0, A·C·Aᵀ + τ²).
    """
    tell = differences_of(len(found.parameters))
    apart, doubt = tell @ found.parameters, tell @ found.covariance @ tell.T
    usual = float(np.sqrt(np.median(np.diag(doubt))))
    if not usual > 0.0:
        return found
    identity = np.eye(len(apart))

    def unlikely(width: float) -> float:
        whole = doubt + (width**2 + _SMALL * usual**2) * identity
        return float(apart @ np.linalg.solve(whole, apart) + np.linalg.slogdet(whole)[1])

    width = min(_WIDTHS * usual, key=unlikely)
    whole = doubt + (width**2 + _SMALL * usual**2) * identity
    gain = found.covariance @ tell.T @ np.linalg.inv(whole)
    return replace(
        found,
        parameters=found.parameters - gain @ apart,
        covariance=found.covariance
        - gain @ tell @ found.covariance
        + lost**2 * float(np.mean(apart**2)) * tell.T @ tell,
    )
