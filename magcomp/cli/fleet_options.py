"""Options of ``magcomp fleet`` and ``magcomp fleet watch``: who works, and what is written."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import click

from magcomp.errors import OutputError, UsageError
from magcomp.fleet import as_table
from magcomp.fleet.answer import Fleet
from magcomp.fleet.local import Limits, run
from magcomp.fleet.run import Runner, lost
from magcomp.fleet.store import Store
from magcomp.fleet.task import carry_out

_Result = TypeVar("_Result")

_MEGABYTE = 1 << 20

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
    """

    limits: Limits

    @contextmanager
    def runner(self) -> Iterator[Runner]:
        """Workers, until the block ends."""
        yield lambda tasks: run(tasks, carry_out, lost, self.limits)


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
    @functools.wraps(command)
    def with_workers(count: int, memory: int, timeout: float, **others: object) -> _Result:
        limits = Limits(count, seconds=timeout, memory=memory * _MEGABYTE)
        return command(workers=Workers(limits), **others)

    return with_workers


@dataclass(frozen=True)
class Outputs:
    """What is written beside the answer.

    Attributes
    ----------
    table
        A row a compass a log.
    force
        Whether files that are there may be replaced.
    """

    table: Path | None
    force: bool

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

    def write(self, fleet: Fleet, store: Store) -> None:  # noqa: ARG002
        """Write all that was asked for."""
        if self.table is not None:
            as_table.write_table(self.table, store.read(), force=self.force)


def output_options(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """Give a command the options of `Outputs`."""

    @click.option(
        "--table",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="FILE",
        help="Write a row a compass a log; the suffix chooses the form: "
        f"{', '.join(as_table.SUFFIXES)}.",
    )
    @click.option("--force", is_flag=True, help="Overwrite files that are there.")
    @functools.wraps(command)
    def with_outputs(table: Path | None, force: bool, **others: object) -> _Result:
        return command(outputs=Outputs(table, force), **others)

    return with_outputs
