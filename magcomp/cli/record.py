"""``magcomp record``: everything a vehicle says, into a .tlog."""

from __future__ import annotations

import math
from pathlib import Path

import click

from magcomp.cli.linking import (
    ADDRESS_EPILOG,
    LinkOptions,
    StatusLine,
    Warnings,
    address_argument,
    link_options,
    positive_seconds,
    replayed,
    stop_on_interrupt,
)
from magcomp.cli.options import check_output
from magcomp.cli.output import answer
from magcomp.errors import ExitCode
from magcomp.live.session import LiveSession
from magcomp.live.snapshot import LiveSnapshot

_LOOK_S = 0.25


@click.command("record", epilog=ADDRESS_EPILOG)
@address_argument
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE.tlog",
    help="The file to make.",
)
@click.option("--seconds", type=float, metavar="S", help="End after so long; else by Ctrl-C.")
@link_options
@click.option("--force", is_flag=True, help="Overwrite the file.")
def record(
    address: str, output: Path, seconds: float | None, link: LinkOptions, force: bool
) -> ExitCode:
    """Record everything the vehicle at ADDRESS says, for magcomp fit.

    The message rates a fit needs are asked for, and the old ones restored at the end. What has
    arrived is in the file at once.
    """
    limit = positive_seconds(seconds) or math.inf
    check_output(output, (".tlog",), replayed(address), force=force)
    status = StatusLine()
    warnings = Warnings(status)
    with (
        stop_on_interrupt() as stop,
        LiveSession.open(
            address,
            record=output,
            force=force,
            **link.reach,
            refit_share=0.0,
        ) as session,
    ):
        session.connection.wait_vehicle(link.timeout)
        begun, shown = session.elapsed_s, session.snapshot()
        while not stop.is_set() and session.elapsed_s - begun < limit and not shown.ended:
            shown = session.snapshot()
            if not shown.recording:
                break
            if shown.ready:
                warnings.say(shown.warnings)
            status.show(shown.link_text, _line(shown, session.elapsed_s - begun))
            stop.wait(_LOOK_S)
        status.clear()
        session.stop_recording()
        shown = session.snapshot()
    warnings.say(shown.warnings)
    answer(f"{output}: {summary(shown)}\n")
    if shown.recording_trouble:
        return ExitCode.USAGE
    return ExitCode.INTERRUPTED if stop.is_set() and seconds is not None else ExitCode.GOOD


def summary(shown: LiveSnapshot) -> str:
    """What was recorded, in a line."""
    link = shown.link
    total = link.frames + link.lost
    return (
        f"{shown.recording_bytes / 1000:.0f} kB, {link.frames} frames, "
        f"{100 * link.lost / max(total, 1):.1f} % lost on the way"
    )


def _line(shown: LiveSnapshot, seconds: float) -> str:
    rate = sum(shown.link.rates.values())
    return (
        f"{seconds:5.0f} s  {shown.recording_bytes / 1000:6.0f} kB  {rate:4.0f} messages/s  "
        f"{100 * shown.link.loss:.0f} % lost"
    )
