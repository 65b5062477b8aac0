"""One compass over all its flights: what they say together, and whether it still holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from magcomp.fleet.flights import Flight
from magcomp.fleet.pooled import SURE, Pooled, chances_apart, change, distances, is_definite, pool
from magcomp.judge.thresholds import Thresholds
from magcomp.model import Grade, unit_of
from magcomp.model.recording import FloatArray, IntArray

_COVARIANCE = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
_MOTOR, _SETTINGS = slice(0, 3), slice(3, 12)
_ALIKE = 1e-3
_MOST_SUSPECTS = 6
"""Flights looked at closely: which of the many that are somewhat far off is the furthest, tells
already their distance from the mean of all."""

_TILT = math.sin(math.radians(20.0))


class Attention(IntEnum):
    """How soon somebody should look."""

    NONE = 0
    LOOK = 1
    ACT = 2


class Holds(IntEnum):
    """Whether the calibration in force is still right, going by the newest flight."""

    UNKNOWN = 0
    YES = 1
    BARELY = 2
    NO = 3


@dataclass(frozen=True)
class Finding:
    """What somebody should know of an aircraft.

    Attributes
    ----------
    attention
        How soon.
    text
        A clause, for people.
    """

    attention: Attention
    text: str


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
    newest = flights[-1]
    holds = holds_in(newest, limits)
    findings = list(_of_newest(slot, newest, holds, limits))
    usable = _comparable(flights)
    if not usable:
        return CompassHistory(
            slot, device_id, tuple(flights), newest.regressor, None, (), (), 0.0, holds,
            tuple(findings),
        )  # fmt: skip
    motors, covariances = _motors(flights, usable), _covariances(flights, usable)
    at = max(flights[i].u_high for i in usable)
    shift = _shift(newest, at)
    agreeing: IntArray = np.arange(len(usable))
    drift = 0.0
    apart: list[tuple[int, float]] = []
    pooled = pool(motors, covariances)
    if float(shift(motors - pooled.motor).max()) > limits.departure_deg / 2:
        times = np.array([flights[i].when for i in usable])
        changed = change(times, motors, covariances)
        if changed is not None and float(shift(changed.difference)) > limits.departure_deg:
            drift = float(shift(changed.difference))
            agreeing = agreeing[changed.first :]
            when = flights[usable[changed.first]].when
            findings.append(_changed(slot, changed.kind, when, drift, at, newest.regressor))
        away = _Away(motors, covariances, shift, limits.departure_deg, pooled)
        agreeing, apart = _agree(agreeing, away)
        if len(agreeing) < len(usable):
            pooled = pool(motors[agreeing], covariances[agreeing])
    scatter_deg = float(shift(np.full(3, pooled.scatter)))
    agree = len(agreeing) > 1 and scatter_deg <= limits.departure_deg
    if scatter_deg > limits.departure_deg:
        findings.append(_scattering(slot, len(agreeing), scatter_deg, at, newest.regressor))
    named = tuple(
        (usable[k], why(flights[usable[k]], [flights[usable[j]] for j in agreeing], float(deg)))
        for k, deg in apart
    )
    if named:
        of = len(agreeing) + len(named)
        listed = "; ".join(f"{flights[i].path} ({text})" for i, text in named[:3])
        more = f"; and {len(named) - 3} more" if len(named) > 3 else ""
        findings.append(
            Finding(
                Attention.LOOK,
                f"compass {slot}: {len(named)} of {of} flights disagree with the others: "
                f"{listed}{more}",
            )
        )
    return CompassHistory(
        slot,
        device_id,
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


def _scattering(slot: int, count: int, degrees: float, at: float, regressor: str) -> Finding:
    return Finding(
        Attention.LOOK,
        f"compass {slot}: what the motors add differs between {count} flights by about "
        f"{degrees:.1f}° of heading at {quantity(at, regressor)}: they have no common answer",
    )


def _comparable(flights: Sequence[Flight]) -> list[int]:
    """The flights whose fit is believed, and made against what the newest was made against."""
    regressor = flights[-1].regressor
    asked = [
        i
        for i, each in enumerate(flights)
        if each.verdict != Grade.REJECTED and each.regressor == regressor
    ]
    covariances = _covariances(flights, asked)
    sound = np.isfinite(_motors(flights, asked)).all(1) & is_definite(covariances)
    return [i for i, good in zip(asked, sound.tolist(), strict=True) if good]


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
        heaviest = int(np.argmin(np.trace(covariances, axis1=1, axis2=2)))
        far[heaviest] |= far.any()
        suspects = np.flatnonzero(far)
        if len(suspects) <= _MOST_SUSPECTS:
            return suspects
        unlikely = distances(self.motors[among][suspects], covariances[suspects], pooled)
        unlikely[suspects == heaviest] = np.inf
        return np.sort(suspects[np.argsort(unlikely)[-_MOST_SUSPECTS:]])


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
    horizontal = math.sqrt(max(flight.strength**2 - flight.vertical**2, 1.0))

    def degrees(difference: FloatArray) -> FloatArray:
        level = np.hypot(difference[..., 0], difference[..., 1])
        sine = (level + _TILT * np.abs(difference[..., 2])) * at / horizontal
        # A disturbance as strong as the field itself can point the heading anywhere.
        return np.where(sine < 1.0, np.degrees(np.arcsin(np.minimum(sine, 1.0))), 180.0)

    return degrees


def holds_in(flight: Flight, limits: Thresholds) -> Holds:
    """Whether the calibration that was in force on a flight was right."""
    if flight.verdict == Grade.REJECTED or not math.isfinite(flight.before_deg):
        return Holds.UNKNOWN
    if flight.before_deg <= limits.good_deg:
        return Holds.YES
    return Holds.BARELY if flight.before_deg <= limits.marginal_deg else Holds.NO


def _of_newest(slot: int, newest: Flight, holds: Holds, limits: Thresholds) -> Iterator[Finding]:
    at = quantity(newest.u_high, newest.regressor)
    if holds is Holds.NO or holds is Holds.BARELY:
        yield Finding(
            Attention.ACT if holds is Holds.NO else Attention.LOOK,
            f"compass {slot}: the calibration in force does not hold: on {date(newest.when)} the "
            f"heading was wrong by up to {newest.before_deg:.1f}° at {at} (limit "
            f"{limits.good_deg:g}°)",
        )
    elif newest.verdict == Grade.REJECTED:
        first = newest.reasons.partition("\n")[0]
        yield Finding(
            Attention.LOOK,
            f"compass {slot}: its newest flight, {date(newest.when)}, gives no answer: {first}",
        )


def _changed(
    slot: int, kind: str, when: float, degrees: float, at: float, regressor: str
) -> Finding:
    where = f"{degrees:.1f}° of heading at {quantity(at, regressor)}"
    if kind == "step":
        text = f"what the motors add changed on {date(when)} by {where}: was something moved?"
    else:
        text = f"what the motors add has drifted since {date(when)} by {where}"
    return Finding(Attention.ACT, f"compass {slot}: {text}")


def why(flight: Flight, others: Sequence[Flight], degrees: float) -> str:
    """What is different about a flight that disagrees with others, as far as the rows tell."""
    newest = others[-1]
    found = [f"{degrees:.1f}° apart"]
    if flight.verdict == Grade.MARGINAL:
        found.append(f"marginal: {flight.reasons.partition(chr(10))[0]}")
    if flight.firmware != newest.firmware:
        found.append(f"firmware {flight.firmware or 'unknown'}")
    settings = flight.in_force[_SETTINGS] - newest.in_force[_SETTINGS]
    if bool((np.abs(settings) > _ALIKE).any()):
        found.append("another compass calibration was in force")
    if flight.u_high < min(each.u_high for each in others):
        found.append(f"only up to {quantity(flight.u_high, flight.regressor)}")
    if len(found) == 1:
        found.append("nothing in the log tells why")
    return ", ".join(found)


def quantity(u: float, regressor: str) -> str:
    """A control quantity for people."""
    unit = unit_of(regressor)
    return f"{u:.0f} {unit}" if unit else f"{100 * u:.0f} % throttle"


def date(unix_s: float) -> str:
    """A day, UTC; a question mark where it is unknown or none."""
    if not math.isfinite(unix_s):
        return "?"
    days = np.datetime64(int(unix_s), "s") if abs(unix_s) < 1e11 else None
    return "?" if days is None else str(days)[:10]
