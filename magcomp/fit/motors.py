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


def alike_where_unseen(found: Found) -> Found:
    """The estimate with a prior that motors disturb alike, as wide as makes it likeliest.

    Parameters
    ----------
    found
        Made without such a prior; its parameters end with the other motors' vectors.

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
        covariance=found.covariance - gain @ tell @ found.covariance,
    )
