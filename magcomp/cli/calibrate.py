"""``magcomp calibrate``: guide, record, fit, show the difference, and write it where asked."""

from __future__ import annotations

import functools
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import click

from magcomp.analysis import Options, parameter_set
from magcomp.cli.linking import (
    LinkOptions,
    StatusLine,
    address_argument,
    any_vehicle_option,
    link_options,
    positive_seconds,
    replayed,
    stop_on_interrupt,
    yes_option,
)
from magcomp.cli.options import check_output, json_option, method_option, regressor_option
from magcomp.cli.output import answer, complain, look, progress
from magcomp.cli.writing import agreed, carry_out, need_consent, show_difference
from magcomp.errors import ExitCode, InputError, UsageError
from magcomp.link import Replay, parse_address
from magcomp.live.guide import pilot_is_done
from magcomp.live.session import LiveSession
from magcomp.live.situation import Manoeuvre
from magcomp.live.snapshot import LiveSnapshot
from magcomp.live.upload import DISARM_S, new_file
from magcomp.model import Analysis, Grade, ParameterSet, Recording
from magcomp.report import as_json
from magcomp.writing.files import SUFFIXES, write_parameter_file
from magcomp.writing.writer import restore_command

_Result = TypeVar("_Result")

_LOOK_S = 0.25
_LEAST_CHANGE_S = 2.0


@dataclass(frozen=True)
class Wishes:
    """What is to become of the answer.

    Attributes
    ----------
    output
        The parameter file, or None.
    upload, yes, any_vehicle, to_json, force
        The options of these names.
    wait
        Seconds a pilot has to disarm before the write.
    """

    output: Path | None
    upload: bool
    yes: bool
    any_vehicle: bool
    to_json: bool
    force: bool
    wait: float


def wish_options(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """Give a command the options of `Wishes` as one."""

    @click.option(
        "-o",
        "--output",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help=f"Write the parameters; the suffix chooses the form: {', '.join(SUFFIXES)}.",
    )
    @click.option("--upload", is_flag=True, help="Write them to the vehicle, once it is disarmed.")
    @yes_option
    @any_vehicle_option
    @click.option(
        "--wait",
        type=click.FloatRange(min=0.0),
        default=DISARM_S,
        show_default=True,
        metavar="S",
        help="How long to wait for the vehicle to be disarmed before it is written.",
    )
    @json_option
    @click.option("--force", is_flag=True, help="Overwrite files.")
    @functools.wraps(command)
    def with_wishes(
        output: Path | None,
        upload: bool,
        yes: bool,
        any_vehicle: bool,
        wait: float,
        to_json: bool,
        force: bool,
        **others: object,
    ) -> _Result:
        wishes = Wishes(output, upload, yes, any_vehicle, to_json, force, wait)
        return command(wishes=wishes, **others)

    return with_wishes


@click.command("calibrate")
@address_argument
@click.option("--seconds", type=float, metavar="S", help="End after so long at the latest.")
@click.option(
    "--record",
    "record_to",
    type=click.Path(path_type=Path),
    metavar="FILE.tlog",
    help="Where all that arrives is kept; by default in magcomp's data directory.",
)
@click.option(
    "--manoeuvre",
    type=click.Choice([each.value for each in Manoeuvre]),
    help="What is done: held on a stand, flown, or tied down; by default it is found out.",
)
@method_option
@regressor_option
@wish_options
@link_options
def calibrate(
    address: str,
    seconds: float | None,
    record_to: Path | None,
    manoeuvre: str | None,
    method: str,
    regressor: str,
    wishes: Wishes,
    link: LinkOptions,
) -> ExitCode:
    """Calibrate the vehicle at ADDRESS against its motors: fly it, or turn it on a stand.

    Says what to do next, records, and ends by itself when there is enough, when the vehicle is
    disarmed after its flight, or after --seconds; Ctrl-C ends it early and goes on to the fit.
    It never moves a motor. Nothing is written to the vehicle without --upload.
    """
    options = Options(method=method, regressor=regressor)
    limit = positive_seconds(seconds) or math.inf
    if wishes.upload:
        need_consent(yes=wishes.yes)
        if isinstance(parse_address(address, baud=link.baud), Replay):
            raise UsageError(f"--upload must be given with a vehicle; instead received {address}")
    record_to = record_to or new_file("recording", ".tlog", None, time.time())
    check_output(record_to, (".tlog",), replayed(address), force=wishes.force)
    if wishes.output is not None:
        check_output(wishes.output, SUFFIXES, record_to, force=wishes.force)
    with LiveSession.open(
        address,
        record=record_to,
        force=wishes.force,
        system=link.system,
        component=link.component,
        baud=link.baud,
        signing_key=link.key,
        source_system=link.source_system,
        options=options,
    ) as session:
        session.manoeuvre = None if manoeuvre is None else Manoeuvre(manoeuvre)
        _collect(session, link.timeout, limit)
        recording, analysis = _fit(session, options, record_to)
        chosen = parameter_set(analysis)
        _show(recording, analysis, chosen, wishes)
        if analysis.grade is Grade.REJECTED:
            complain("Nothing is written because no compass has a fit to be trusted")
            return ExitCode.REJECTED
        return _upload(session, chosen, wishes) if wishes.upload else ExitCode.GOOD


def _collect(session: LiveSession, timeout: float, limit: float) -> None:
    """Guide until there is enough, and take no more frames after that."""
    with stop_on_interrupt() as stop:
        status = StatusLine()
        status.show(f"Waiting for a heartbeat at {session.connection.address}")
        try:
            vehicle = session.connection.wait_vehicle(timeout)
        finally:
            status.clear()
        compasses = len(vehicle.device_ids)
        status.say(
            f"Found {vehicle.autopilot} {vehicle.kind} {vehicle.firmware}, system "
            f"{vehicle.system}, {compasses} compass{'es' if compasses != 1 else ''}"
        )
        why = _Guide(session, status, stop, limit).run()
        session.stop_recording()
        status.say(why)


class _Guide:
    """Shows what to do next until there is enough."""

    def __init__(
        self, session: LiveSession, status: StatusLine, stop: threading.Event, limit: float
    ) -> None:
        self._session = session
        self._status = status
        self._stop = stop
        self._limit = limit
        self._warned: set[str] = set()
        self._was_armed = False
        self._disarmed_at: float | None = None
        self._shown_at = -math.inf

    def run(self) -> str:
        """Guide; gives why it ended, a sentence."""
        begun = self._session.elapsed_s
        while not self._stop.wait(_LOOK_S):
            shown = self._session.snapshot()
            self._warn(shown)
            self._show(shown)
            if shown.guidance.enough:
                return f"Enough after {shown.elapsed_s - begun:.0f} s: the answer no longer changes"
            if shown.ended:
                return "The replayed log is over"
            if shown.elapsed_s - begun >= self._limit:
                return f"Ended after {self._limit:g} s"
            if self._pilot_is_done(shown):
                return f"Ended after {shown.elapsed_s - begun:.0f} s: the vehicle is disarmed"
        return f"Interrupted after {self._session.elapsed_s - begun:.0f} s: going on to the fit"

    def _warn(self, shown: LiveSnapshot) -> None:
        for warning in shown.warnings:
            if shown.ready and warning not in self._warned:
                self._warned.add(warning)
                self._status.say(warning)

    def _show(self, shown: LiveSnapshot) -> None:
        # A line a change is only bearable where changes are rare.
        rests = shown.elapsed_s - self._shown_at < _LEAST_CHANGE_S
        if rests and not self._status.is_terminal:
            return
        self._shown_at = shown.elapsed_s
        self._status.show(shown.guidance.text if shown.connected else shown.link_text, _line(shown))

    def _pilot_is_done(self, shown: LiveSnapshot) -> bool:
        self._was_armed = self._was_armed or bool(shown.armed)
        if shown.armed is not False or not self._was_armed:
            self._disarmed_at = None
            return False
        if self._disarmed_at is None:
            self._disarmed_at = shown.elapsed_s
        disarmed_s = shown.elapsed_s - self._disarmed_at
        return pilot_is_done(shown.situation, disarmed_s, len(shown.levels_done))


def _line(shown: LiveSnapshot) -> str:
    """Numbers that change all the time."""
    parts = [f"{shown.elapsed_s:4.0f} s", f"{100 * shown.guidance.share_done:3.0f} %"]
    if shown.throttle is not None:
        parts.append(f"thr {100 * shown.throttle:3.0f} %")
    if shown.current is not None:
        parts.append(f"{shown.current:5.1f} A")
    if shown.link.loss >= 0.01:
        parts.append(f"loss {100 * shown.link.loss:.0f} %")
    parts.append(str(shown.grade) if shown.grade else "no fit yet")
    return " | ".join(parts)


def _fit(session: LiveSession, options: Options, record_to: Path) -> tuple[Recording, Analysis]:
    """Fit what was recorded; where that fails, say where the recording is."""
    try:
        with progress() as step:
            recording = session.recording()
            analysis = session.analyse(options, lambda what, share: step(f"fitting {what}", share))
    except InputError:
        complain(f"The recording is kept: {record_to}")
        raise
    complain(f"Recording: {record_to}")
    return recording, analysis


def _show(recording: Recording, analysis: Analysis, chosen: ParameterSet, wishes: Wishes) -> None:
    written = None
    if wishes.output is not None and analysis.grade is not Grade.REJECTED:
        write_parameter_file(wishes.output, chosen, force=wishes.force)
        written = str(wishes.output)
    if wishes.to_json:
        answer(as_json.dumps(as_json.analysis_object(analysis, written)))
        return
    # Rich is only worth its import where an answer is for people.
    from magcomp.report import as_text  # noqa: PLC0415

    # Before an upload the difference to the vehicle itself is shown.
    shown = {} if wishes.upload else chosen.values
    present = recording.parameters.latest
    answer(as_text.analysis_text(analysis, shown, present, look(), advise=False))
    if written is not None:
        complain(f"Written to {written}")


def _upload(session: LiveSession, chosen: ParameterSet, wishes: Wishes) -> ExitCode:
    """Show the difference, ask, wait for the motors to stand still, write."""
    plan = session.upload_plan(chosen, wishes.any_vehicle)
    show_difference(plan, to_stderr=wishes.to_json)
    if not plan.changes:
        complain("The vehicle holds all of this already; nothing is written")
        return ExitCode.GOOD
    session.wait_disarmed(wishes.wait, tell=complain)
    if not agreed(len(plan.changes), yes=wishes.yes):
        complain("Nothing is written")
        return ExitCode.INTERRUPTED
    address = str(session.connection.address)
    backup = new_file("backup", ".param", plan.vehicle, time.time())
    with stop_on_interrupt() as stop:
        code = carry_out(
            plan,
            lambda tell, stopped: session.upload(plan, backup, tell, stopped),
            backup,
            address,
            stop,
        )
    if code is ExitCode.GOOD:
        complain(f"To undo this:\n  {restore_command(backup, address)}")
    return code
