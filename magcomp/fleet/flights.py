"""The rows of the logs asked for, as flights of compasses."""

from __future__ import annotations

import gc
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np

from magcomp.fleet.row import VECTORS, Log, State
from magcomp.fleet.run import Known, key
from magcomp.fleet.store import listed, words_of
from magcomp.model.recording import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Vectors:
    """What has several numbers, of all rows of a table.

    Attributes
    ----------
    correction, in_force, motor_covariance
        As in :class:`magcomp.fleet.row.Row`, a row each.
    """

    correction: FloatArray
    in_force: FloatArray
    motor_covariance: FloatArray


class Flight(NamedTuple):
    """One compass on one flight, or a log without a fit: what an overview needs of a row.

    A tuple, because an overview of many years holds a hundred thousand; for the same reason its
    vectors stand with those of all others, in a row of their arrays.
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
    row: int
    vectors: Vectors

    @property
    def correction(self) -> FloatArray:
        """Fitted, shape (12,)."""
        return np.asarray(self.vectors.correction[self.row])

    @property
    def in_force(self) -> FloatArray:
        """What was in force, shape (12,)."""
        return np.asarray(self.vectors.in_force[self.row])

    @property
    def when(self) -> float:
        """Unix time of the flight, as far as known; else of the file."""
        return self.start_unix_s if math.isfinite(self.start_unix_s) else self.modified_s


NEEDED = (*(name for name in Flight._fields if name not in ("row", "vectors")), *VECTORS)
"""What a table must have for :func:`select`."""


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
        Of the store, with at least ``NEEDED``.
    logs
        Those asked for.
    known
        What the store knows, with these logs.
    since
        Unix time before which flights are left out.
    """
    # What the last overview was made of may go.
    gc.unfreeze()
    wanted: dict[str, str] = {}
    lost: set[str] = set()
    for log in logs:
        digest = known.digests.get(key(log))
        if digest:
            wanted.setdefault(digest, log.path)
        elif digest is not None:
            lost.add(log.path)
    copies = len(logs) - len(wanted) - len(lost)
    rows, vectors = _Rows(table), Vectors(**{name: _matrix(table, name) for name in VECTORS})
    asked = rows.of(wanted) & ~(rows.when < since)
    fitted = rows.first_of_each_compass(asked & rows.is_in(State.FITTED))
    others = asked & ~rows.is_in(State.FITTED) & ~rows.is_in(State.COPY)
    unusable: dict[str, Flight] = {}
    for flight in _flights(table, vectors, np.flatnonzero(others)):
        unusable.setdefault(flight.digest, flight._replace(path=wanted[flight.digest]))
    for flight in _flights(table, vectors, np.flatnonzero(rows.of({""}) & ~rows.is_in(State.COPY))):
        if flight.path in lost:
            unusable[flight.path] = flight
    return Selected(
        tuple(_flights(table, vectors, rows.in_order(fitted, wanted), wanted)),
        tuple(sorted(unusable.values(), key=lambda each: each.path)),
        copies,
    )


class _Rows:
    """What chooses among the rows of a table, a hundred thousand at once."""

    def __init__(self, table: Any) -> None:
        start, modified = (table.column(name).to_numpy() for name in ("start_unix_s", "modified_s"))
        self.when = np.where(np.isfinite(start), start, modified)
        self._compass = table.column("compass").to_numpy()
        self._digests, self._digest = words_of(table, "digest")
        self._states, self._state = words_of(table, "state")

    def of(self, digests: Collection[str]) -> BoolArray:
        """Rows of these logs."""
        return np.array([each in digests for each in self._digests], dtype=bool)[self._digest]

    def is_in(self, state: State) -> BoolArray:
        """Rows in a state."""
        return np.array([each == str(state) for each in self._states], dtype=bool)[self._state]

    def first_of_each_compass(self, which: BoolArray) -> IntArray:
        """Indices of the first rows of each compass of each log, among some rows."""
        rows = np.flatnonzero(which)
        each = np.stack([self._digest[rows], self._compass[rows]])
        _, first = np.unique(each, axis=1, return_index=True)
        return rows[first]

    def in_order(self, rows: IntArray, paths: Mapping[str, str]) -> IntArray:
        """The same rows by time, then by path, then by compass."""
        named = [paths.get(digest, "") for digest in self._digests]
        rank = np.empty(len(named), dtype=np.intp)
        rank[sorted(range(len(named)), key=named.__getitem__)] = np.arange(len(named))
        keys = (self._compass[rows], rank[self._digest[rows]], self.when[rows])
        return rows[np.lexsort(keys)]


def _flights(
    table: Any, vectors: Vectors, rows: IntArray, paths: Mapping[str, str] | None = None
) -> Sequence[Flight]:
    """Some rows as flights.

    Notes
    -----
    Made, and kept, without Python looking for circles among them again and again.
    """
    if not len(rows):
        return []
    columns = {name: listed(table, name, rows) for name in NEEDED if name not in VECTORS}
    if paths is not None:
        columns["path"] = [paths[digest] for digest in columns["digest"]]
    enabled = gc.isenabled()
    gc.disable()
    try:
        return list(map(Flight, *columns.values(), rows.tolist(), repeat(vectors)))
    finally:
        gc.freeze()
        if enabled:
            gc.enable()


def _matrix(table: Any, name: str) -> FloatArray:
    flat = table.column(name).combine_chunks().flatten().to_numpy(zero_copy_only=False)
    return np.asarray(flat, dtype=np.float64).reshape(len(table), VECTORS[name])


def by(flights: Sequence[Flight], name: str) -> Mapping[Any, list[Flight]]:
    """Flights by the value of one of their fields, in the order in which they come."""
    found: dict[Any, list[Flight]] = {}
    for flight in flights:
        found.setdefault(getattr(flight, name), []).append(flight)
    return found
