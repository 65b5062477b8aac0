"""``magcomp fleet``: every log of a fleet, read once, and put together by aircraft."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path

import click

from magcomp.cli.fleet_options import (
    Outputs,
    Workers,
    output_options,
    results_option,
    worker_options,
)
from magcomp.cli.fleet_progress import progress
from magcomp.cli.options import json_option, verbose_option
from magcomp.cli.output import answer, look
from magcomp.errors import ExitCode, UsageError
from magcomp.fleet.aircraft import aircraft
from magcomp.fleet.answer import Fleet
from magcomp.fleet.as_json import fleet_object
from magcomp.fleet.flights import NEEDED, select
from magcomp.fleet.places import find
from magcomp.fleet.row import Log, Row, State
from magcomp.fleet.run import Known, Runner, carry_out_all, known_of, to_do
from magcomp.fleet.store import Store
from magcomp.fleet.task import Outcome
from magcomp.fleet.watch import arrivals
from magcomp.report import words
from magcomp.report.as_json import dumps


class _PathsOrCommand(click.Group):
    """A group whose first word may be a PATH, which is for ``run``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        first = args[0] if args else "--help"
        if first not in self.commands:
            args = ["run", *args] if args else ["run", "--help"]
        return super().parse_args(ctx, args)


@click.group(cls=_PathsOrCommand)
def fleet() -> None:
    """Fit a fleet's logs, and tell which aircraft need attention."""


@fleet.command()
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@results_option
@worker_options
@output_options
@click.option("--since", metavar="DATE", help="Only flights since this day, such as 2024-05-31.")
@click.option("--again", is_flag=True, help="Try once more the logs whose worker was lost.")
@json_option
@verbose_option
def run(
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
    log is read once: results stay in FOLDER, and a run that was ended goes on where it was. The
    word run may be left out; magcomp fleet watch FOLDER fits logs as they arrive.
    """
    outputs.check()
    wanted = Wanted(results, moment_of(since), again, outputs.reports_in(results))
    with workers.runner() as runner:
        found, store = carry_out_on(paths, wanted, runner)
    outputs.write(found, store, results)
    show(found, to_json=to_json, verbose=verbose)
    return ExitCode.GOOD


@fleet.command()
@click.argument("paths", nargs=-1, required=True, metavar="FOLDER...")
@results_option
@worker_options
@output_options
@click.option(
    "--every",
    type=click.FloatRange(0.1),
    default=10.0,
    show_default=True,
    metavar="S",
    help="Look this often; a log counts as whole when it did not change between two looks.",
)
@click.option("--looks", type=click.IntRange(1), metavar="N", help="End after this many looks.")
@json_option
def watch(
    paths: tuple[str, ...],
    results: Path,
    workers: Workers,
    outputs: Outputs,
    every: float,
    looks: int | None,
    to_json: bool,
) -> ExitCode:
    """Fit logs as they arrive in FOLDER..., until Ctrl-C, a line for each compass.

    With --json, a line is an object. Files such as --html are written anew whenever a log came.
    """
    outputs.check()
    store = Store(results)
    reports = outputs.reports_in(results)
    again = replace(outputs, force=True)
    with workers.runner() as runner:
        new = arrivals(lambda: find(paths), lambda: time.sleep(every))
        for whole in islice(new, looks):
            known = known_of(store)
            todo = to_do(whole, known)
            for outcome in carry_out_all(todo, known, store, runner, time.monotonic, reports):
                answer(arrived(outcome, to_json=to_json))
            if todo:
                logs = find(paths)
                store.gather()
                again.write(put_together(store, logs, known, -math.inf, 0), store, results)
    return ExitCode.GOOD


def arrived(outcome: Outcome, *, to_json: bool) -> str:
    """What is printed of a log that came: a line a compass."""
    if to_json:
        wanted = ("path", "digest", "state", "why", "uid", "compass", "verdict", "before_deg",
                  "bound_deg")  # fmt: skip
        documents = ({name: getattr(row, name) for name in wanted} for row in outcome.rows)
        return "".join(f"{json.dumps(json.loads(dumps(each)))}\n" for each in documents)
    return "".join(f"{words.printable(_in_a_line(row))}\n" for row in outcome.rows)


def _in_a_line(row: Row) -> str:
    if row.state != State.FITTED:
        return f"{row.path}: {row.state}{': ' if row.why else ''}{row.why}"
    return (
        f"{row.path}: compass {row.compass}: {row.verdict}; heading wrong by up to "
        f"{row.before_deg:.1f}° now, at most {row.bound_deg:.1f}° with the fit"
    )


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
    reports
        Folder of a page a log; empty where none are wanted.
    """

    results: Path
    since: float = -math.inf
    again: bool = False
    reports: str = ""


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
    with progress("fitting logs", len(todo)) as step:
        for outcome in carry_out_all(todo, known, store, runner, time.monotonic, wanted.reports):
            step(outcome)
    store.gather()
    return put_together(store, logs, known, wanted.since, len(todo)), store


def put_together(
    store: Store, logs: tuple[Log, ...], known: Known, since: float, read: int
) -> Fleet:
    """The answer for some logs, from the store."""
    selected = select(store.read(NEEDED), logs, known, since)
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
