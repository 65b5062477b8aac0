"""One log from its bytes to its rows: what a worker does, here or on a cluster."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from magcomp.analysis import analyse
from magcomp.errors import LogError, MagcompError, unforeseen
from magcomp.fleet import places
from magcomp.fleet.row import Log, Row, State, rows_of, without_fit
from magcomp.model import Recording
from magcomp.report.files import report_text, write_text
from magcomp.sources import read

_PIECE = 1 << 20


@dataclass(frozen=True)
class Task:
    """What a worker is asked.

    Attributes
    ----------
    log
        What to read.
    known
        Digests of logs of this size that have rows already: a copy of one is not fitted again.
    reports
        Folder that gets a page a log; none is made where empty.
    """

    log: Log
    known: tuple[str, ...] = ()
    reports: str = ""


@dataclass(frozen=True)
class Outcome:
    """What a worker answers.

    Attributes
    ----------
    log, digest
        What was read; no digest where it could not be.
    rows
        Its rows.
    """

    log: Log
    digest: str
    rows: tuple[Row, ...]


def carry_out(task: Task) -> Outcome:
    """Read, fit and judge one log; whatever is wrong with it becomes a row."""
    log, digest, recording = task.log, "", None
    try:
        with local_file(log.path) as path:
            digest = digest_of(path)
            if digest in task.known:
                return Outcome(log, digest, without_fit(log, digest, "", state=State.COPY))
            recording = read(path)
        analysis = analyse(recording)
        if task.reports:
            page = report_text(".html", recording, analysis)
            write_text(Path(task.reports) / report_name(digest), page, force=True)
        rows = rows_of(log, digest, recording, analysis)
    except MagcompError as error:
        rows = _unusable(log, digest, str(error), recording)
    except MemoryError:
        # Not the log's fault: with more memory it may well be read.
        why = "it must fit in a worker's memory: see --memory; instead it did not"
        return Outcome(log, "", without_fit(log, "", why, state=State.LOST))
    # One log in ten thousand that nobody foresaw must not end the run.
    except Exception as error:
        rows = _unusable(log, digest, unforeseen(error), recording)
    return Outcome(log, digest, rows)


def report_name(digest: str) -> str:
    """File of the page of a log."""
    return f"{digest[:32]}.html"


def digest_of(path: Path) -> str:
    """SHA-256 of a file's content.

    Raises
    ------
    LogError
        Where the file cannot be read.
    """
    made = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while piece := file.read(_PIECE):
                made.update(piece)
    except OSError as error:
        raise LogError(f"{path} must be readable; instead received: {error.strerror}") from error
    return made.hexdigest()


def _unusable(log: Log, digest: str, why: str, recording: Recording | None) -> tuple[Row, ...]:
    return without_fit(log, digest, why, of=recording)


@contextmanager
def local_file(place: str) -> Iterator[Path]:
    """What lies at a place as a file of this machine.

    Raises
    ------
    LogError
        Where it cannot be fetched.
    """
    if not places.is_address(place):
        yield Path(place)
        return
    with places.fetched(place) as path:
        try:
            yield path
        except MagcompError as error:
            # The user knows the address, not where it was put.
            raise type(error)(str(error).replace(os.fspath(path), place)) from error
