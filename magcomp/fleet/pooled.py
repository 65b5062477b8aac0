"""Motor vectors of several flights put together: a mean, their scatter, what changes with time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from magcomp.model.recording import BoolArray, FloatArray, IntArray

SURE = 1e-3
"""Chance of being wrong below which flights are said to differ."""


@dataclass(frozen=True, eq=False)
class Pooled:
    """The motor vector that several flights agree on.

    Attributes
    ----------
    motor
        mGauss per unit, shape (3,).
    covariance
        Of the mean, shape (3, 3).
    scatter
        Standard deviation from flight to flight beyond what each is uncertain by, mGauss per unit.
    count
        Flights.
    """

    motor: FloatArray
    covariance: FloatArray
    scatter: float
    count: int


@dataclass(frozen=True, eq=False)
class Change:
    """How the motor vector changed with time.

    Attributes
    ----------
    kind
        ``"step"`` or ``"drift"``.
    first
        Index of the first flight after a step; 0 for a drift.
    difference
        Last minus first motor vector, mGauss per unit, shape (3,).
    chance
        Of a change as large where there is none.
    """

    kind: str
    first: int
    difference: FloatArray
    chance: float


def pool(motors: FloatArray, covariances: FloatArray) -> Pooled:
    """Mean weighted by precision, with a scatter from flight to flight.

    Parameters
    ----------
    motors
        mGauss per unit, shape (k, 3).
    covariances
        Shape (k, 3, 3).

    Notes
    -----
    Each flight has m_i = m + b_i + e_i with e_i of its own covariance C_i and b_i of τ²·I. With
    W_i = C_i⁻¹ and Q the weighted squared distance from the mean, E[Q] = 3(k − 1) +
    τ²·(tr ΣW − tr((ΣW)⁻¹ ΣW²)), which gives τ², not below 0 (method of moments). The mean is then
    weighted by (C_i + τ²·I)⁻¹.
    """
    weights = _inverse(covariances)
    mean, inverse = _mean(motors, weights)
    apart = motors - mean
    q = float(np.einsum("ki,kij,kj->", apart, weights, apart))
    spare = np.trace(weights.sum(0)) - np.trace(inverse @ (weights @ weights).sum(0))
    between = max((q - 3 * (len(motors) - 1)) / spare, 0.0) if len(motors) > 1 else 0.0
    if between > 0.0:
        mean, inverse = _mean(motors, _inverse(covariances + between * np.eye(3)))
    return Pooled(mean, inverse, float(np.sqrt(between)), len(motors))


def _mean(motors: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    inverse = _inverse(weights.sum(0))
    return inverse @ np.einsum("kij,kj->i", weights, motors), inverse


def distances(motors: FloatArray, covariances: FloatArray, pooled: Pooled) -> FloatArray:
    """Squared distance of flights from a mean, in units of what each may be away, shape (k,).

    Parameters
    ----------
    motors, covariances
        As in :func:`pool`.
    pooled
        The mean, and the scatter from flight to flight.
    """
    weights = _inverse(covariances + pooled.scatter**2 * np.eye(3))
    apart = motors - pooled.motor
    return np.asarray(np.einsum("ki,ki->k", apart, _times(weights, apart)))


def is_definite(matrices: FloatArray) -> BoolArray:
    """Whether symmetric matrices, shape (k, 3, 3), are finite and positive definite, shape (k,).

    Notes
    -----
    Sylvester's criterion: the leading minors are positive. A NaN is not.
    """
    a, b, c, d, e, f = _entries(matrices)
    with np.errstate(over="ignore", invalid="ignore"):
        minor = a * b - d * d
        whole = c * minor + e * (d * f - b * e) - f * (a * f - d * e)
        return np.asarray((a > 0.0) & (minor > 0.0) & (whole > 0.0) & np.isfinite(whole))


def chances_apart(
    motors: FloatArray, covariances: FloatArray, which: IntArray
) -> tuple[FloatArray, FloatArray]:
    """How unlikely some flights are, each going by all the others.

    Parameters
    ----------
    motors, covariances
        As in :func:`pool`; at least three flights.
    which
        Indices of the flights asked for, shape (n,).

    Returns
    -------
    chance
        Of being as far from the others' mean, shape (n,).
    apart
        Difference from the others' mean, mGauss per unit, shape (n, 3).

    Notes
    -----
    For all of them at once: sums over the others are the whole sums less one term.
    """
    count = len(motors)
    weights = _inverse(covariances)
    sums = _Sums(weights, motors)
    others = _Sums(
        *(whole - each[which] for whole, each in zip(sums.whole, sums.terms, strict=True))
    )
    squares = weights @ weights
    inverse = _inverse(others.weight)
    spare = np.trace(others.weight, axis1=1, axis2=2) - np.trace(
        inverse @ (squares.sum(0) - squares[which]), axis1=1, axis2=2
    )
    excess = others.left(inverse) - 3 * (count - 2)
    between = np.maximum(np.divide(excess, spare, where=spare > 0, out=np.zeros(len(which))), 0.0)
    again = _inverse(covariances + between[:, None, None, None] * np.eye(3))
    again[np.arange(len(which)), which] = 0.0
    spread = _inverse(again.sum(1))
    weighted = np.einsum("nkij,kj->ni", again, motors)
    apart = motors[which] - _times(spread, weighted)
    spread = spread + covariances[which] + between[:, None, None] * np.eye(3)
    distance = np.einsum("ki,ki->k", apart, _times(_inverse(spread), apart))
    return np.asarray(special.chdtrc(3, distance)), apart


def change(times: FloatArray, motors: FloatArray, covariances: FloatArray) -> Change | None:
    """The step, or else the steady drift, that explains the flights best; None where neither.

    Parameters
    ----------
    times
        Unix seconds, never decreasing, shape (k,); a drift needs three different ones.
    motors, covariances
        As in :func:`pool`.

    Notes
    -----
    What a change explains is measured against what it leaves, so that mere scatter from flight to
    flight is no change: an F test, corrected for the number of places a step may stand at. A step
    leaves at least two flights on either side.
    """
    count = len(motors)
    if count < 3:
        return None
    # With the scatter from flight to flight in the weights, so that no flight counts for all.
    weights = _inverse(covariances + _scatter(motors, covariances) * np.eye(3))
    sums = _Sums(weights, motors)
    whole = float(_Sums(*sums.whole).left())
    found: list[tuple[float, Change]] = []
    span = times - times[0]
    if np.isfinite(span).all() and len(np.unique(span)) >= 3:
        left, slope = _line(span / span[-1], motors, weights)
        found.append((left, Change("drift", 0, slope, float(_chance(whole, left, count)))))
    if count >= 4:
        found.append(_best_step(sums, whole, count))
    sure = [(left, each) for left, each in found if each.chance < SURE]
    return min(sure, key=lambda pair: pair[0])[1] if sure else None


def _best_step(sums: _Sums, whole: float, count: int) -> tuple[float, Change]:
    before = _Sums(*(np.cumsum(each, axis=0)[1 : count - 2] for each in sums.terms))
    after = _Sums(*(a - b for a, b in zip(sums.whole, before.terms, strict=True)))
    left = before.left() + after.left()
    best = int(np.argmin(left))
    chance = float(_chance(whole, float(left[best]), count)) * len(left)
    difference = after.mean(best) - before.mean(best)
    return float(left[best]), Change("step", best + 2, difference, min(chance, 1.0))


def _scatter(motors: FloatArray, covariances: FloatArray) -> float:
    """Variance from flight to flight, from each flight to the next: blind to slow changes.

    The largest difference is left out where others remain: it may be a step.
    """
    squared = (np.diff(motors, axis=0) ** 2).sum(1)
    own = np.trace(covariances, axis1=1, axis2=2)
    excess = squared - own[1:] - own[:-1]
    if len(excess) > 3:
        excess = np.delete(excess, np.argmax(squared))
    return max(float(excess.mean()) / 6, 0.0)


def _inverse(matrices: FloatArray) -> FloatArray:
    """Of symmetric matrices, shape (..., 3, 3), by their cofactors: a tenth of LAPACK's time."""
    a, b, c, d, e, f = _entries(matrices)
    first, second, third = b * c - f * f, e * f - d * c, d * f - e * b
    determinant = a * first + d * second + e * third
    inverse = np.empty_like(matrices, dtype=np.float64)
    inverse[..., 0, 0], inverse[..., 1, 1], inverse[..., 2, 2] = first, a * c - e * e, a * b - d * d
    inverse[..., 0, 1] = inverse[..., 1, 0] = second
    inverse[..., 0, 2] = inverse[..., 2, 0] = third
    inverse[..., 1, 2] = inverse[..., 2, 1] = d * e - a * f
    return np.asarray(inverse / determinant[..., None, None])


def _entries(matrices: FloatArray) -> tuple[FloatArray, ...]:
    """xx, yy, zz, xy, xz and yz of symmetric matrices, shape (...) each."""
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return tuple(matrices[..., i, j] for i, j in places)


def _times(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    return np.asarray((matrices @ vectors[..., None])[..., 0])


class _Sums:
    """Sums of W, W·m and mᵀ·W·m over some flights; any number of such sums at once."""

    def __init__(
        self, weight: FloatArray, vector: FloatArray, square: FloatArray | None = None
    ) -> None:
        self.weight = weight
        if square is None:
            turned = _times(weight, vector)
            square = np.einsum("ki,ki->k", vector, turned)
            vector = turned
        self.vector, self.square = vector, square

    @property
    def terms(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        return self.weight, self.vector, self.square

    @property
    def whole(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        return self.weight.sum(0), self.vector.sum(0), self.square.sum(0)

    def mean(self, which: int) -> FloatArray:
        """Mean of the flights of one of the sums."""
        return np.asarray(np.linalg.solve(self.weight[which], self.vector[which]))

    def left(self, inverse: FloatArray | None = None) -> FloatArray:
        """Weighted squared distance of the flights from their mean."""
        turned = _inverse(self.weight) if inverse is None else inverse
        explained = np.einsum("...i,...i->...", self.vector, _times(turned, self.vector))
        return np.asarray(np.maximum(self.square - explained, 0.0))


def _line(share: FloatArray, motors: FloatArray, weights: FloatArray) -> tuple[float, FloatArray]:
    """Weighted squared distance from the best line in time, and its slope."""
    design = np.stack([np.ones(len(share)), share], axis=1)
    normal = np.einsum("ka,kij,kb->aibj", design, weights, design).reshape(6, 6)
    right = np.einsum("ka,kij,kj->ai", design, weights, motors).reshape(6)
    line = np.linalg.solve(normal, right).reshape(2, 3)
    apart = motors - design @ line
    return float(np.einsum("ki,kij,kj->", apart, weights, apart)), line[1]


def _chance(whole: float, left: float, count: int) -> float:
    """Of a change with two vectors in place of one explaining as much where there is none."""
    degrees = 3 * count - 6
    # Never judged by a residual smaller than the flights' own uncertainty makes likely.
    spread = max(left / degrees, 1.0)
    return float(special.fdtrc(3, degrees, max(whole - left, 0.0) / 3 / spread))
