"""Options that several commands share, and checks that come before long work."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import click

from magcomp.analysis.analyse import REGRESSORS
from magcomp.cli.vehicle import vehicle_options
from magcomp.errors import OutputError, UsageError
from magcomp.fit import METHODS

_Result = TypeVar("_Result")

log_argument = click.argument("log", type=click.Path(path_type=Path))
json_option = click.option("--json", "to_json", is_flag=True, help="Print one JSON object.")
verbose_option = click.option("-v", "--verbose", is_flag=True, help="Show every detail.")

method_option = click.option(
    "--method",
    type=click.Choice(METHODS),
    default="auto",
    show_default=True,
    help="How: standing still, turned at steady levels, or flown.",
)
regressor_option = click.option(
    "--regressor",
    type=click.Choice(REGRESSORS),
    default="auto",
    show_default=True,
    help="What the autopilot is to multiply the correction by.",
)


@dataclass(frozen=True)
class Selection:
    """Which part of a log to use.

    Attributes
    ----------
    compass
        One compass, or None for all.
    start, end
        Seconds since the recording began.
    system
        MAVLink system of the vehicle; None where the log holds only one.
    component
        MAVLink component of its autopilot; None for the usual one.
    battery
        Battery instance whose current is taken; None for the one that is usually multiplied.
    attitude
        Message that the attitude is taken from; None for the best.
    """

    compass: int | None
    start: float
    end: float
    system: int | None
    component: int | None = None
    battery: int | None = None
    attitude: str | None = None


def selection_options(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """Give a command the options of a `Selection`, by the names of its attributes."""

    @click.option(
        "--compass", type=click.IntRange(1, 4), metavar="N", help="One compass; all by default."
    )
    @click.option(
        "--start", type=float, default=-math.inf, metavar="S", help="Leave out what is before, s."
    )
    @click.option(
        "--end", type=float, default=math.inf, metavar="S", help="Leave out what is after, s."
    )
    @click.option(
        "--battery", type=click.IntRange(0, 15), metavar="N", help="Take the current of this one."
    )
    @click.option(
        "--attitude", metavar="MESSAGE", help="Take the attitude of this message: see info."
    )
    @vehicle_options
    @functools.wraps(command)
    def with_selection(
        compass: int | None,
        start: float,
        end: float,
        system: int | None,
        component: int | None,
        battery: int | None,
        attitude: str | None,
        **others: object,
    ) -> _Result:
        selection = Selection(compass, start, end, system, component, battery, attitude)
        return command(selection=selection, **others)

    return with_selection


def check_output(path: Path, suffixes: Sequence[str], log: Path, *, force: bool) -> None:
    """Refuse an output that could not be written, before the work is done.

    Parameters
    ----------
    path
        Where the output is to go.
    suffixes
        Those it may have.
    log
        What is read, which the output must not replace.
    force
        Whether a file that is there may be replaced.

    Raises
    ------
    UsageError
        Where the suffix is none of ``suffixes``.
    OutputError
        Where the path is a directory, its directory is missing or read-only, or the file exists
        and ``force`` is not set.
    """
    if path.suffix.lower() not in suffixes:
        raise UsageError(
            f"{path} must end in {' or '.join(suffixes)}; instead received "
            f"{path.suffix or 'no suffix'}"
        )
    try:
        if path.is_dir():
            raise OutputError(f"{path} must be a file; instead it is a directory")
        if path.exists() and log.exists() and path.samefile(log):
            raise OutputError(f"{path} must not be the log itself; instead received the same file")
        if path.exists() and not force:
            raise OutputError(f"{path} must not exist yet; use --force to overwrite it")
        if not path.parent.is_dir():
            raise OutputError(f"{path.parent} must be a directory; instead there is none")
    except (OSError, ValueError) as error:
        raise OutputError(f"{path} must be a path to a file; instead received: {error}") from error
    if not os.access(path.parent, os.W_OK):
        raise OutputError(f"{path.parent} must be writable; instead it is read-only")
