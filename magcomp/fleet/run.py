"""From logs to rows in the store: what is known already is not read again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from magcomp.fleet.row import Log, Row, State, without_fit
from magcomp.fleet.store import Store, listed, words_of
from magcomp.fleet.task import Outcome, Task

_ROWS_A_FILE = 200
_SECONDS_A_FILE = 10.0

Runner = Callable[[Iterable[Task]], Iterator[Outcome]]
"""Carries tasks out, somewhere, and gives the outcomes as they come."""


@dataclass(frozen=True)
class Known:
    """What the store knows of logs, without their rows.

    Attributes
    ----------
    digests
        Path, size and stamp to the digest of a log that has rows.
    by_size
        Size to the digests of all logs of that size.
    lost
        Path, size and stamp of the logs that were lost.
    """

    digests: dict[tuple[str, int, str], str]
    by_size: dict[int, set[str]]
    lost: frozenset[tuple[str, int, str]]


def known_of(store: Store) -> Known:
    """Look through the store."""
    names = ["path", "size", "stamp", "digest", "state"]
    table = store.read(names)
    # A log has a row a compass, one after the other, and they say the same of it.
    coded = [words_of(table, name)[1] for name in names if name != "size"]
    different = np.ones(len(table), dtype=bool)
    different[1:] = np.any(np.diff([*coded, table.column("size").to_numpy()], axis=1), axis=0)
    columns = [listed(table, name, np.flatnonzero(different)) for name in names]
    gone = str(State.LOST)  # a member of an enumeration is compared by a function of its own
    digests: dict[tuple[str, int, str], str] = {}
    by_size: dict[int, set[str]] = {}
    lost = set()
    for path, size, stamp, digest, state in zip(*columns, strict=True):
        if state == gone:
            lost.add((path, size, stamp))
            continue
        digests[path, size, stamp] = digest
        if digest:
            by_size.setdefault(size, set()).add(digest)
    # Rows come in no order: what was lost may have been found at another try.
    lost -= digests.keys()
    digests.update(dict.fromkeys(lost, ""))
    return Known(digests, by_size, frozenset(lost))


def to_do(logs: Sequence[Log], known: Known, *, again: bool = False) -> list[Log]:
    """The logs that have no rows yet.

    Parameters
    ----------
    logs
        Those found.
    known
        What the store knows.
    again
        Also those that were lost with their worker.
    """
    # A place that gives no stamp cannot say that a log is unchanged.
    return [
        log
        for log in logs
        if not log.stamp or key(log) not in known.digests or (again and key(log) in known.lost)
    ]


def key(log: Log) -> tuple[str, int, str]:
    """What tells a log from another without opening it."""
    return log.path, log.size, log.stamp


def lost(task: Task, why: str) -> Outcome:
    """The outcome of a log whose worker gave none."""
    return Outcome(task.log, "", without_fit(task.log, "", why, state=State.LOST))


@dataclass
class Kept:
    """Rows on their way to the store, which gets them by the file."""

    store: Store
    clock: Callable[[], float]

    def __post_init__(self) -> None:
        self._rows: list[Row] = []
        self._since = self.clock()

    def add(self, rows: Iterable[Row]) -> None:
        """Take rows, and write those there are where they are many, or old."""
        self._rows.extend(rows)
        if len(self._rows) >= _ROWS_A_FILE or self.clock() - self._since > _SECONDS_A_FILE:
            self.flush()

    def flush(self) -> None:
        """Write what there is."""
        rows, self._rows = self._rows, []
        self._since = self.clock()
        self.store.append(rows)


def carry_out_all(
    logs: Sequence[Log],
    known: Known,
    store: Store,
    runner: Runner,
    clock: Callable[[], float],
    reports: str = "",
) -> Iterator[Outcome]:
    """Fit logs and keep their rows; outcomes as they come.

    Parameters
    ----------
    logs
        Those to do.
    known
        What the store knows; grows as logs are done, so that copies are recognised.
    store
        Gets the rows, also where this ends early.
    runner
        Does the work.
    clock
        Seconds that only grow.
    reports
        Folder for a page a log, or empty.
    """
    kept = Kept(store, clock)

    def tasks() -> Iterator[Task]:
        for log in logs:
            yield Task(log, tuple(known.by_size.get(log.size, ())), reports)

    try:
        for outcome in runner(tasks()):
            if outcome.digest:
                known.by_size.setdefault(outcome.log.size, set()).add(outcome.digest)
            known.digests[key(outcome.log)] = outcome.digest
            kept.add(outcome.rows)
            yield outcome
    finally:
        kept.flush()
