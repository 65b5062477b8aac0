"""``magcomp sweep``: spin the motors on the ground, step by step, then fit, show and write."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path

import click

from magcomp.analysis import Options
from magcomp.cli.keys import Pressed, any_key, require_terminal
from magcomp.cli.linking import (
    ADDRESS_EPILOG,
    LinkOptions,
    StatusLine,
    address_argument,
    link_options,
    stop_on_interrupt,
)
from magcomp.cli.output import complain
from magcomp.cli.wishes import Wishes, finish, record_option, recording_file, wish_options
from magcomp.errors import ExitCode, UsageError
from magcomp.link import Replay, parse_address
from magcomp.live.session import LiveSession
from magcomp.live.sweep import RATES, Bench, make_ready, raise_for_failure
from magcomp.live.sweep import sweep as carry_out_sweep
from magcomp.model import CURRENT, MOTORS
from magcomp.report import words
from magcomp.sweeping.events import Begun, Event, Outcome, Reason, Stopping, Told
from magcomp.sweeping.steps import LEAST_MOST, MOST_MOST, MOST_MOTORS

_DEFAULT_MOST = 50.0


@click.command("sweep", epilog=ADDRESS_EPILOG)
@address_argument
@click.option(
    "--most",
    type=click.FloatRange(100 * LEAST_MOST, 100 * MOST_MOST),
    default=_DEFAULT_MOST,
    show_default=True,
    metavar="PERCENT",
    help="Strongest step, of the motor outputs' range.",
)
@click.option(
    "--motors",
    type=click.IntRange(1, MOST_MOTORS),
    metavar="N",
    help="How many motors there are; else by the vehicle's parameters.",
)
@click.option(
    "--regressor",
    type=click.Choice((CURRENT, MOTORS)),
    default=CURRENT,
    show_default=True,
    help="Fit one vector to the whole current, or one to each motor's.",
)
@record_option
@wish_options
@link_options
def sweep(
    address: str,
    most: float,
    motors: int | None,
    regressor: str,
    record_to: Path | None,
    wishes: Wishes,
    link: LinkOptions,
) -> ExitCode:
    """Spin the motors of the vehicle at ADDRESS on the ground, each alone and all together.

    THE MOTORS SPIN: take the propellers off, or hold the vehicle down. It begins when the vehicle's
    name is typed. Any key and Ctrl-C stop at once, and so do a lost link, an armed, tilted or moved
    vehicle; where nothing arrives any more, the autopilot itself stops the motors after a second.
    Then what was recorded is fitted. Nothing is written without --upload.
    """
    require_terminal("magcomp sweep")
    if isinstance(parse_address(address, baud=link.baud), Replay):
        raise UsageError(f"A sweep must be given a vehicle's address; instead received {address}")
    record_to = recording_file(record_to, address, wishes)
    with LiveSession.open(
        address,
        record=record_to,
        force=wishes.force,
        **link.reach,
        rates=RATES,
        refit_share=0.0,
    ) as session:
        status = StatusLine()
        status.show(f"Waiting for a heartbeat at {session.connection.address}")
        try:
            vehicle = session.wait_ready(link.timeout)
            bench = make_ready(session, motors, most / 100.0)
            bench = replace(bench, apart=regressor == MOTORS)
        finally:
            status.clear()
        complain(f"Found {words.vehicle(vehicle)}, {bench.motors} motors")
        typed = _ask(bench)
        # Before this the vehicle may have been carried to where it stands.
        begun = session.recording().duration_s
        outcome = _spin(session, bench, typed, status)
        session.stop_recording()
        if outcome.reason is not None:
            complain(f"Recording:\n  {record_to}")
            raise_for_failure(outcome)
            return ExitCode.INTERRUPTED
        options = Options(method="sweep", regressor=regressor, start=begun)
        return finish(session, options, record_to, wishes, link)


def _ask(bench: Bench) -> str:
    """Ask for the vehicle's name.

    Raises
    ------
    UsageError
        Something else was typed.
    """
    complain(
        f"Its motors will spin, each alone and all together, first at "
        f"{bench.gentle:.0%}, then at {bench.most:.0%} of their range, for about two minutes"
    )
    complain("Take the propellers off, or hold the vehicle down so that it cannot move or tilt")
    complain("Any key stops at once")
    typed = str(
        click.prompt(f"Type {bench.name} to begin", err=True, default="", show_default=False)
    )
    if not bench.is_name(typed):
        raise UsageError(
            f"What is typed must be {bench.name}; instead received {typed!r}, and no motor spins"
        )
    return typed


def _spin(session: LiveSession, bench: Bench, typed: str, status: StatusLine) -> Outcome:
    def tell(event: Event) -> None:
        match event:
            case Begun(step=step, number=number):
                status.show(f"Step {number}: {words.sweep_step(step)}", "any key stops")
            case Told(measured=measured):
                status.say(f"{words.sweep_step(measured.step)}: {measured.current:.1f} A")
            case Stopping(why=why):
                status.say(f"Stopping because {why}")
            case Outcome(done=done):
                status.say(
                    f"All motors were told to stand still after {words.counted(len(done), 'step')}"
                )

    with stop_on_interrupt() as stop, any_key() as pressed:
        return carry_out_sweep(session, bench, typed, lambda: _wish(stop, pressed), tell)


def _wish(stop: threading.Event, pressed: Pressed) -> Reason | None:
    if stop.is_set():
        return Reason.INTERRUPTED
    return Reason.KEY if pressed() else None
