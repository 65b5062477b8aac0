"""Everything the screens need from outside, in one place that a test can replace."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Protocol, TypeVar

from magcomp.analysis import Options, analyse, check
from magcomp.errors import LinkError, MagcompError, UsageError
from magcomp.link import Connection, SerialPort, serial_ports
from magcomp.link.clock import Clock
from magcomp.live.latest import Latest
from magcomp.live.situation import Manoeuvre
from magcomp.live.snapshot import LiveSnapshot
from magcomp.live.sweep import Bench, make_ready, sweep
from magcomp.live.upload import new_file
from magcomp.model import Analysis, ParameterSet, Recording, Vehicle, Verdict
from magcomp.report.evidence import compass_plots
from magcomp.report.files import report_text, write_text
from magcomp.sources import read
from magcomp.sweeping.events import Event as SweepEvent
from magcomp.sweeping.events import Outcome as SweepOutcome
from magcomp.sweeping.events import Reason
from magcomp.tui.pictures import CompassPicture, picture
from magcomp.writing.events import Event, Outcome
from magcomp.writing.journal import journal_path
from magcomp.writing.plan import WritePlan

Progress = Callable[[str, float], None]
"""What is being done, and the share done, 0 … 1."""

_Result = TypeVar("_Result")

Pressed = Callable[[], Reason | None]
"""Whether somebody wants a sweep to stop, and why."""

SweepTold = Callable[[SweepEvent], None]
"""Told what happens in a sweep."""

_SERVE_S = 10.0


class Session(Protocol):
    """What the screens need of a live vehicle; `LiveSession` has it.

    Attributes
    ----------
    manoeuvre
        What the user says that is being done, None to find out; may be set at any time.
    """

    manoeuvre: Manoeuvre | None

    def snapshot(self) -> LiveSnapshot:
        """Everything a screen shows, now; cheap."""
        ...

    def recording(self) -> Recording:
        """All that has been received so far."""
        ...

    def upload_plan(self, wanted: ParameterSet) -> WritePlan:
        """Read the vehicle's calibration and compare."""
        ...

    def upload(
        self,
        plan: WritePlan,
        backup_path: Path,
        on_event: Callable[[Event], None],
        stop: Callable[[], bool],
    ) -> Outcome:
        """Write and verify, or put everything back."""
        ...

    def what_acts(self, plan: WritePlan) -> str:
        """Whether what was written is in force, a sentence; empty where nothing shows it."""
        ...

    def restore_plan(self, backup: Path) -> WritePlan:
        """Compare the vehicle with a backup."""
        ...

    def restore(
        self,
        backup: Path,
        plan: WritePlan,
        backup_path: Path,
        on_event: Callable[[Event], None],
        stop: Callable[[], bool],
    ) -> Outcome:
        """Write what `restore_plan` made."""
        ...

    def alone(self, work: Callable[[Connection, Vehicle, Latest, Clock], _Result]) -> _Result:
        """Let somebody speak with the vehicle while nobody else does."""
        ...

    def close(self) -> None:
        """Give link and file back."""
        ...


@dataclass(frozen=True, eq=False)
class Simulation:
    """A simulated vehicle that is running.

    Attributes
    ----------
    address
        How to reach it.
    stop
        Ends it.
    fly_again
        Makes it do once more what it did.
    """

    address: str
    stop: Callable[[], None]
    fly_again: Callable[[], None] = lambda: None


def open_live(
    address: str, record: Path, system: int | None, component: int | None = None
) -> Session:
    """Open a vehicle's address and record what comes; see `LiveSession.open`."""
    # The first screen must not wait for what only a vehicle needs.
    from magcomp.live.session import LiveSession  # noqa: PLC0415

    return LiveSession.open(address, record=record, system=system, component=component)


def simulate(autopilot: str) -> Simulation:
    """Start a simulated vehicle on this computer.

    Parameters
    ----------
    autopilot
        Whose firmware it has, as in ``Vehicle.autopilot``.

    Raises
    ------
    LinkError
        It could not be started.
    """
    # The first screen must not wait for a simulation that few ask for.
    from magcomp.simulate import Vehicle, scenario, serve  # noqa: PLC0415

    stop = threading.Event()
    ready: queue.Queue[str | Exception] = queue.Queue()

    vehicle = Vehicle(scenario("flight", seed=7), wait_for_ground=True, autopilot=autopilot)

    def live() -> None:
        try:
            serve("udp:127.0.0.1:0", vehicle, announce=ready.put, stop=stop)
        except MagcompError as error:
            ready.put(error)

    thread = threading.Thread(target=live, name="magcomp-simulated", daemon=True)
    thread.start()
    try:
        answer = ready.get(timeout=_SERVE_S)
    except queue.Empty as error:
        raise LinkError("The simulated vehicle must start; instead nothing happened") from error
    if isinstance(answer, Exception):
        raise answer

    def end() -> None:
        stop.set()
        thread.join()

    return Simulation(answer, end, vehicle.fly_again)


def _now() -> datetime:
    return datetime.now().astimezone()


def read_log(path: Path, system: int | None, component: int | None = None) -> Recording:
    """Read a log; see :func:`magcomp.sources.read`."""
    return read(path, system=system, component=component)


@dataclass(frozen=True)
class Services:
    """What the app calls, off its own thread.

    Attributes
    ----------
    ports
        The serial ports and what is plugged in.
    read
        A log's recording; of one MAVLink system where several are in it.
    open_live
        A session with the vehicle at an address, that records into a file.
    simulate
        Starts a simulated vehicle of an autopilot.
    make_ready, sweep
        Look whether a vehicle's motors can be spun on the ground, and spin them.
    now
        The time, for names of files.
    folder
        Where recordings and backups go; None for the platform's place.
    """

    ports: Callable[[], Sequence[SerialPort]] = serial_ports
    read: Callable[[Path, int | None], Recording] = read_log
    open_live: Callable[[str, Path, int | None], Session] = open_live
    simulate: Callable[[str], Simulation] = simulate
    make_ready: Callable[[Session, int | None, float], Bench] = make_ready
    sweep: Callable[[Session, Bench, str, Pressed, SweepTold], SweepOutcome] = sweep
    now: Callable[[], datetime] = _now
    folder: Path | None = field(default=None)

    def new_file(self, kind: str, suffix: str, vehicle: Vehicle | None) -> Path:
        """A file that does not exist yet, named after vehicle and time.

        Raises
        ------
        OutputError
            No file can be made there.
        """
        path = new_file(kind, suffix, vehicle, self.now().timestamp())
        if self.folder is None:
            return path
        name, number = path.stem, 2
        path = self.folder / path.name
        while path.exists() or journal_path(path).exists():
            path = self.folder / f"{name}-{number}{suffix}"
            number += 1
        return path


def save_report(
    path: Path,
    recording: Recording | None,
    analysis: Analysis | None,
    options: Options,
    *,
    force: bool,
) -> None:
    """Write a report; see :func:`magcomp.report.files.report_text`.

    Raises
    ------
    OutputError, UsageError
        It cannot be written there, or in that form.
    """
    if recording is None or analysis is None:
        raise UsageError("There must be a fit to report; instead nothing is fitted")
    text = report_text(path.suffix, recording, analysis, options=options)
    write_text(path, text, force=force)


def judge_present(recording: Recording) -> Mapping[int, Verdict]:
    """The judge's word on the calibration in force; nothing where a recording lacks something.

    A recording that cannot be judged can still be shown, and the fit will say what is missing.
    """
    try:
        return check(recording)
    except MagcompError:
        return {}


def judge_since(recording: Recording, start_s: float) -> Mapping[int, Verdict]:
    """The judge's word on the calibration in force since some second of a recording."""
    try:
        return check(recording, Options(start=start_s))
    except MagcompError:
        return {}


def fit(
    recording: Recording, options: Options, progress: Progress
) -> tuple[Analysis, Mapping[int, CompassPicture]]:
    """Fit a recording and make its pictures.

    Raises
    ------
    MagcompError
        As :func:`magcomp.analysis.analyse`.
    """
    analysis = analyse(recording, options, progress)
    pictures = {}
    for result in analysis.compasses:
        progress(f"drawing compass {result.fit.compass}", 1.0)
        plots = compass_plots(recording, result, start=options.start, end=options.end)
        pictures[result.fit.compass] = picture(result, plots)
    return analysis, pictures
