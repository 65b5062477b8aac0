"""Options of ``magcomp fleet`` and ``magcomp fleet watch``: who works, and what is written."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar
from urllib.parse import quote

import click

from magcomp.cli.fleet_progress import progress
from magcomp.cli.output import complain
from magcomp.errors import OutputError, UsageError
from magcomp.fleet import as_html, as_table, cluster
from magcomp.fleet.answer import Fleet
from magcomp.fleet.local import Limits, run
from magcomp.fleet.pooled_parameters import write_all
from magcomp.fleet.run import Runner, lost
from magcomp.fleet.store import Store
from magcomp.fleet.task import carry_out
from magcomp.report.files import write_text

_Result = TypeVar("_Result")

_MEGABYTE = 1 << 20
_REPORTS = "reports"

results_option = click.option(
    "-o",
    "--output",
    "results",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("magcomp-fleet"),
    show_default=True,
    metavar="FOLDER",
    help="Where results are kept; what is there is not made again.",
)


@dataclass(frozen=True)
class Workers:
    """Who does the work.

    Attributes
    ----------
    limits
        Of local processes.
    scheduler
        Address of a Dask scheduler whose workers do it instead; None for local processes.
    """

    limits: Limits
    scheduler: str | None = None

    @contextmanager
    def runner(self) -> Iterator[Runner]:
        """Workers, until the block ends."""
        if self.scheduler is None:
            yield lambda tasks: run(tasks, carry_out, lost, self.limits)
            return
        with cluster.connected(self.scheduler) as client:
            watch = cluster.Watch(complain)
            yield lambda tasks: cluster.run(client, tasks, carry_out, lost, watch)


def worker_options(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """Give a command the options of `Workers`."""

    @click.option(
        "--workers",
        "count",
        type=click.IntRange(1, 1024),
        default=max(os.cpu_count() or 1, 1),
        show_default="one a processor",
        metavar="N",
        help="Processes at work at once.",
    )
    @click.option(
        "--memory",
        type=click.IntRange(0),
        default=2048,
        show_default=True,
        metavar="MB",
        help="Memory of a worker; 0 for no limit.",
    )
    @click.option(
        "--timeout",
        type=click.FloatRange(1.0),
        default=600.0,
        show_default=True,
        metavar="S",
        help="Time for one log; one that takes longer is left out.",
    )
    @click.option(
        "--scheduler",
        metavar="ADDRESS",
        help="Let the workers of a Dask cluster do it, such as tcp://10.0.0.5:8786.",
    )
    @functools.wraps(command)
    def with_workers(
        count: int, memory: int, timeout: float, scheduler: str | None, **others: object
    ) -> _Result:
        limits = Limits(count, seconds=timeout, memory=memory * _MEGABYTE)
        return command(workers=Workers(limits, scheduler), **others)

    return with_workers


@dataclass(frozen=True)
class Outputs:
    """What is written beside the answer.

    Attributes
    ----------
    table
        A row a compass a log.
    page
        The overview.
    parameters
        Folder for a parameter file an aircraft.
    reports
        Whether each log that is read gets a page of its own.
    force
        Whether files that are there may be replaced.
    """

    table: Path | None = None
    page: Path | None = None
    parameters: Path | None = None
    reports: bool = False
    force: bool = False

    def check(self) -> None:
        """Refuse what could not be written, before the work is done.

        Raises
        ------
        UsageError
            Where a suffix is none that is written.
        OutputError
            Where a file is there already, or its folder is not.
        """
        if self.table is not None:
            self._check(self.table, as_table.SUFFIXES)
        if self.page is not None:
            self._check(self.page, (".html",))
        if self.parameters is not None:
            _make(self.parameters)

    def _check(self, path: Path, suffixes: tuple[str, ...]) -> None:
        if path.suffix.lower() not in suffixes:
            raise UsageError(
                f"{path} must end in {' or '.join(suffixes)}; instead received "
                f"{path.suffix or 'no suffix'}"
            )
        if path.exists() and not self.force:
            raise OutputError(f"{path} must not exist yet; use --force to overwrite it")
        if not path.parent.is_dir():
            raise OutputError(f"{path.parent} must be a directory; instead there is none")

    def reports_in(self, results: Path) -> str:
        """The folder of the pages a log, made where it is missing; empty where none are wanted."""
        if not self.reports:
            return ""
        folder = (results / _REPORTS).resolve()
        _make(folder)
        return str(folder)

    def write(self, fleet: Fleet, store: Store, results: Path) -> None:
        """Write all that was asked for."""
        if self.table is not None:
            as_table.write_table(self.table, store.read(), force=self.force)
        if self.page is not None:
            page = as_html.html(fleet, _links(results / _REPORTS, self.page.parent))
            write_text(self.page, page, force=self.force)
        if self.parameters is not None:
            with progress("writing parameters", len(fleet.aircraft)) as step:
                for each in write_all(fleet.aircraft, self.parameters, force=self.force):
                    step(each)
                    if each.path is None:
                        complain(f"no parameters for {each.aircraft}: {each.why}")


def _links(reports: Path, beside: Path) -> Mapping[str, str]:
    """First characters of the digests of logs to the pages they have, as a page elsewhere says."""
    if not reports.is_dir():
        return {}
    # A page and its reports may be moved together.
    base = os.path.relpath(reports.resolve(), beside.resolve())
    return {each.stem: quote(f"{base}/{each.name}") for each in reports.glob("*.html")}


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder} must be a folder that can be written; instead received: {error.strerror}"
        ) from error


def output_options(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """Give a command the options of `Outputs`."""

    @click.option(
        "--table",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="FILE",
        help="Write a row a compass a log; the suffix chooses the form: "
        f"{', '.join(as_table.SUFFIXES)}.",
    )
    @click.option(
        "--html",
        "page",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="FILE",
        help="Write a page that leads with the aircraft that need attention.",
    )
    @click.option(
        "--param",
        "parameters",
        type=click.Path(path_type=Path, file_okay=False),
        metavar="FOLDER",
        help="Write a parameter file an aircraft: what its flights agree on.",
    )
    @click.option(
        "--reports", is_flag=True, help="Write a report of each log read now; --html links them."
    )
    @click.option("--force", is_flag=True, help="Overwrite files that are there.")
    @functools.wraps(command)
    def with_outputs(
        table: Path | None,
        page: Path | None,
        parameters: Path | None,
        reports: bool,
        force: bool,
        **others: object,
    ) -> _Result:
        return command(outputs=Outputs(table, page, parameters, reports, force), **others)

    return with_outputs
