"""Which of a compass's flights agree, and which stand apart from the others."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from magcomp.fleet.pooled import SURE, Pooled, chances_apart, distances, pools
from magcomp.model.recording import FloatArray, IntArray

_T = TypeVar("_T")
_Result = TypeVar("_Result")

_MOST_SUSPECTS = 6
"""Flights looked at closely: which of the many that are somewhat far off is the furthest, tells
already their distance from the mean of all."""

_AT_ONCE = 1 << 12
"""Flights put together at once: what is worked with then stays near the processor, and takes no
more memory for a larger fleet."""

_OF_NONE = Pooled(np.full(3, np.nan), np.full((3, 3), np.nan), np.nan, 0)
_TILT = math.sin(math.radians(20.0))


def heading_shift(difference: FloatArray, leverage: FloatArray | float) -> FloatArray:
    """Heading shift in degrees, level or tilted by 20°, of a difference of motor vectors.

    Parameters
    ----------
    difference
        mGauss per unit, shape (..., 3).
    leverage
        Control quantity by horizontal field, units per mGauss, shape (...) or what fits it.

    Examples
    --------
    >>> heading_shift(np.array([[1.0, 0.0, 0.0], [0.0, 300.0, 0.0]]), 0.01).round(2).tolist()
    [0.57, 180.0]
    """
    level = np.hypot(difference[..., 0], difference[..., 1])
    sine = (level + _TILT * np.abs(difference[..., 2])) * leverage
    # A disturbance as strong as the field itself can point the heading anywhere.
    return np.where(sine < 1.0, np.degrees(np.arcsin(np.minimum(sine, 1.0))), 180.0)


def at_once(
    every: Sequence[_T], size: Callable[[_T], int], work: Callable[[list[_T]], Sequence[_Result]]
) -> list[_Result]:
    """What work says of each, asked for many of one size together, in the order of all.

    Examples
    --------
    >>> at_once(["a", "bc", "d"], len, lambda some: [len(some)] * len(some))
    [2, 1, 2]
    """
    groups: dict[int, list[int]] = {}
    for index, each in enumerate(every):
        groups.setdefault(size(each), []).append(index)
    found: dict[int, _Result] = {}
    for count, indices in groups.items():
        step = max(_AT_ONCE // max(count, 1), 1)
        for begin in range(0, len(indices), step):
            some = indices[begin : begin + step]
            found |= zip(some, work([every[index] for index in some]), strict=True)
    return [found[index] for index in range(len(every))]


@dataclass(frozen=True, eq=False)
class Agreement:
    """The flights of a compass that agree.

    Attributes
    ----------
    motors, covariances
        Of all flights that may be compared, as in :func:`magcomp.fleet.pooled.pool`.
    leverage
        As in :func:`heading_shift`.
    among
        Indices of those that agree.
    pooled
        Their mean, once :func:`put_together`.
    apart
        Indices of those left out, and by how many degrees of heading.
    """

    motors: FloatArray
    covariances: FloatArray
    leverage: float
    among: IntArray
    pooled: Pooled = _OF_NONE
    apart: tuple[tuple[int, float], ...] = ()


def put_together(every: Sequence[Agreement]) -> list[Agreement]:
    """The same with the means of the flights that agree."""

    def work(some: list[Agreement]) -> list[Agreement]:
        means = pools(*_stacked(some))
        return [replace(each, pooled=mean) for each, mean in zip(some, means, strict=True)]

    return at_once(every, _count, work)


def agreeing(every: Sequence[Agreement], departure_deg: float) -> list[Agreement]:
    """Leave out the flight that is furthest from the others until all agree.

    Of two that disagree nobody knows which is wrong, so both stay, with a scatter between them.
    Nor is more than a third left out: then the scatter is the truth.

    Parameters
    ----------
    every
        Compasses of which nothing is left out yet.
    departure_deg
        Heading that flights may differ by and still be called alike.
    """
    found = list(every)
    spare = [len(each.among) // 3 for each in found]
    going_on = list(range(len(found)))
    while going_on := [
        i for i in going_on if len(found[i].among) > 2 and len(found[i].apart) < spare[i]
    ]:
        worst = at_once(
            [found[i] for i in going_on], _count, lambda some: _worst(some, departure_deg)
        )
        left_out = [(i, each) for i, each in zip(going_on, worst, strict=True) if each is not None]
        going_on = [i for i, _ in left_out]
        shorter = put_together([_without(found[i], *each) for i, each in left_out])
        for i, each in zip(going_on, shorter, strict=True):
            found[i] = each
    return found


def _count(each: Agreement) -> int:
    return len(each.among)


def _stacked(some: Sequence[Agreement]) -> tuple[FloatArray, FloatArray]:
    return (
        np.stack([each.motors[each.among] for each in some]),
        np.stack([each.covariances[each.among] for each in some]),
    )


def _without(each: Agreement, place: int, degrees: float) -> Agreement:
    apart = (*each.apart, (int(each.among[place]), degrees))
    return replace(each, among=np.delete(each.among, place), apart=apart)


def _worst(some: Sequence[Agreement], departure_deg: float) -> list[tuple[int, float] | None]:
    """Place among the flights, and degrees, of the one that is surely furthest from the others."""
    motors, covariances = _stacked(some)
    leverage = np.array([each.leverage for each in some])[:, None]
    means = np.stack([each.pooled.motor for each in some])[:, None]
    # Of the others' mean a flight is as far as that, unless it drags the mean along.
    far = heading_shift(motors - means, leverage) > departure_deg / 2
    squared = np.where(far, distances(motors, covariances, [each.pooled for each in some]), -1.0)
    closest = np.argsort(squared, axis=1)[:, -_MOST_SUSPECTS:]
    # The heaviest drags the mean along, and then stands near it itself.
    heaviest = np.argmin(np.einsum("nkii->nk", covariances), axis=1)[:, None]
    near = np.take_along_axis(squared, closest, axis=1) < 0.0
    which = np.sort(np.hstack([np.where(near, heaviest, closest), heaviest]), axis=1)
    chance, by = chances_apart(motors, covariances, which)
    degrees = heading_shift(by, leverage)
    chance = np.where(degrees > departure_deg, chance * motors.shape[1], 1.0)
    worst = np.argmin(chance, axis=1)
    rows = np.arange(len(some))
    sure = far.any(axis=1) & (chance[rows, worst] < SURE)
    found = zip(sure, which[rows, worst], degrees[rows, worst], strict=True)
    return [(int(place), float(deg)) if is_sure else None for is_sure, place, deg in found]
