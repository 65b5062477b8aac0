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
from magcomp.fit.widths import weights_of
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


def no_surer_than(plain: Estimate, found: Estimate) -> FloatArray:
    """What makes the differences of an estimate no better known than by plain least squares.

    Parameters
    ----------
    plain
        Least squares, whose covariance is made of blocks of time.
    found
        Of the same readings, with what wanders taken out: it knows the differences as well as its
        model is right.

    Returns
    -------
    ndarray
        Stretches the deviations of the parameters, shape (size, size).

    Notes
    -----
    A total current that is wrong while one motor works harder looks like a difference along the
    motors' common vector. No model of wandering has that; in the sums over blocks it is.
    """
    tell = differences_of(len(found.parameters))
    surer = float(np.trace(tell @ found.covariance @ tell.T))
    square = float(np.trace(tell @ plain.covariance @ tell.T))
    longer = np.sqrt(square / surer) if square > surer > 0.0 else 1.0
    return np.eye(len(found.parameters)) + (longer - 1.0) * tell.T @ tell


def alike_where_unseen(found: Found, stretch: FloatArray, unsure: float = 0.0) -> Found:
    """The estimate with a prior that motors disturb alike, of every width that may be.

    Parameters
    ----------
    found
        Made without such a prior; its parameters end with the other motors' vectors.
    stretch
        From :func:`no_surer_than`. It widens what comes out, not what differences are weighed by:
        those that one current's errors make are not smaller for being taken as alike.
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
    spreads = [doubt + (w**2 + _SMALL) * usual**2 * identity for w in _WIDTHS]
    pulls = [np.linalg.solve(each, gain_of.T).T for each in spreads]
    moves, gains = [pull @ apart for pull in pulls], [pull @ gain_of.T for pull in pulls]
    weights = weights_of(apart, spreads)
    move = weights @ np.array(moves)
    off = np.array(moves) - move
    covariance = found.covariance - np.tensordot(weights, np.array(gains), 1)
    covariance += (off * weights[:, None]).T @ off
    covariance = stretch @ covariance @ stretch.T
    covariance += unsure**2 * float(np.mean(apart**2)) * tell.T @ tell
    return replace(found, parameters=found.parameters - move, covariance=covariance)
