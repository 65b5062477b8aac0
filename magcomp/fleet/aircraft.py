"""Flights → aircraft: whose they are, and which aircraft need attention."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter

from magcomp.fleet.findings import Attention, Finding, date
from magcomp.fleet.flights import Flight, Selected, by
from magcomp.fleet.history import CompassHistory, Slot, histories
from magcomp.judge.thresholds import Thresholds


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
    groups: defaultdict[tuple[str, ...], tuple[list[Flight], list[Flight]]]
    groups = defaultdict(lambda: ([], []))
    owner = partial(_owner, boards=_boards([*selected.flights, *selected.unusable]))
    for flight in selected.flights:
        # Asked a hundred thousand times, so what most say is not asked of a function.
        who = ("board", flight.uid) if flight.uid else owner(flight)
        groups[who][0].append(flight)
    for flight in selected.unusable:
        # What could not even be read belongs to nobody.
        if flight.autopilot and (flight.uid or flight.device_ids):
            groups[owner(flight)][1].append(flight)
    standing = [_standing(flights) for flights, _ in groups.values()]
    told = iter(histories([slot for slots in standing for slot in slots], limits))
    found = [
        _aircraft(who, *of, [next(told) for _ in slots], limits)
        for (who, of), slots in zip(groups.items(), standing, strict=True)
    ]
    return tuple(sorted(found, key=_urgency))


def _standing(flights: Sequence[Flight]) -> list[Slot]:
    """The compasses that stand in an aircraft now, and the flights of each.

    Another compass in the same place is compared with nothing that was there before.
    """
    slots = sorted(by(flights, "compass").items())
    newest = [mine[-1].device_id for _, mine in slots]
    return [
        (slot, device, [flight for flight in mine if flight.device_id == device])
        for (slot, mine), device in zip(slots, newest, strict=True)
    ]


def _urgency(each: Aircraft) -> tuple[int, float, str]:
    worst = each.before_deg
    return -each.attention, -worst if math.isfinite(worst) else 0.0, each.name


def _boards(flights: Iterable[Flight]) -> dict[tuple[str, str], set[str]]:
    """Autopilot and compasses to the boards they were seen on."""
    found: dict[tuple[str, str], set[str]] = {}
    seen = {(flight.autopilot, flight.device_ids, flight.uid) for flight in flights}
    for autopilot, device_ids, uid in seen:
        if uid:
            found.setdefault((autopilot, device_ids), set()).add(uid)
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
    who: tuple[str, ...],
    flights: list[Flight],
    unusable: list[Flight],
    histories: list[CompassHistory],
    limits: Thresholds,
) -> Aircraft:
    # Flights come in order of time, but for those of which none is known.
    in_order = flights[-1:] if flights and math.isfinite(flights[-1].when) else flights
    newest = max([*in_order, *unusable], key=_when)
    changed: list[Finding] = []
    count = Counter(map(attrgetter("compass"), flights))
    for one in histories:
        before = count[one.compass] - len(one.flights)
        if before:
            changed.append(
                Finding(
                    Attention.LOOK,
                    f"compass {one.compass} was another one before {date(one.flights[0].when)}: "
                    f"its {_flights(before)} before are not compared",
                )
            )
    if who[0] == "compasses" and any(
        one.apart or one.scatter_deg > limits.departure_deg for one in histories
    ):
        changed.append(
            Finding(
                Attention.LOOK,
                "its logs name no board, and its flights differ: they may be of several aircraft "
                "of one build",
            )
        )
    findings = [*changed, *(each for one in histories for each in one.findings)]
    if not flights:
        findings.append(Finding(Attention.LOOK, f"{_none_of(len(unusable))} be used: {newest.why}"))
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


def _none_of(logs: int) -> str:
    return "its only log cannot" if logs == 1 else f"none of its {logs} logs can"


def _flights(count: int) -> str:
    return f"{count} flight{'s' if count != 1 else ''}"
