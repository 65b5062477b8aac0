"""The rows of the logs asked for, as flights of compasses."""

from __future__ import annotations

import gc
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from magcomp.fleet.row import VECTORS, Log, State
from magcomp.fleet.run import Known, key
from magcomp.model.recording import FloatArray


class Flight(NamedTuple):
    """One compass on one flight, or a log without a fit: what an overview needs of a row.

    A tuple, because an overview of many years holds a hundred thousand.
    """

    path: str
    digest: str
    state: str
    why: str
    autopilot: str
    kind: str
    firmware: str
    system: int
    uid: str
    device_ids: str
    start_unix_s: float
    modified_s: float
    compass: int
    device_id: int
    verdict: str
    reasons: str
    regressor: str
    before_deg: float
    bound_deg: float
    u_low: float
    u_high: float
    strength: float
    vertical: float
    correction: FloatArray
    in_force: FloatArray
    motor_covariance: FloatArray

    @property
    def when(self) -> float:
        """Unix time of the flight, as far as known; else of the file."""
        return self.start_unix_s if math.isfinite(self.start_unix_s) else self.modified_s


@dataclass(frozen=True)
class Selected:
    """What the store holds of the logs asked for.

    Attributes
    ----------
    flights
        Fitted compasses, each log once.
    unusable
        Logs without a fit, a row each.
    copies
        Logs that are copies of others.
    """

    flights: tuple[Flight, ...]
    unusable: tuple[Flight, ...]
    copies: int


def select(table: Any, logs: Sequence[Log], known: Known, since: float = -math.inf) -> Selected:
    """The flights of some logs.

    Parameters
    ----------
    table
        Of the store, with at least the columns of :class:`Flight`.
    logs
        Those asked for.
    known
        What the store knows, with these logs.
    since
        Unix time before which flights are left out.
    """
    wanted: dict[str, str] = {}
    lost: set[str] = set()
    for log in logs:
        digest = known.digests.get(key(log))
        if digest:
            wanted.setdefault(digest, log.path)
        elif digest is not None:
            lost.add(log.path)
    flights: dict[tuple[str, int], Flight] = {}
    unusable: dict[str, Flight] = {}
    # A member of an enumeration is compared by a function of its own, a hundred thousand times.
    copy, fitted, always = str(State.COPY), str(State.FITTED), since == -math.inf
    for flight in _uncollected(table):
        state, digest = flight.state, flight.digest
        if state == copy:
            continue
        if not digest:
            if flight.path in lost:
                unusable[flight.path] = flight
        elif digest in wanted and (always or not flight.when < since):
            place = wanted[digest]
            shown = flight if flight.path == place else flight._replace(path=place)
            if state == fitted:
                flights.setdefault((digest, flight.compass), shown)
            else:
                unusable.setdefault(digest, shown)
    copies = len(logs) - len(wanted) - len(lost)
    ordered = sorted(flights.values(), key=lambda each: (each.when, each.path, each.compass))
    return Selected(
        tuple(ordered), tuple(sorted(unusable.values(), key=lambda each: each.path)), copies
    )


def _uncollected(table: Any) -> list[Flight]:
    """All flights, made without Python looking for circles among them again and again."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        return list(_flights(table))
    finally:
        if enabled:
            gc.enable()


def _flights(table: Any) -> Iterator[Flight]:
    columns = [_column(table, name) for name in Flight._fields]
    return map(Flight._make, zip(*columns, strict=True))


def _column(table: Any, name: str) -> Sequence[Any]:
    column = table.column(name).combine_chunks()
    if name not in VECTORS:
        listed: list[Any] = column.to_pylist()
        return listed
    flat = column.flatten().to_numpy(zero_copy_only=False)
    rows: Any = np.asarray(flat, dtype=np.float64).reshape(len(table), VECTORS[name])
    return list(rows)


def by(flights: Sequence[Flight], name: str) -> Mapping[Any, list[Flight]]:
    """Flights by the value of one of their fields, in the order in which they come."""
    found: dict[Any, list[Flight]] = {}
    for flight in flights:
        found.setdefault(getattr(flight, name), []).append(flight)
    return found
