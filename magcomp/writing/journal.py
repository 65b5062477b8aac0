"""The journal of a write: what stands on the vehicle if the program dies.

It lies beside the backup, BACKUP.param and BACKUP.journal, one JSON object a
line. What is about to be sent is on the disk before the first message goes
out; confirmations follow as they come. They are forced to the disk with the
next intention: until then a killed program loses none of them, a power cut
perhaps, and the answer "not known" is still right.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

from magcomp.errors import OutputError, ParameterFileError
from magcomp.writing.events import Event, Intends, Outcome, Progress, Reason, Stage, Standing
from magcomp.writing.files import private, sync_directory
from magcomp.writing.owner import document
from magcomp.writing.plan import WritePlan

_BEGIN = "Begin"
_RESTORED = "Restored"


@dataclass(frozen=True)
class JournalState:
    """What a journal says.

    Attributes
    ----------
    backup
        The parameter file that brings everything back.
    standing
        What the vehicle holds, as far as the program came.
    outcome
        How the write ended; None where the program died in it.
    restored
        Whether a later `restore` brought everything back.
    """

    backup: Path
    standing: Standing
    outcome: Outcome | None = None
    restored: bool = False


def journal_path(backup: Path) -> Path:
    """Where the journal of a backup lies."""
    return backup.with_suffix(".journal")


class Journal:
    """Writes a journal; a context manager.

    Parameters
    ----------
    backup
        The backup it lies beside.
    plan
        What will be written.

    Raises
    ------
    OutputError
        Where there is a journal already, or the disk refuses one.
    """

    def __init__(self, backup: Path, plan: WritePlan) -> None:
        self.path = journal_path(backup)
        try:
            self._file: TextIO = open(  # noqa: SIM115 - closed by __exit__
                self.path, "x", encoding="utf-8", opener=private
            )
        except OSError as error:
            raise _refused(self.path, error) from error
        begin = {
            "event": _BEGIN,
            "backup": backup.name,
            "vehicle": document(plan.vehicle),
            "changes": [asdict(change) for change in plan.changes],
        }
        self._write([begin], sync=True)
        sync_directory(self.path.parent)

    def record(self, events: Sequence[Event]) -> None:
        """Keep events; where an intention is among them, on the disk before this returns.

        Raises
        ------
        OutputError
            Where the disk refuses.
        """
        kept = [event for event in events if not isinstance(event, Progress)]
        lines = [{"event": type(event).__name__, **asdict(event)} for event in kept]
        if lines:
            self._write(lines, sync=any(isinstance(e, Intends | Outcome) for e in kept))

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._file.close()

    def _write(self, lines: Sequence[dict[str, Any]], *, sync: bool) -> None:
        try:
            for line in lines:
                self._file.write(json.dumps(line, default=_enum_value) + "\n")
            self._file.flush()
            if sync:
                os.fsync(self._file.fileno())
        except OSError as error:
            raise _refused(self.path, error) from error


def read_journal(path: str | Path) -> JournalState:
    """Tell from a journal what stands on the vehicle.

    Parameters
    ----------
    path
        A journal, or the backup beside it. The last line may be cut.

    Raises
    ------
    ParameterFileError
        Where it is no journal.
    """
    path = Path(path)
    path = path if path.suffix == ".journal" else journal_path(path)
    try:
        text = path.read_text(encoding="utf-8")
        *lines, _cut = text.split("\n")
        begin, *events = (json.loads(line) for line in lines if line)
        state = _initial(path, begin)
        for event in events:
            state = _after(state, event)
    except OSError as error:
        raise ParameterFileError(
            f"{path} must be a readable journal; instead received: {error.strerror}"
        ) from error
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise ParameterFileError(
            f"{path} must be a journal that magcomp wrote; instead a line of it is not"
        ) from error
    return state


def mark_restored(backup: Path) -> None:
    """Add to a backup's journal, where there is one, that everything was brought back.

    Raises
    ------
    OutputError
        Where the disk refuses.
    """
    path = journal_path(backup)
    if not path.exists():
        return
    try:
        with path.open("r+b") as file:
            # The program may have died in the middle of a line: that line is lost.
            file.seek(file.read().rfind(b"\n") + 1)
            file.truncate()
            file.write(json.dumps({"event": _RESTORED}).encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise _refused(path, error) from error


def _initial(path: Path, begin: dict[str, Any]) -> JournalState:
    if begin["event"] != _BEGIN:
        raise ValueError(f"a journal must start with {_BEGIN}; instead received {begin['event']}")
    return JournalState(path.with_name(begin["backup"]), Standing.OLD)


def _after(state: JournalState, event: dict[str, Any]) -> JournalState:
    match event["event"]:
        case "Intends":
            # WRITE is intended only once the vehicle has confirmed its switches to be 0.
            writing = Stage(event["stage"]) is Stage.WRITE
            return JournalState(state.backup, Standing.OFF if writing else Standing.UNSURE)
        case "Restarted" | "RollingBack":
            touched = state.standing is not Standing.OLD
            return JournalState(state.backup, Standing.UNSURE if touched else Standing.OLD)
        case "Outcome":
            reason = None if event["reason"] is None else Reason(event["reason"])
            outcome = Outcome(Standing(event["standing"]), reason, str(event["why"]))
            return JournalState(state.backup, outcome.standing, outcome)
        case "Restored":
            return JournalState(state.backup, Standing.OLD, state.outcome, restored=True)
        case _:
            return state


def _enum_value(value: object) -> object:
    if isinstance(value, Enum):
        return value.value
    raise TypeError(f"{value!r} has no place in a journal")


def _refused(path: Path, error: OSError) -> OutputError:
    return OutputError(f"{path} must be writable; instead received: {error.strerror}")
