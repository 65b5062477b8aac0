"""Flights → aircraft: what each one's compasses say over time, and which need attention."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import partial

import numpy as np

from magcomp.fleet.flights import Flight, Selected
from magcomp.fleet.pooled import SURE, Pooled, chances_apart, change, pool
from magcomp.judge.thresholds import Thresholds
from magcomp.model import UNITS, Grade
from magcomp.model.recording import FloatArray, IntArray

_COVARIANCE = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
_MOTOR, _SETTINGS = slice(0, 3), slice(3, 12)
_ALIKE = 1e-3
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


@dataclass(frozen=True, eq=False)
class Aircraft:
    """One aircraft, as far as its logs tell it from others.

    Attributes
    ----------
    name
        For people: its board's number, else what its compasses are, else a log's name.
    known_by
        ``"board"``, ``"compasses"`` (aircraft of one build share their ids) or ``"log"``.
    uid, device_ids, autopilot, kind, firmware
        As the newest log tells.
    compasses
        Their histories, in order of slots.
    unusable
        Its logs without a fit.
    findings
        What somebody should know, most urgent first.
    """

    name: str
    known_by: str
    uid: str
    device_ids: str
    autopilot: str
    kind: str
    firmware: str
    compasses: tuple[CompassHistory, ...]
    unusable: tuple[Flight, ...]
    findings: tuple[Finding, ...]

    @property
    def attention(self) -> Attention:
        """That of the most urgent finding."""
        return max((each.attention for each in self.findings), default=Attention.NONE)

    @property
    def logs(self) -> int:
        """How many logs it has, with a fit or without."""
        fitted = {flight.digest for compass in self.compasses for flight in compass.flights}
        return len(fitted) + len(self.unusable)

    @property
    def newest(self) -> float:
        """Unix time of its newest flight; NaN where unknown."""
        times = [c.flights[-1].when for c in self.compasses] + [f.when for f in self.unusable]
        return max((each for each in times if math.isfinite(each)), default=math.nan)

    @property
    def before_deg(self) -> float:
        """Largest heading error in force on the newest flights; NaN where unknown."""
        errors = [c.flights[-1].before_deg for c in self.compasses]
        return max((each for each in errors if math.isfinite(each)), default=math.nan)


def aircraft(selected: Selected, limits: Thresholds | None = None) -> tuple[Aircraft, ...]:
    """The aircraft of some logs, those that need attention first.

    Parameters
    ----------
    selected
        Fitted compasses in order of time, and logs without a fit.
    limits
        Of the judge.
    """
    limits = Thresholds() if limits is None else limits
    groups: dict[tuple[str, ...], tuple[list[Flight], list[Flight]]] = {}
    owner = partial(_owner, boards=_boards([*selected.flights, *selected.unusable]))
    for flight in selected.flights:
        groups.setdefault(owner(flight), ([], []))[0].append(flight)
    for flight in selected.unusable:
        # What could not even be read belongs to nobody.
        if flight.autopilot and (flight.uid or flight.device_ids):
            groups.setdefault(owner(flight), ([], []))[1].append(flight)
    found = [
        _aircraft(who, flights, unusable, limits) for who, (flights, unusable) in groups.items()
    ]
    return tuple(sorted(found, key=_urgency))


def _urgency(each: Aircraft) -> tuple[int, float, str]:
    worst = each.before_deg
    return -each.attention, -worst if math.isfinite(worst) else 0.0, each.name


def _boards(flights: Iterable[Flight]) -> dict[tuple[str, str], set[str]]:
    """Autopilot and compasses to the boards they were seen on."""
    found: dict[tuple[str, str], set[str]] = {}
    for flight in flights:
        if flight.uid:
            found.setdefault((flight.autopilot, flight.device_ids), set()).add(flight.uid)
    return found


def _owner(flight: Flight, boards: dict[tuple[str, str], set[str]]) -> tuple[str, ...]:
    if flight.uid:
        return ("board", flight.uid)
    if not flight.device_ids:
        return ("log", flight.digest, flight.path)
    seen = boards.get((flight.autopilot, flight.device_ids), set())
    if len(seen) == 1:
        # A log that names no board, with the compasses of just one that is known.
        return ("board", *seen)
    return ("compasses", flight.autopilot, flight.kind, str(flight.system), flight.device_ids)


def _aircraft(
    who: tuple[str, ...], flights: list[Flight], unusable: list[Flight], limits: Thresholds
) -> Aircraft:
    newest = max([*flights, *unusable], key=_when)
    slots = sorted({flight.compass for flight in flights})
    histories = []
    changed: list[Finding] = []
    for slot in slots:
        mine = [flight for flight in flights if flight.compass == slot]
        standing = mine[-1].device_id
        # Another compass in the same place is compared with nothing that was there before.
        same = [flight for flight in mine if flight.device_id == standing]
        if len(same) < len(mine):
            changed.append(
                Finding(
                    Attention.LOOK,
                    f"compass {slot} was another one before {date(same[0].when)}: its "
                    f"{_flights(len(mine) - len(same))} before are not compared",
                )
            )
        histories.append(history(slot, standing, same, limits))
    findings = [*changed, *(each for one in histories for each in one.findings)]
    if not flights:
        findings.append(
            Finding(Attention.LOOK, f"none of its {len(unusable)} logs can be used: {newest.why}")
        )
    findings.sort(key=lambda each: -each.attention)
    return Aircraft(
        name=_name(who, newest),
        known_by=who[0],
        uid=who[1] if who[0] == "board" else "",
        device_ids=newest.device_ids,
        autopilot=newest.autopilot,
        kind=newest.kind,
        firmware=newest.firmware,
        compasses=tuple(histories),
        unusable=tuple(unusable),
        findings=tuple(findings),
    )


def _when(flight: Flight) -> float:
    return flight.when if math.isfinite(flight.when) else -math.inf


def _name(who: tuple[str, ...], newest: Flight) -> str:
    match who:
        case ("board", uid):
            return uid
        case ("compasses", _, kind, system, ids):
            return f"{kind} {system} with compasses {ids}"
    return newest.path


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
    usable = [i for i, each in enumerate(flights) if _comparable(each, newest)]
    if not usable:
        return CompassHistory(
            slot, device_id, tuple(flights), newest.regressor, None, (), (), 0.0, holds,
            tuple(findings),
        )  # fmt: skip
    motors = np.array([flights[i].correction[_MOTOR] for i in usable])
    covariances = np.array([flights[i].motor_covariance[_COVARIANCE] for i in usable])
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
        agreeing, apart = _agree(agreeing, motors, covariances, shift, limits.departure_deg)
        pooled = pool(motors[agreeing], covariances[agreeing])
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
    )


def _comparable(flight: Flight, newest: Flight) -> bool:
    """Whether a fit is believed, and was made against what the newest was made against."""
    return (
        flight.verdict != Grade.REJECTED
        and flight.regressor == newest.regressor
        and bool(np.isfinite(flight.correction[_MOTOR]).all())
        and bool(np.isfinite(flight.motor_covariance).all())
        and bool(np.linalg.eigvalsh(flight.motor_covariance[_COVARIANCE])[0] > 0.0)
    )


def _agree(
    among: IntArray,
    motors: FloatArray,
    covariances: FloatArray,
    shift: Callable[[FloatArray], FloatArray],
    departure_deg: float,
) -> tuple[IntArray, list[tuple[int, float]]]:
    """Leave out the flight that is furthest from the others until all agree.

    Of two that disagree nobody knows which is wrong, so both stay, with a scatter between them.
    Nor is more than a third left out: then the scatter is the truth.
    """
    apart: list[tuple[int, float]] = []
    spare = len(among) // 3
    while len(among) > 2 and len(apart) < spare:
        chance, away = chances_apart(motors[among], covariances[among])
        degrees = shift(away)
        chance = np.where(degrees > departure_deg, chance * len(among), 1.0)
        worst = int(np.argmin(chance))
        if chance[worst] >= SURE:
            break
        apart.append((int(among[worst]), float(degrees[worst])))
        among = np.delete(among, worst)
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
    unit = UNITS.get(regressor, "")
    return f"{u:.0f} {unit}" if unit else f"{100 * u:.0f} % throttle"


def date(unix_s: float) -> str:
    """A day, UTC; a question mark where it is unknown or none."""
    if not math.isfinite(unix_s):
        return "?"
    days = np.datetime64(int(unix_s), "s") if abs(unix_s) < 1e11 else None
    return "?" if days is None else str(days)[:10]


def _flights(count: int) -> str:
    return f"{count} flight{'s' if count != 1 else ''}"
