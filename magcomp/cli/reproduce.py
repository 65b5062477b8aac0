"""``magcomp reproduce``: the paper's experiments, carried out again."""

from __future__ import annotations

import json
from pathlib import Path

import click

import magcomp
from magcomp.cli.options import json_option
from magcomp.cli.output import answer, complain, look, progress
from magcomp.errors import ExitCode, OutputError
from magcomp.experiments.reproduce import RECORDINGS
from magcomp.experiments.reproduce import reproduce as carry_out
from magcomp.report.files import write_text

_PAGE, _TABLE = "index.html", "table.json"


@click.command("reproduce")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help=f"Write {_PAGE}, with the paper's figures, and {_TABLE} into DIR.",
)
@click.option(
    "--recordings",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    metavar="DIR",
    help="Where the recordings are; sitl_fixtures of the source by default.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=1,
    show_default=True,
    metavar="N",
    help="Which simulated vehicle.",
)
@click.option(
    "--compass",
    type=click.IntRange(1, 3),
    default=1,
    show_default=True,
    metavar="N",
    help="Which of its compasses.",
)
@click.option("--force", is_flag=True, help="Overwrite files in DIR.")
@json_option
def reproduce(
    output: Path | None,
    recordings: Path | None,
    seed: int,
    compass: int,
    force: bool,
    to_json: bool,
) -> ExitCode:
    """Reproduce the paper's experiments and print its Table 1 beside ours.

    On a simulated vehicle, and on recordings made with ArduCopter's real firmware.
    """
    from magcomp.experiments.as_text import reproduction_text  # noqa: PLC0415 - rich is slow

    if output is not None:
        _prepare(output, force=force)
    folder = _recordings() if recordings is None else recordings
    if folder is None:
        complain("the recordings of sitl_fixtures are not at hand: only the simulation is used")
    with progress() as step:
        made = carry_out(folder, seed=seed, compass=compass, progress=step)
    document = json.dumps(made.document(), indent=2, allow_nan=False) + "\n"
    if output is not None:
        from magcomp.experiments.as_html import html  # noqa: PLC0415 - only where it is written

        write_text(output / _TABLE, document, force=force)
        write_text(output / _PAGE, html(made), force=force)
    answer(document if to_json else reproduction_text(made, look()))
    return ExitCode.GOOD


def _recordings() -> Path | None:
    """Beside the package, as in a checkout, or in the working directory."""
    for root in (Path(magcomp.__file__).parents[1], Path.cwd()):
        folder = root / "sitl_fixtures"
        if all((folder / name).is_file() for name in RECORDINGS):
            return folder
    return None


def _prepare(directory: Path, *, force: bool) -> None:
    """Refuse before the work is done what could not be written after it."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{directory} must be a directory that can be written; instead received: "
            f"{error.strerror}"
        ) from error
    for name in (_PAGE, _TABLE):
        if (directory / name).exists() and not force:
            raise OutputError(f"{directory / name} must not exist yet; use --force to overwrite it")
