"""``magcomp fleet``: every log of a fleet, read once, and put together by aircraft."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import click

from magcomp.cli.fleet_options import (
    Outputs,
    Workers,
    output_options,
    results_option,
    worker_options,
)
from magcomp.cli.options import json_option, verbose_option
from magcomp.cli.output import answer, look
from magcomp.errors import ExitCode, UsageError
from magcomp.fleet.aircraft import aircraft
from magcomp.fleet.answer import Fleet
from magcomp.fleet.as_json import fleet_object
from magcomp.fleet.flights import Flight, select
from magcomp.fleet.places import find
from magcomp.fleet.row import Log
from magcomp.fleet.run import Known, Runner, carry_out_all, known_of, to_do
from magcomp.fleet.store import Store
from magcomp.fleet.task import Outcome
from magcomp.report.as_json import dumps


@click.command("fleet")
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@results_option
@worker_options
@output_options
@click.option("--since", metavar="DATE", help="Only flights since this day, such as 2024-05-31.")
@click.option("--again", is_flag=True, help="Try once more the logs whose worker was lost.")
@json_option
@verbose_option
def fleet(
    paths: tuple[str, ...],
    results: Path,
    workers: Workers,
    outputs: Outputs,
    since: str | None,
    again: bool,
    to_json: bool,
    verbose: bool,
) -> ExitCode:
    """Fit every log at PATH..., and tell which aircraft need attention.

    A PATH is a log, a folder of logs of any kind, a pattern, or an address that fsspec opens. Each
    log is read once: results stay in FOLDER, and a run that was ended goes on where it was.
    """
    outputs.check()
    wanted = Wanted(results, moment_of(since), again)
    with workers.runner() as runner:
        found, store = carry_out_on(paths, wanted, runner)
    outputs.write(found, store)
    show(found, to_json=to_json, verbose=verbose)
    return ExitCode.GOOD


@dataclass(frozen=True)
class Wanted:
    """What is asked of a run.

    Attributes
    ----------
    results
        Their folder.
    since
        Unix time before which flights are left out.
    again
        Whether logs that were lost are tried once more.
    """

    results: Path
    since: float = -math.inf
    again: bool = False


def carry_out_on(paths: Iterable[str], wanted: Wanted, runner: Runner) -> tuple[Fleet, Store]:
    """Find logs, fit those that are new, and put all together."""
    logs = find(paths)
    if not logs:
        raise UsageError(f"{' '.join(paths)} must hold logs; instead there is none")
    # What was last written before cannot hold a flight since.
    logs = tuple(log for log in logs if not log.modified_s < wanted.since)
    store = Store(wanted.results)
    known = known_of(store)
    todo = to_do(logs, known, again=wanted.again)
    with _progress(len(todo)) as step:
        for outcome in carry_out_all(todo, known, store, runner, time.monotonic):
            step(outcome)
    store.gather()
    return put_together(store, logs, known, wanted.since, len(todo)), store


def put_together(
    store: Store, logs: tuple[Log, ...], known: Known, since: float, read: int
) -> Fleet:
    """The answer for some logs, from the store."""
    selected = select(store.read(Flight._fields), logs, known, since)
    return Fleet(aircraft(selected), selected, len(logs), read)


def show(found: Fleet, *, to_json: bool, verbose: bool) -> None:
    """Print the answer."""
    if to_json:
        answer(dumps(fleet_object(found)))
        return
    # Rich is only worth its import where an answer is for people.
    from magcomp.fleet.as_text import fleet_text  # noqa: PLC0415

    answer(fleet_text(found, look(), verbose=verbose))


def moment_of(day: str | None) -> float:
    """Unix time of a day or moment; minus infinity where there is none."""
    if day is None:
        return -math.inf
    try:
        moment = datetime.fromisoformat(day)
    except ValueError as error:
        raise UsageError(
            f"--since must be a day such as 2024-05-31; instead received {day}"
        ) from error
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


@contextmanager
def _progress(total: int) -> Iterator[Callable[[Outcome], None]]:
    """Show on stderr how far the run is and how long it will take, if stderr is a terminal."""
    if sys.stderr is None or not sys.stderr.isatty() or not total:
        yield lambda _outcome: None
        return
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    parts = (
        TextColumn("fitting logs"),
        BarColumn(bar_width=30),
        MofNCompleteColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
        TextColumn("left"),
    )
    with Progress(*parts, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda _outcome: bar.advance(task)
