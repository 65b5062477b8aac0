"""One vector a motor: how far the vectors differ, and whether a flight can tell them apart.

Least squares gives each motor a vector of its own, however little the motors ever differed in
what they draw. What a flight does not show is better taken as alike: the differences get a prior
around nothing, of a width that the flight tells (docs/method.md, Motor by motor).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from magcomp.fit.field_model import SIZE
from magcomp.fit.robust import Estimate
from magcomp.fit.wander import Rows, starts_of, weights_and_rest
from magcomp.model import MOTOR, FloatArray

_WIDTHS = np.concatenate([[0.0], np.geomspace(0.01, 100.0, 41)])
"""Widths tried for the differences, in units of their own median standard error."""

_SMALL = 1e-6
"""Of the differences' own variance: keeps the matrix from being singular at no width."""

_TINY = 1e-30

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


def shared_error(rows: Rows, tell: FloatArray) -> float:
    """How much less than readings of their own the readings of a second say of the differences.

    Parameters
    ----------
    rows
        Readings at the solution, with residuals of independent errors.
    tell
        From :func:`differences_of`.

    Returns
    -------
    float
        By what the variance of the differences is larger than of independent readings, 1 or more.

    Notes
    -----
    What a motor draws between two of its outputs is not told, and lasts longer than a reading: its
    neighbours err alike. So the square of the sum of their scores is compared with the sum of
    their squares. What lasts for longer than a second is a state of its own.
    """
    weights, left = weights_and_rest(rows.time, rows.values)
    scores = np.einsum("ngi,ng->ni", rows.slopes @ tell.T, weights * left)
    together = np.add.reduceat(scores, starts_of(rows.time), axis=0)
    apart = np.sum(scores**2, axis=0)
    return max(1.0, float(np.mean(np.sum(together**2, axis=0) / np.maximum(apart, _TINY))))


def told_together(found: Found, rows: Rows) -> Found:
    """The estimate with the differences less certain by what neighbouring readings err alike."""
    tell = differences_of(len(found.parameters))
    # Along the differences alone: the directions that all readings tell have their blocks of time.
    stretch = np.eye(len(found.parameters))
    stretch += (np.sqrt(shared_error(rows, tell)) - 1.0) * tell.T @ tell
    return replace(found, covariance=stretch @ found.covariance @ stretch.T)


def alike_where_unseen(found: Found, unsure: float = 0.0) -> Found:
    """The estimate with a prior that motors disturb alike, of every width that may be.

    Parameters
    ----------
    found
        Made without such a prior; its parameters end with the other motors' vectors.
    unsure
        As :class:`magcomp.model.Control` has it.

    Notes
    -----
    The differences d = A·p are taken as 0 ± τ: a Kalman update of parameters and covariance. Each τ
    counts by the density it gives the d that was found, N(0, A·C·Aᵀ + τ²), and the covariance
    holds how far the answers of one τ and another lie apart.
    """
    tell = differences_of(len(found.parameters))
    apart, doubt = tell @ found.parameters, tell @ found.covariance @ tell.T
    usual = float(np.sqrt(np.median(np.diag(doubt))))
    if not usual > 0.0:
        return found
    gain_of = found.covariance @ tell.T
    identity = np.eye(len(apart))
    density, moves, gains = [], [], []
    for width in _WIDTHS * usual:
        whole = doubt + (width**2 + _SMALL * usual**2) * identity
        gain = np.linalg.solve(whole, gain_of.T).T
        moves.append(gain @ apart)
        gains.append(gain @ gain_of.T)
        density.append(-0.5 * float(apart @ np.linalg.solve(whole, apart)))
        density[-1] -= 0.5 * float(np.linalg.slogdet(whole)[1])
    weights = np.exp(np.array(density) - max(density))
    weights /= weights.sum()
    move = weights @ np.array(moves)
    off = np.array(moves) - move
    return replace(
        found,
        parameters=found.parameters - move,
        covariance=found.covariance
        - np.tensordot(weights, np.array(gains), 1)
        + (off * weights[:, None]).T @ off
        + unsure**2 * float(np.mean(apart**2)) * tell.T @ tell,
    )
