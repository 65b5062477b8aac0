"""``magcomp tui``: the terminal screen."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from magcomp.cli.vehicle import vehicle_options
from magcomp.errors import UsageError


@click.command("tui")
@click.argument("target", required=False, default="", metavar="[ADDRESS|LOG]")
@vehicle_options
@click.option("--theme", default="", help='For this time: "night", "sun", or any other there is.')
@click.option(
    "--settings",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="FOLDER",
    help="Where settings.toml and what is remembered are kept.",
)
def tui(
    target: str, system: int | None, component: int | None, theme: str, folder: Path | None
) -> int:
    """Work with a vehicle or a log in the terminal: connect, record, fit, write, verify.

    F1 helps everywhere. Nothing is written to a vehicle without a question.
    """
    if not sys.stdout.isatty() or not sys.stdin.isatty():
        raise UsageError(
            "magcomp tui must run in a terminal; instead stdin or stdout is none. Use magcomp fit "
            "or magcomp calibrate in scripts"
        )
    # Textual is worth its import only here.
    from magcomp.tui import run  # noqa: PLC0415

    return run(target, folder=folder, system=system, component=component, theme=theme)
