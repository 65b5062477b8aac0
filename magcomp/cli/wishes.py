"""The road of a live command from its recording on: fit, show, write to a file or the vehicle."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import click

from magcomp.analysis import Options, parameter_set
from magcomp.cli.linking import (
    LinkOptions,
    any_vehicle_option,
    replayed,
    stop_on_interrupt,
    yes_option,
)
from magcomp.cli.options import check_output, json_option
from magcomp.cli.output import answer, complain, look, progress
from magcomp.cli.writing import agreed, carry_out, need_consent, say_what_acts, show_difference
from magcomp.errors import ExitCode, MagcompError
from magcomp.live.session import LiveSession
from magcomp.live.upload import DISARM_S, new_file
from magcomp.model import Analysis, Grade, ParameterSet, Recording
from magcomp.report import as_json
from magcomp.writing.files import SUFFIXES, write_parameter_file
from magcomp.writing.writer import restore_command

_Result = TypeVar("_Result")

record_option = click.option(
    "--record",
    "record_to",
    type=click.Path(path_type=Path),
    metavar="FILE.tlog",
    help="Where all that arrives is kept; by default in magcomp's data directory.",
)


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


def recording_file(record_to: Path | None, address: str, wishes: Wishes) -> Path:
    """Where to record; everything that the wishes need is checked before anything is done.

    Raises
    ------
    UsageError
        There is nobody to ask before a write.
    OutputError
        A file cannot be made, or would be overwritten.
    """
    if wishes.upload:
        need_consent(yes=wishes.yes)
    chosen = record_to or new_file("recording", ".tlog", None, time.time())
    check_output(chosen, (".tlog",), replayed(address), force=wishes.force)
    if wishes.output is not None:
        check_output(wishes.output, SUFFIXES, chosen, force=wishes.force)
    return chosen


def finish(
    session: LiveSession,
    options: Options,
    record_to: Path,
    wishes: Wishes,
    link: LinkOptions,
) -> ExitCode:
    """Fit what was recorded, show the answer, and write it where asked."""
    recording, analysis = _fit(session, options, record_to)
    chosen = parameter_set(analysis)
    _show(recording, analysis, chosen, wishes)
    if analysis.grade is Grade.REJECTED:
        complain("Nothing is written because no compass has a fit to be trusted")
        return ExitCode.REJECTED
    return _upload(session, chosen, wishes, link) if wishes.upload else ExitCode.GOOD


def _fit(session: LiveSession, options: Options, record_to: Path) -> tuple[Recording, Analysis]:
    """Fit what was recorded; where that fails, say where the recording is."""
    try:
        with progress() as step:
            recording = session.recording()
            analysis = session.analyse(options, lambda what, share: step(f"fitting {what}", share))
    except MagcompError:
        complain(f"The recording is kept:\n  {record_to}")
        raise
    complain(f"Recording:\n  {record_to}")
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
        complain(f"Written to:\n  {written}")


def _upload(
    session: LiveSession, chosen: ParameterSet, wishes: Wishes, link: LinkOptions
) -> ExitCode:
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
    reach = (str(session.connection.address), *link.options)
    backup = new_file("backup", ".param", plan.vehicle, time.time())
    with stop_on_interrupt() as stop:
        code = carry_out(
            plan,
            lambda tell, stopped: session.upload(plan, backup, tell, stopped),
            backup,
            reach,
            stop,
        )
    if code is ExitCode.GOOD:
        say_what_acts(plan, session.connection)
        complain(f"To undo this:\n  {restore_command(backup, *reach)}")
    return code
