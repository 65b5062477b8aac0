"""Writing to a live vehicle: where backups lie, what is compared, who waits for what.

The protocol, the plan and the journal are ``magcomp.writing``; this joins them to a link.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import platformdirs

from magcomp.errors import LinkTimeoutError, OutputError, ParameterFileError, VehicleRefusedError
from magcomp.link import Connection
from magcomp.live.latest import Latest
from magcomp.model import ParameterSet, Vehicle
from magcomp.writing.events import Event, Outcome
from magcomp.writing.files import read_parameter_file
from magcomp.writing.journal import JournalState, journal_path, mark_restored, read_journal
from magcomp.writing.plan import WritePlan, plan
from magcomp.writing.reader import ReadProgress
from magcomp.writing.writer import ignore, never, read_current, write

DISARM_S = 300.0
"""How long a pilot gets to land and disarm."""

_FRESH_US = 1_500_000
_LOOK_S = 0.1

Tell = Callable[[Event], None]


def default_directory() -> Path:
    """Where backups and recordings lie unless the user says otherwise."""
    return Path(platformdirs.user_data_dir("magcomp", appauthor=False))


def new_file(kind: str, suffix: str, vehicle: Vehicle | None, unix_s: float) -> Path:
    """A file in :func:`default_directory` that does not exist, named after vehicle and time.

    Parameters
    ----------
    kind
        ``"backup"`` or ``"recording"``.
    suffix
        With its dot.

    Raises
    ------
    OutputError
        The directory cannot be made.
    """
    directory = default_directory()
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{directory} must be a writable directory; instead received: {error.strerror}"
        ) from error
    moment = datetime.fromtimestamp(unix_s, UTC).strftime("%Y%m%dT%H%M%SZ")
    who = f"{vehicle.autopilot}-{vehicle.system}-" if vehicle else ""
    for number in range(1, 1000):
        name = f"{kind}-{who}{moment}{'' if number == 1 else f'-{number}'}"
        path = directory / f"{name}{suffix}"
        if not path.exists() and not journal_path(path).exists():
            return path
    raise OutputError(f"{directory} must have room for another {kind}; instead it is full of them")


class WriteLink:
    """The link as a writer sees it, which begins with the newest heartbeat.

    A writer trusts no vehicle before a heartbeat says that it is disarmed. What
    waited in the link's inbox is old, and is dropped; but the newest heartbeat among it, if it
    came within the last second and a half, is as good as the next one, and saves waiting for it.
    """

    def __init__(self, connection: Connection, latest: Latest, unix_us: Callable[[], int]) -> None:
        self._connection = connection
        self._first = _newest_heartbeat(connection, latest, unix_us)

    def send(self, message: Any) -> None:
        """See Connection.send."""
        self._connection.send(message)

    def receive(self, timeout: float) -> Any | None:
        """See Connection.receive."""
        first, self._first = self._first, None
        return self._connection.receive(timeout) if first is None else first


def _newest_heartbeat(
    connection: Connection, latest: Latest, unix_us: Callable[[], int]
) -> Any | None:
    vehicle, newest = connection.vehicle, None
    while (message := connection.receive(0.0)) is not None:
        if message.get_type() == "HEARTBEAT":
            newest = message
    if vehicle is None or newest is None:
        return None
    age = unix_us() - latest.heartbeat_us(vehicle)
    return newest if 0 <= age <= _FRESH_US else None


def make_plan(
    connection: Connection,
    vehicle: Vehicle,
    wanted: ParameterSet,
    *,
    any_vehicle: bool = False,
    everything: bool = False,
    clock: Callable[[], float] = time.monotonic,
    on_progress: Callable[[ReadProgress], None] = ignore,
) -> WritePlan:
    """Read the vehicle's calibration and compare it with what is wanted; the options of ``plan``.

    Raises
    ------
    VehicleRefusedError
        Another vehicle than ``wanted`` belongs to.
    WriteError
        A wanted parameter is unknown to the vehicle.
    ParameterFileError
        Nothing in ``wanted`` is compass calibration.
    LinkTimeoutError, LinkError
        The vehicle does not answer, or the link is lost.
    """
    connection.discard()
    current = read_current(
        connection, vehicle, wanted, everything=everything, clock=clock, on_event=on_progress
    )
    return plan(current, wanted, vehicle, any_vehicle=any_vehicle, everything=everything)


def wait_disarmed(
    armed: Callable[[], bool | None],
    *,
    seconds: float = DISARM_S,
    clock: Callable[[], float] = time.monotonic,
    rest: Callable[[float], None] = time.sleep,
    tell: Callable[[str], None] = ignore,
    stop: Callable[[], bool] = never,
) -> None:
    """Wait until the vehicle says that it is disarmed.

    Parameters
    ----------
    armed
        What the newest heartbeat says; None where there is none.
    seconds
        How long at most.
    tell
        Told once, where there is something to wait for.
    stop
        Ends the waiting as if time were up.

    Raises
    ------
    VehicleRefusedError
        It is still armed.
    LinkTimeoutError
        It says nothing of it.
    """
    deadline = clock() + seconds
    told = False
    while (state := armed()) is not False:
        if clock() >= deadline or stop():
            if state is None:
                raise LinkTimeoutError(
                    f"The vehicle must say whether it is armed; instead no heartbeat came in "
                    f"{seconds:.0f} s"
                )
            still = f"still armed after {seconds:.0f} s" if seconds else "armed"
            raise VehicleRefusedError(
                f"The vehicle must be disarmed to be written; instead it is {still}"
            )
        if state and not told:
            tell(f"The vehicle is armed: land and disarm it within {seconds:.0f} s to write")
            told = True
        rest(_LOOK_S)


def write_plan(
    wanted: WritePlan,
    connection: Connection,
    latest: Latest,
    *,
    backup: Path,
    clock: Callable[[], float] = time.monotonic,
    unix_us: Callable[[], int] = lambda: time.time_ns() // 1000,
    on_event: Tell = ignore,
    stop: Callable[[], bool] = never,
) -> Outcome:
    """Write and verify, or put everything back; see magcomp.writing.writer.write."""
    link = WriteLink(connection, latest, unix_us)
    return write(wanted, link, backup=backup, clock=clock, on_event=on_event, stop=stop)


def read_backup(path: Path) -> tuple[ParameterSet, JournalState | None]:
    """Read a backup, and what its journal says of the write it was made for.

    Parameters
    ----------
    path
        The backup, or the journal beside it.

    Raises
    ------
    ParameterFileError
        The backup is missing or no parameter file, or the journal is none.
    """
    state = read_journal(path) if journal_path(path).exists() else None
    if path.suffix == ".journal":
        if state is None:
            raise ParameterFileError(f"{path} must be a journal; instead there is no such file")
        path = state.backup
    return read_parameter_file(path), state


def finish_restore(backup: Path) -> None:
    """Note in a backup's journal that everything was brought back."""
    mark_restored(backup.with_suffix(".param") if backup.suffix == ".journal" else backup)
