"""One compass over all its flights: what they say together, and whether it still holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from magcomp.fleet.findings import (
    Attention,
    Finding,
    Holds,
    changed_since,
    holds_in,
    of_newest,
    scattering,
    why,
)
from magcomp.fleet.flights import Flight
from magcomp.fleet.pooled import (
    SURE,
    Change,
    Pooled,
    chances_apart,
    changes,
    distances,
    is_definite,
    pool,
    pools,
)
from magcomp.geometry import horizontal_part
from magcomp.judge.thresholds import Thresholds
from magcomp.model import Grade
from magcomp.model.recording import FloatArray, IntArray

_T = TypeVar("_T")

_COVARIANCE = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
_MOTOR = slice(0, 3)
_MOST_SUSPECTS = 6
"""Flights looked at closely: which of the many that are somewhat far off is the furthest, tells
already their distance from the mean of all."""

_TILT = math.sin(math.radians(20.0))


@dataclass(frozen=True, eq=False)
class CompassHistory:
    """One compass of one aircraft over all its flights.

    Attributes
    ----------
    compass, device_id
        Slot, and the id of what stands in it; 0 where unknown.
    flights
        In order of time.
    regressor
        Control quantity of the flights that are compared.
    pooled
        What the flights that agree say together; None where there are none.
    agreeing
        Their indices in ``flights``.
    apart
        Index of a flight that disagrees to what is known of why.
    drift_deg
        Heading shift, at the largest control quantity, of what changed with time; 0 where nothing
        did.
    holds
        Whether the calibration in force still holds.
    scatter_deg
        Heading shift of the scatter from flight to flight at the largest control quantity.
    agree
        Whether several flights agree well enough for their mean to stand for all.
    """

    compass: int
    device_id: int
    flights: tuple[Flight, ...]
    regressor: str
    pooled: Pooled | None
    agreeing: tuple[int, ...]
    apart: tuple[tuple[int, str], ...]
    drift_deg: float
    holds: Holds
    findings: tuple[Finding, ...]
    scatter_deg: float = 0.0
    agree: bool = False


Slot = tuple[int, int, Sequence[Flight]]
"""A compass's slot, the id of what stands in it, and its flights in order of time, at least one."""


@dataclass(frozen=True, eq=False)
class _Compared:
    """A compass whose flights can be compared."""

    slot: int
    device_id: int
    flights: Sequence[Flight]
    usable: Sequence[int]
    motors: FloatArray
    covariances: FloatArray
    at: float
    """Largest control quantity of its flights."""

    @property
    def shift(self) -> Callable[[FloatArray], FloatArray]:
        """Heading shift there, degrees, of a difference of motor vectors."""
        return _shift(self.flights[-1], self.at)


def history(
    slot: int, device_id: int, flights: Sequence[Flight], limits: Thresholds
) -> CompassHistory:
    """One compass over time.

    Parameters
    ----------
    slot, device_id
        Of the compass.
    flights
        Its flights in order of time, at least one.
    limits
        Of the judge.
    """
    return histories([(slot, device_id, flights)], limits)[0]


def histories(every: Sequence[Slot], limits: Thresholds) -> list[CompassHistory]:
    """:func:`history` for many compasses: those with as many flights each are pooled at once."""
    compared = [_compared(*each) for each in every]
    known = [each for each in compared if each is not None]
    pooled = _at_once(known, lambda some: pools(_motors_of(some), _covariances_of(some)))
    apart = [
        float(each.shift(each.motors - mean.motor).max()) > limits.departure_deg / 2
        for each, mean in zip(known, pooled, strict=True)
    ]
    far = [each for each, is_far in zip(known, apart, strict=True) if is_far]
    changed = iter(
        _at_once(
            far,
            lambda some: changes(_times(some), _motors_of(some), _covariances_of(some)),
        )
    )
    told = iter(
        _told(each, mean, next(changed) if is_far else None, limits, is_far=is_far)
        for each, mean, is_far in zip(known, pooled, apart, strict=True)
    )
    return [
        _untold(*whole, limits) if each is None else next(told)
        for whole, each in zip(every, compared, strict=True)
    ]


def _at_once(
    every: Sequence[_Compared], work: Callable[[Sequence[_Compared]], Sequence[_T]]
) -> list[_T]:
    """What work says of each, asked once for all with as many flights."""
    groups: dict[int, list[int]] = {}
    for index, each in enumerate(every):
        groups.setdefault(len(each.usable), []).append(index)
    found: dict[int, _T] = {}
    for indices in groups.values():
        found |= zip(indices, work([every[index] for index in indices]), strict=True)
    return [found[index] for index in range(len(every))]


def _motors_of(some: Sequence[_Compared]) -> FloatArray:
    return np.stack([each.motors for each in some])


def _covariances_of(some: Sequence[_Compared]) -> FloatArray:
    return np.stack([each.covariances for each in some])


def _times(some: Sequence[_Compared]) -> FloatArray:
    return np.array([[each.flights[i].when for i in each.usable] for each in some])


def _compared(slot: int, device_id: int, flights: Sequence[Flight]) -> _Compared | None:
    """The flights whose fit is believed, and made against what the newest was made against."""
    regressor = flights[-1].regressor
    asked = [
        i
        for i, each in enumerate(flights)
        if each.verdict != Grade.REJECTED and each.regressor == regressor
    ]
    motors, covariances = _motors(flights, asked), _covariances(flights, asked)
    sound = np.isfinite(motors).all(1) & is_definite(covariances)
    if not sound.any():
        return None
    usable = [i for i, good in zip(asked, sound.tolist(), strict=True) if good]
    at = max([flights[i].u_high for i in usable])
    return _Compared(slot, device_id, flights, usable, motors[sound], covariances[sound], at)


def _untold(
    slot: int, device_id: int, flights: Sequence[Flight], limits: Thresholds
) -> CompassHistory:
    """A compass of which no flight can be compared."""
    newest = flights[-1]
    holds = holds_in(newest, limits)
    findings = tuple(of_newest(slot, newest, holds, limits))
    regressor = newest.regressor
    return CompassHistory(
        slot, device_id, tuple(flights), regressor, None, (), (), 0.0, holds, findings
    )


def _told(
    of: _Compared, pooled: Pooled, changed: Change | None, limits: Thresholds, *, is_far: bool
) -> CompassHistory:
    flights, usable, slot = of.flights, of.usable, of.slot
    newest = flights[-1]
    holds = holds_in(newest, limits)
    findings = list(of_newest(slot, newest, holds, limits))
    at, shift = of.at, of.shift
    agreeing: IntArray = np.arange(len(usable))
    drift = 0.0
    apart: list[tuple[int, float]] = []
    if is_far:
        if changed is not None and float(shift(changed.difference)) > limits.departure_deg:
            drift = float(shift(changed.difference))
            agreeing = agreeing[changed.first :]
            when = flights[usable[changed.first]].when
            findings.append(changed_since(slot, changed.kind, when, drift, at, newest.regressor))
        away = _Away(of.motors, of.covariances, shift, limits.departure_deg, pooled)
        agreeing, apart = _agree(agreeing, away)
        if len(agreeing) < len(usable):
            pooled = pool(of.motors[agreeing], of.covariances[agreeing])
    scatter_deg = float(shift(np.full(3, pooled.scatter)))
    agree = len(agreeing) > 1 and scatter_deg <= limits.departure_deg
    if scatter_deg > limits.departure_deg:
        findings.append(scattering(slot, len(agreeing), scatter_deg, at, newest.regressor))
    named = tuple(
        (usable[k], why(flights[usable[k]], [flights[usable[j]] for j in agreeing], float(deg)))
        for k, deg in apart
    )
    if named:
        count = len(agreeing) + len(named)
        listed = "; ".join(f"{flights[i].path} ({text})" for i, text in named[:3])
        more = f"; and {len(named) - 3} more" if len(named) > 3 else ""
        findings.append(
            Finding(
                Attention.LOOK,
                f"compass {slot}: {len(named)} of {count} flights disagree with the others: "
                f"{listed}{more}",
            )
        )
    return CompassHistory(
        slot,
        of.device_id,
        tuple(flights),
        newest.regressor,
        pooled,
        tuple(usable[k] for k in agreeing),
        named,
        drift,
        holds,
        tuple(findings),
        scatter_deg,
        agree,
    )


def _motors(flights: Sequence[Flight], which: Sequence[int]) -> FloatArray:
    return np.array([flights[i].correction for i in which]).reshape(-1, 12)[:, _MOTOR]


def _covariances(flights: Sequence[Flight], which: Sequence[int]) -> FloatArray:
    listed = np.array([flights[i].motor_covariance for i in which]).reshape(-1, 6)
    return np.asarray(listed[:, _COVARIANCE])


@dataclass(frozen=True, eq=False)
class _Away:
    """Flights, and how to tell which are away from the others."""

    motors: FloatArray
    covariances: FloatArray
    shift: Callable[[FloatArray], FloatArray]
    departure_deg: float
    all_together: Pooled

    def suspects(self, among: IntArray) -> IntArray:
        """Places in ``among`` of what may be far from the others: far from the mean, or heavy."""
        whole = len(among) == len(self.motors)
        covariances = self.covariances[among]
        pooled = self.all_together if whole else pool(self.motors[among], covariances)
        # Of the others' mean a flight is as far as that, unless it drags the mean along.
        far = self.shift(self.motors[among] - pooled.motor) > self.departure_deg / 2
        suspects = np.flatnonzero(far)
        if not len(suspects):
            return suspects
        squared = distances(self.motors[among][suspects], covariances[suspects], pooled)
        closest = suspects[np.argsort(squared)[-_MOST_SUSPECTS:]]
        # The heaviest drags the mean along, and then stands near it itself.
        return np.union1d(closest, np.argmin(np.trace(covariances, axis1=1, axis2=2)))


def _agree(among: IntArray, away: _Away) -> tuple[IntArray, list[tuple[int, float]]]:
    """Leave out the flight that is furthest from the others until all agree.

    Of two that disagree nobody knows which is wrong, so both stay, with a scatter between them.
    Nor is more than a third left out: then the scatter is the truth.
    """
    apart: list[tuple[int, float]] = []
    spare = len(among) // 3
    while len(among) > 2 and len(apart) < spare:
        which = away.suspects(among)
        if not len(which):
            break
        chance, by = chances_apart(away.motors[among], away.covariances[among], which)
        degrees = away.shift(by)
        chance = np.where(degrees > away.departure_deg, chance * len(among), 1.0)
        worst = int(np.argmin(chance))
        if chance[worst] >= SURE:
            break
        apart.append((int(among[which[worst]]), float(degrees[worst])))
        among = np.delete(among, which[worst])
    return among, apart


def _shift(flight: Flight, at: float) -> Callable[[FloatArray], FloatArray]:
    """Heading shift in degrees, level or tilted by 20°, of a difference of motor vectors."""
    horizontal = horizontal_part(flight.strength, flight.vertical)

    def degrees(difference: FloatArray) -> FloatArray:
        level = np.hypot(difference[..., 0], difference[..., 1])
        sine = (level + _TILT * np.abs(difference[..., 2])) * at / horizontal
        # A disturbance as strong as the field itself can point the heading anywhere.
        return np.where(sine < 1.0, np.degrees(np.arcsin(np.minimum(sine, 1.0))), 180.0)

    return degrees
