"""Motor vectors of several flights put together: a mean, their scatter, what changes with time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from magcomp.fleet import matrices
from magcomp.model.recording import FloatArray, IntArray

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
    return pools(motors[None], covariances[None])[0]


def pools(motors: FloatArray, covariances: FloatArray) -> list[Pooled]:
    """:func:`pool` for many compasses with as many flights each: all at once is far quicker.

    Parameters
    ----------
    motors
        Shape (n, k, 3).
    covariances
        Shape (n, k, 3, 3).
    """
    count = motors.shape[1]
    weights = matrices.inverse(covariances)
    mean, inverse = _mean(motors, weights)
    apart = motors - mean[:, None]
    q = np.einsum("nki,nki->n", apart, matrices.times(weights, apart))
    spare = np.einsum("nkii->n", weights) - np.einsum(
        "nij,nkjl,nkli->n", inverse, weights, weights, optimize=True
    )
    between = np.zeros(len(motors))
    if count > 1:
        between = np.maximum((q - 3 * (count - 1)) / spare, 0.0)
        scattered = np.flatnonzero(between > 0.0)
        wide = covariances[scattered] + between[scattered, None, None, None] * np.eye(3)
        mean[scattered], inverse[scattered] = _mean(motors[scattered], matrices.inverse(wide))
    scatter = np.sqrt(between).tolist()
    return [Pooled(*each, count) for each in zip(mean, inverse, scatter, strict=True)]


def _mean(motors: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    inverse = matrices.inverse(weights.sum(1))
    return matrices.times(inverse, matrices.times(weights, motors).sum(1)), inverse


def distances(motors: FloatArray, covariances: FloatArray, means: Sequence[Pooled]) -> FloatArray:
    """Squared distance of flights from a mean, in units of what each may be away, shape (n, k).

    Parameters
    ----------
    motors, covariances
        As in :func:`pools`.
    means
        Of each compass, with the scatter from flight to flight.
    """
    scatter = np.array([each.scatter for each in means])[:, None, None, None]
    weights = matrices.inverse(covariances + scatter**2 * np.eye(3))
    apart = motors - np.stack([each.motor for each in means])[:, None]
    return np.asarray(np.einsum("nki,nki->nk", apart, matrices.times(weights, apart)))


def chances_apart(
    motors: FloatArray, covariances: FloatArray, which: IntArray
) -> tuple[FloatArray, FloatArray]:
    """How unlikely some flights are, each going by all the others of its compass.

    Parameters
    ----------
    motors, covariances
        As in :func:`pools`; at least three flights a compass.
    which
        Indices of the flights asked for, shape (n, m).

    Returns
    -------
    chance
        Of being as far from the others' mean, shape (n, m).
    apart
        Difference from the others' mean, mGauss per unit, shape (n, m, 3).

    Notes
    -----
    For all of them at once: sums over the others are the whole sums less one term.
    """
    count = motors.shape[1]
    weights = matrices.inverse(covariances)
    sums = _Sums(weights, motors)
    others = _Sums(
        *(
            whole[:, None] - _chosen(each, which)
            for whole, each in zip(sums.whole, sums.terms, strict=True)
        )
    )
    squares = weights @ weights
    inverse = matrices.inverse(others.weight)
    spare = np.einsum("nmii->nm", others.weight) - np.einsum(
        "nmij,nmji->nm", inverse, squares.sum(1)[:, None] - _chosen(squares, which)
    )
    excess = others.left(inverse) - 3 * (count - 2)
    between = np.maximum(np.divide(excess, spare, where=spare > 0, out=np.zeros(which.shape)), 0.0)
    weight, vector = _sums_of_the_others(motors, covariances, which, between)
    spread = matrices.inverse(weight)
    apart = _chosen(motors, which) - matrices.times(spread, vector)
    wide = spread + _chosen(covariances, which) + between[..., None, None] * np.eye(3)
    distance = np.einsum("nmi,nmi->nm", apart, matrices.times(matrices.inverse(wide), apart))
    return np.asarray(special.chdtrc(3, distance)), apart


def _chosen(each: FloatArray, which: IntArray) -> FloatArray:
    """Of what each flight has, shape (n, k, …), what some have, shape (n, m, …)."""
    return np.asarray(each[np.arange(len(which))[:, None], which])


def _sums_of_the_others(
    motors: FloatArray, covariances: FloatArray, which: IntArray, between: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Sums of W and W·m over the flights but one, with a scatter that is that one's own.

    Nine in ten of what a fleet's flights are compared for, so without a matrix a flight.
    """
    xx, yy, zz, xy, xz, yz = (each[:, None] for each in matrices.entries(covariances))
    xx, yy, zz = (each + between[..., None] for each in (xx, yy, zz))
    cofactors, determinant = matrices.cofactors(xx, yy, zz, xy, xz, yz)
    share = 1.0 / determinant
    np.put_along_axis(share, which[..., None], 0.0, axis=2)
    parts = [each * share for each in cofactors]
    weight = matrices.symmetric([each.sum(2) for each in parts])
    vector = np.empty(weight.shape[:-1])
    for row, places in enumerate(matrices.ROWS):
        vector[..., row] = sum(
            np.einsum("nmk,nk->nm", parts[place], motors[..., axis])
            for axis, place in enumerate(places)
        )
    return weight, vector


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
    return changes(times[None], motors[None], covariances[None])[0]


def changes(times: FloatArray, motors: FloatArray, covariances: FloatArray) -> list[Change | None]:
    """:func:`change` for many compasses with as many flights each: all at once is far quicker.

    Parameters
    ----------
    times
        Shape (n, k).
    motors, covariances
        As in :func:`pools`.
    """
    number, count = times.shape
    if count < 3:
        return [None] * number
    # With the scatter from flight to flight in the weights, so that no flight counts for all.
    scatter = _scatter(motors, covariances)
    weights = matrices.inverse(covariances + scatter[:, None, None, None] * np.eye(3))
    sums = _Sums(weights, motors)
    whole = _Sums(*sums.whole).left()
    found: list[list[tuple[float, Change]]] = [[] for _ in range(number)]
    for n, left, slope in _lines(times, motors, weights):
        chance = float(_chance(whole[n], left, count))
        found[n].append((left, Change("drift", 0, slope, chance)))
    if count >= 4:
        for n, step in enumerate(_best_steps(sums, whole, count)):
            found[n].append(step)
    sure = [[(left, each) for left, each in of if each.chance < SURE] for of in found]
    return [min(of, key=lambda pair: pair[0])[1] if of else None for of in sure]


def _best_steps(sums: _Sums, whole: FloatArray, count: int) -> Iterator[tuple[float, Change]]:
    before = _Sums(*(np.cumsum(each, axis=1)[:, 1 : count - 2] for each in sums.terms))
    pairs = zip(sums.whole, before.terms, strict=True)
    after = _Sums(*(a[:, None] - b for a, b in pairs))
    left = before.left() + after.left()
    best = np.argmin(left, axis=1)
    rows = np.arange(len(best))
    differences = after.mean(rows, best) - before.mean(rows, best)
    least = left[rows, best]
    chances = np.minimum(_chance(whole, least, count) * left.shape[1], 1.0)
    for n, (place, chance) in enumerate(zip(best.tolist(), chances.tolist(), strict=True)):
        yield float(least[n]), Change("step", place + 2, differences[n], chance)


def _scatter(motors: FloatArray, covariances: FloatArray) -> FloatArray:
    """Variance from flight to flight, from each flight to the next: blind to slow changes.

    The largest difference is left out where others remain: it may be a step.
    """
    squared = (np.diff(motors, axis=1) ** 2).sum(2)
    own = np.trace(covariances, axis1=2, axis2=3)
    excess = squared - own[:, 1:] - own[:, :-1]
    total, of = excess.sum(1), excess.shape[1]
    if of > 3:
        total -= excess[np.arange(len(excess)), np.argmax(squared, axis=1)]
        of -= 1
    return np.asarray(np.maximum(total / of, 0.0) / 6)


class _Sums:
    """Sums of W, W·m and mᵀ·W·m over some flights; any number of such sums at once.

    The flights, or the sums, are the last axis of ``square``, shape (..., k).
    """

    def __init__(
        self, weight: FloatArray, vector: FloatArray, square: FloatArray | None = None
    ) -> None:
        self.weight = weight
        if square is None:
            turned = matrices.times(weight, vector)
            square = np.einsum("...i,...i->...", vector, turned)
            vector = turned
        self.vector, self.square = vector, square

    @property
    def terms(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        return self.weight, self.vector, self.square

    @property
    def whole(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        return self.weight.sum(-3), self.vector.sum(-2), self.square.sum(-1)

    def mean(self, rows: IntArray, which: IntArray) -> FloatArray:
        """Means of the flights of some of the sums, shape (n, 3)."""
        solved = np.linalg.solve(self.weight[rows, which], self.vector[rows, which][..., None])
        return np.asarray(solved[..., 0])

    def left(self, inverse: FloatArray | None = None) -> FloatArray:
        """Weighted squared distance of the flights from their mean."""
        turned = matrices.inverse(self.weight) if inverse is None else inverse
        explained = np.einsum("...i,...i->...", self.vector, matrices.times(turned, self.vector))
        return np.asarray(np.maximum(self.square - explained, 0.0))


def _lines(
    times: FloatArray, motors: FloatArray, weights: FloatArray
) -> Iterator[tuple[int, float, FloatArray]]:
    """The best line in time of each compass with three different times.

    Its weighted squared distance, and its slope.
    """
    span = times - times[:, :1]
    able = np.isfinite(span).all(1) & (np.count_nonzero(np.diff(span, axis=1), axis=1) >= 2)
    which = np.flatnonzero(able)
    if not len(which):
        return
    motors, weights, share = motors[which], weights[which], span[which] / span[which, -1:]
    design = np.stack([np.ones_like(share), share], axis=2)
    powers = design[:, :, :, None] * design[:, :, None, :]
    normal = np.einsum("nkab,nkij->naibj", powers, weights).reshape(-1, 6, 6)
    right = np.einsum("nka,nki->nai", design, matrices.times(weights, motors)).reshape(-1, 6, 1)
    line = np.linalg.solve(normal, right).reshape(-1, 2, 3)
    apart = motors - design @ line
    left = np.einsum("nki,nki->n", apart, matrices.times(weights, apart))
    for n, least, (_, slope) in zip(which.tolist(), left.tolist(), line, strict=True):
        yield n, least, slope


def _chance(whole: FloatArray, left: FloatArray | float, count: int) -> FloatArray:
    """Of a change with two vectors in place of one explaining as much where there is none."""
    degrees = 3 * count - 6
    # Never judged by a residual smaller than the flights' own uncertainty makes likely.
    spread = np.maximum(np.asarray(left) / degrees, 1.0)
    gained = np.maximum(whole - left, 0.0)
    return np.asarray(special.fdtrc(3, degrees, gained / 3 / spread))
