"""What somebody should know of a compass's flights, in words."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from magcomp.fleet.flights import Flight
from magcomp.judge.thresholds import Thresholds
from magcomp.model import Grade, unit_of
from magcomp.report import words

_SETTINGS = slice(3, 12)
_ALIKE = 1e-3
_OF_ONE = re.compile(r"compass (?P<slot>\d+): (?P<text>.*)", re.DOTALL)


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
    degrees
        Of heading, which the clause names; compasses that differ in this alone are told together.
    """

    attention: Attention
    text: str
    degrees: float = math.nan


def texts(findings: Iterable[Finding]) -> list[str]:
    """What the findings say, once where it is the same of several compasses but for the degrees.

    Examples
    --------
    >>> each = [Finding(Attention.ACT, f"compass {n}: off by {n}.0°", n) for n in (1, 3)]
    >>> texts([*each, Finding(Attention.LOOK, "its board changed")])
    ['compasses 1 and 3: off by up to 3.0°', 'its board changed']
    """
    said: dict[tuple[str, str], tuple[list[int], list[float]]] = {}
    for finding in findings:
        of_one = _OF_ONE.fullmatch(finding.text)
        text = finding.text if of_one is None else of_one["text"]
        before, named, after = text.partition(_degrees(finding.degrees))
        slots, degrees = said.setdefault((before, after), ([], []))
        slots.extend([] if of_one is None else [int(of_one["slot"])])
        degrees.extend([finding.degrees] if named else [])
    return [
        f"{words.compasses(sorted(slots))}: {text}" if slots else text
        for (before, after), (slots, degrees) in said.items()
        for text in [f"{before}{_up_to(before, degrees)}{after}"]
    ]


def _up_to(before: str, degrees: Sequence[float]) -> str:
    alike = {_degrees(each) for each in degrees}
    if len(alike) < 2:
        return "".join(alike)
    known = before.endswith(("up to ", "about "))
    return f"{'' if known else 'up to '}{_degrees(max(degrees))}"


def _degrees(value: float) -> str:
    return f"{value:.1f}°"


def scattering(slot: int, count: int, degrees: float, at: float, regressor: str) -> Finding:
    """Flights have no common answer."""
    return Finding(
        Attention.LOOK,
        f"compass {slot}: what the motors add differs between {count} flights by about "
        f"{_degrees(degrees)} of heading at {quantity(at, regressor)}: they have no common answer",
        degrees,
    )


def holds_in(flight: Flight, limits: Thresholds) -> Holds:
    """Whether the calibration that was in force on a flight was right."""
    if flight.verdict == Grade.REJECTED or not math.isfinite(flight.before_deg):
        return Holds.UNKNOWN
    if flight.before_deg <= limits.good_deg:
        return Holds.YES
    return Holds.BARELY if flight.before_deg <= limits.marginal_deg else Holds.NO


def of_newest(slot: int, newest: Flight, holds: Holds, limits: Thresholds) -> Iterator[Finding]:
    """What the newest flight says of the calibration in force, where it is not good."""
    at = quantity(newest.u_high, newest.regressor)
    if holds is Holds.NO or holds is Holds.BARELY:
        yield Finding(
            Attention.ACT if holds is Holds.NO else Attention.LOOK,
            f"compass {slot}: the calibration in force does not hold: on {date(newest.when)} the "
            f"heading was wrong by up to {_degrees(newest.before_deg)} at {at} (limit "
            f"{limits.good_deg:g}°)",
            newest.before_deg,
        )
    elif newest.verdict == Grade.REJECTED:
        first = newest.reasons.partition("\n")[0]
        yield Finding(
            Attention.LOOK,
            f"compass {slot}: its newest flight, {date(newest.when)}, gives no answer: {first}",
        )


def changed_since(
    slot: int, kind: str, when: float, degrees: float, at: float, regressor: str
) -> Finding:
    """What the motors add is not what it was."""
    where = f"{_degrees(degrees)} of heading at {quantity(at, regressor)}"
    if kind == "step":
        text = f"what the motors add changed on {date(when)} by {where}: was something moved?"
    else:
        text = f"what the motors add has drifted since {date(when)} by {where}"
    return Finding(Attention.ACT, f"compass {slot}: {text}", degrees)


def why(flight: Flight, others: Sequence[Flight], degrees: float) -> str:
    """What is different about a flight that disagrees with others, as far as the rows tell."""
    newest = others[-1]
    found = [f"{_degrees(degrees)} apart"]
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
