"""Showing a difference, asking, writing, and saying what stands."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from magcomp.cli.linking import StatusLine
from magcomp.cli.output import answer, complain, look
from magcomp.errors import ExitCode, LinkError, LinkTimeoutError, MagcompError, UsageError
from magcomp.link import Connection
from magcomp.report import words
from magcomp.writing.events import (
    Event,
    Mismatch,
    Outcome,
    Progress,
    Reason,
    Restarted,
    RollingBack,
    Stage,
)
from magcomp.writing.files import format_value
from magcomp.writing.holding import holding
from magcomp.writing.in_force import in_force_sentence
from magcomp.writing.plan import WritePlan
from magcomp.writing.writer import raise_for_failure

if TYPE_CHECKING:
    from rich.console import RenderableType

_FEW = 5

_STAGES = {
    Stage.COMPARE: "comparing with the backup",
    Stage.SETTLE: "waiting for the link to settle",
    Stage.IDENTIFY: "identifying the vehicle again",
    Stage.OFF: "switching the motor compensation off",
    Stage.WRITE: "writing",
    Stage.VERIFY: "reading back",
    Stage.ON: "switching the motor compensation on",
    Stage.CONFIRM: "confirming",
    Stage.OVER: "done",
}

Write = Callable[[Callable[[Event], None], Callable[[], bool]], Outcome]
"""Does the writing, given who is told and who is asked whether to stop."""


def need_consent(*, yes: bool, dry_run: bool = False) -> None:
    """Refuse early to write where nobody can be asked.

    Raises
    ------
    UsageError
        There is no terminal and --yes is not given.
    """
    if not yes and not dry_run and not (sys.stdin is not None and sys.stdin.isatty()):
        raise UsageError("--yes must be given to write where there is no terminal to ask at")


def show_difference(plan: WritePlan, *, to_stderr: bool = False, everything: bool = False) -> None:
    """Print old → new of every parameter that changes, and what the pilot must know."""
    from rich.text import Text  # noqa: PLC0415

    from magcomp.report import as_text, tables  # noqa: PLC0415 - rich only for people

    changes = {change.name: change.new for change in plan.changes}
    parts: list[RenderableType] = [Text(f" {words.vehicle(plan.vehicle)}", style="bold")]
    if changes:
        parts.append(tables.parameters(changes, plan.old, verbose=True)[0])
    text = as_text.render(parts, look())
    if to_stderr:
        click.echo(text, err=True, nl=False)
    else:
        answer(text)
    if plan.left_out:
        complain(left_out(plan.left_out, everything=everything))
    for warning in plan.warnings:
        complain(warning)


def left_out(names: Sequence[str], *, everything: bool) -> str:
    """Say what of a file is not written, and why."""
    few = ", ".join(names[:_FEW])
    more = f" and {len(names) - _FEW} more" if len(names) > _FEW else ""
    one = len(names) == 1
    if everything:
        why = f"{'is' if one else 'are'} unknown to the vehicle, or kept by it"
    else:
        why = f"{'is' if one else 'are'} no compass calibration"
    hint = "" if everything else "; --all writes the rest too"
    return f"{few}{more} {why}, and {'is' if one else 'are'} left out{hint}"


def say_what_is_held(plan: WritePlan, *, after: bool) -> None:
    """Say in a line what the vehicle holds, before or after a write."""
    values = {**plan.old, **plan.new, **plan.switches} if after else plan.old
    complain(f"The vehicle holds: {holding(plan.vehicle, values)}")


def say_what_acts(plan: WritePlan, connection: Connection) -> None:
    """Say whether what was written is in force, as far as the vehicle shows it."""
    try:
        sentence = in_force_sentence(connection, plan, time.monotonic, connection.requested_rates)
    except (LinkError, LinkTimeoutError) as error:
        complain(f"What is in force could not be looked at: {error}")
        return
    if sentence:
        complain(f"{sentence[:1].upper()}{sentence[1:]}")


def agreed(count: int, *, yes: bool) -> bool:
    """Ask for consent, where it was not given beforehand."""
    if yes:
        return True
    return click.confirm(f"Write {words.counted(count, 'parameter')} to the vehicle?", err=True)


def carry_out(
    plan: WritePlan,
    write: Write,
    backup: Path,
    reach: tuple[str, ...],
    stop: threading.Event,
    status: StatusLine | None = None,
) -> ExitCode:
    """Write with progress, and say how it ended.

    Parameters
    ----------
    reach
        The vehicle's address, and the options by which it was reached.
    status
        Where progress is shown; the terminal's own line unless given.

    Raises
    ------
    MagcompError
        What ``raise_for_failure`` makes of a bad outcome, other than an interruption.
    """
    status = StatusLine() if status is None else status
    complain(f"Backup:\n  {backup}")

    def tell(event: Event) -> None:
        match event:
            case Progress(stage=stage, done=done, total=total):
                status.show(_STAGES[stage], f"{done:3d}/{total:<3d}")
            case Mismatch(name=name, wanted=wanted, received=received):
                status.say(
                    f"{name} must become {format_value(wanted)}; instead the vehicle keeps "
                    f"{format_value(received)}"
                )
            case Restarted(why=why):
                status.say(f"Everything is verified anew because {why}")
            case RollingBack(why=why):
                status.say(f"Rolling back because {why}")
            case _:
                pass

    outcome = write(tell, stop.is_set)
    status.clear()
    if outcome.reason is Reason.STOPPED:
        complain_of(outcome, backup, reach)
        return ExitCode.INTERRUPTED
    raise_for_failure(outcome, backup, *reach)
    complain(f"Written and read back: {words.counted(len(plan.changes), 'parameter')}")
    say_what_is_held(plan, after=True)
    return ExitCode.GOOD


def complain_of(outcome: Outcome, backup: Path, reach: tuple[str, ...]) -> None:
    """Say what stands after an interruption."""
    try:
        raise_for_failure(outcome, backup, *reach)
    except MagcompError as error:
        complain(str(error))
