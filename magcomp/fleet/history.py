"""One compass over all its flights: what they say together, and whether it still holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from magcomp.fleet.agreeing import Agreement, agreeing, at_once, heading_shift, put_together
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
from magcomp.fleet.matrices import ROWS, is_definite
from magcomp.fleet.pooled import Change, Pooled, changes
from magcomp.geometry import horizontal_part
from magcomp.judge.thresholds import Thresholds
from magcomp.model import Grade
from magcomp.model.recording import FloatArray

_COVARIANCE = np.array(ROWS)


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
"""A compass's slot, the id of what stands in it, and its flights in order of time, at least one.

All flights of a call are of one table.
"""


@dataclass(frozen=True, eq=False)
class _Compared:
    """A compass whose flights can be compared, and what of them agrees."""

    slot: int
    device_id: int
    flights: Sequence[Flight]
    usable: Sequence[int]
    at: float
    """Largest control quantity of its flights."""
    agree: Agreement
    changed: Change | None = None

    @property
    def furthest_deg(self) -> float:
        """Of its flights from their mean."""
        return float(self.shift(self.agree.motors - self.agree.pooled.motor).max())

    def shift(self, difference: FloatArray) -> FloatArray:
        """Heading shift there, degrees, of a difference of motor vectors."""
        return heading_shift(difference, self.agree.leverage)


def history(
    slot: int, device_id: int, flights: Sequence[Flight], limits: Thresholds
) -> CompassHistory:
    """One compass over time.

    Parameters
    ----------
    slot, device_id
        Of the compass.
    flights
        Its flights in order of time, at least one, of one table.
    limits
        Of the judge.
    """
    return histories([(slot, device_id, flights)], limits)[0]


def histories(every: Sequence[Slot], limits: Thresholds) -> list[CompassHistory]:
    """:func:`history` for many compasses: those with as many flights each are pooled at once."""
    compared = [_compared(*each) for each in every]
    known = [each for each in compared if each is not None]
    pooled = put_together([each.agree for each in known])
    known = [replace(each, agree=mean) for each, mean in zip(known, pooled, strict=True)]
    told = iter(_told(each, limits) for each in _left_out(known, limits.departure_deg))
    return [
        _untold(*whole, limits) if each is None else next(told)
        for whole, each in zip(every, compared, strict=True)
    ]


def _left_out(every: Sequence[_Compared], departure_deg: float) -> list[_Compared]:
    """The same without the flights that what changed since, or the others, speak against."""
    found = list(every)
    far = [i for i, each in enumerate(every) if each.furthest_deg > departure_deg / 2]
    changed = at_once([every[i] for i in far], lambda each: len(each.usable), _changes)
    stepped = []
    for i, what in zip(far, changed, strict=True):
        if what is not None and float(every[i].shift(what.difference)) > departure_deg:
            since = replace(every[i].agree, among=every[i].agree.among[what.first :])
            found[i] = replace(every[i], agree=since, changed=what)
            stepped.append(i)
    for i, agree in zip(stepped, put_together([found[i].agree for i in stepped]), strict=True):
        found[i] = replace(found[i], agree=agree)
    agreed = agreeing([found[i].agree for i in far], departure_deg)
    for i, agree in zip(far, agreed, strict=True):
        found[i] = replace(found[i], agree=agree)
    return found


def _changes(some: Sequence[_Compared]) -> Sequence[Change | None]:
    return changes(
        np.array([[each.flights[i].when for i in each.usable] for each in some]),
        np.stack([each.agree.motors for each in some]),
        np.stack([each.agree.covariances for each in some]),
    )


def _compared(slot: int, device_id: int, flights: Sequence[Flight]) -> _Compared | None:
    """The flights whose fit is believed, and made against what the newest was made against."""
    regressor = flights[-1].regressor
    asked = [
        i
        for i, each in enumerate(flights)
        if each.verdict != Grade.REJECTED and each.regressor == regressor
    ]
    if not asked:
        return None
    vectors, rows = flights[-1].vectors, [flights[i].row for i in asked]
    motors = vectors.correction[rows, :3]
    covariances = vectors.motor_covariance[rows][:, _COVARIANCE]
    sound = np.isfinite(motors).all(1) & is_definite(covariances)
    if not sound.any():
        return None
    usable = [i for i, good in zip(asked, sound.tolist(), strict=True) if good]
    at = max([flights[i].u_high for i in usable])
    newest = flights[-1]
    agree = Agreement(
        motors[sound],
        covariances[sound],
        at / horizontal_part(newest.strength, newest.vertical),
        np.arange(len(usable)),
    )
    return _Compared(slot, device_id, flights, usable, at, agree)


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


def _told(of: _Compared, limits: Thresholds) -> CompassHistory:
    flights, usable, slot = of.flights, of.usable, of.slot
    newest, agreeing, pooled = flights[-1], of.agree.among, of.agree.pooled
    holds = holds_in(newest, limits)
    findings = list(of_newest(slot, newest, holds, limits))
    drift = 0.0
    if of.changed is not None:
        drift = float(of.shift(of.changed.difference))
        when = flights[usable[of.changed.first]].when
        findings.append(changed_since(slot, of.changed.kind, when, drift, of.at, newest.regressor))
    scatter_deg = float(of.shift(np.full(3, pooled.scatter)))
    agree = len(agreeing) > 1 and scatter_deg <= limits.departure_deg
    if scatter_deg > limits.departure_deg:
        findings.append(scattering(slot, len(agreeing), scatter_deg, of.at, newest.regressor))
    named = tuple(
        (usable[k], why(flights[usable[k]], [flights[usable[j]] for j in agreeing], degrees))
        for k, degrees in of.agree.apart
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
