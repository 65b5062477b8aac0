"""``magcomp calibrate``: guide, record, fit, show the difference, and write it where asked."""

from __future__ import annotations

import math
import threading
from pathlib import Path

import click

from magcomp.analysis import Options
from magcomp.cli.linking import (
    ADDRESS_EPILOG,
    LinkOptions,
    StatusLine,
    Warnings,
    address_argument,
    link_options,
    positive_seconds,
    stop_on_interrupt,
)
from magcomp.cli.options import method_option, regressor_option
from magcomp.cli.wishes import Wishes, finish, record_option, recording_file, wish_options
from magcomp.errors import ExitCode, UsageError
from magcomp.link import Replay, parse_address
from magcomp.live.guide import pilot_is_done
from magcomp.live.session import LiveSession
from magcomp.live.situation import Manoeuvre
from magcomp.live.snapshot import LiveSnapshot
from magcomp.report import words

_LOOK_S = 0.25
_LEAST_CHANGE_S = 2.0


@click.command("calibrate", epilog=ADDRESS_EPILOG)
@address_argument
@click.option("--seconds", type=float, metavar="S", help="End after so long at the latest.")
@record_option
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
    if wishes.upload and isinstance(parse_address(address, baud=link.baud), Replay):
        raise UsageError(f"--upload must be given with a vehicle; instead received {address}")
    record_to = recording_file(record_to, address, wishes)
    with LiveSession.open(
        address,
        record=record_to,
        force=wishes.force,
        **link.reach,
        options=options,
    ) as session:
        session.manoeuvre = None if manoeuvre is None else Manoeuvre(manoeuvre)
        _collect(session, link.timeout, limit)
        return finish(session, options, record_to, wishes, link)


def _collect(session: LiveSession, timeout: float, limit: float) -> None:
    """Guide until there is enough, and take no more frames after that."""
    with stop_on_interrupt() as stop:
        status = StatusLine()
        status.show(f"Waiting for a heartbeat at {session.connection.address}")
        try:
            vehicle = session.connection.wait_vehicle(timeout)
        finally:
            status.clear()
        known = [compass.slot for compass in vehicle.compasses]
        status.say(
            f"Found {words.vehicle(vehicle)}" + (f", {words.compasses(known)}" if known else "")
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
        self._warnings = Warnings(status)
        self._was_armed = False
        self._disarmed_at: float | None = None
        self._shown_at = -math.inf

    def run(self) -> str:
        """Guide; gives why it ended, a sentence."""
        begun = self._session.elapsed_s
        while not self._stop.wait(_LOOK_S):
            shown = self._session.snapshot()
            if shown.ready:
                self._warnings.say(shown.warnings)
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
