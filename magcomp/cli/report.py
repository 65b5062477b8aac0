"""``magcomp report``: from a log to a page to look at."""

from __future__ import annotations

from pathlib import Path

import click

from magcomp.analysis import Options
from magcomp.cli.options import (
    Selection,
    check_output,
    log_argument,
    method_option,
    regressor_option,
    selection_options,
)
from magcomp.cli.work import fit_log
from magcomp.errors import ExitCode
from magcomp.model import Grade
from magcomp.report.files import SUFFIXES, report_text, write_text


@click.command("report")
@log_argument
@method_option
@regressor_option
@selection_options
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    required=True,
    help=f"Where to; the suffix chooses the form: {', '.join(SUFFIXES)}.",
)
@click.option("--force", is_flag=True, help="Overwrite FILE.")
def report(
    log: Path, method: str, regressor: str, selection: Selection, output: Path, force: bool
) -> ExitCode:
    """Fit LOG and write a report: the verdict, what to do, and what it rests on.

    A report is written whatever the verdict; the exit code is that of magcomp fit.
    """
    check_output(output, SUFFIXES, log, force=force)
    options = Options(selection.compass, method, regressor, selection.start, selection.end)
    recording, analysis = fit_log(log, options, selection)
    write_text(
        output, report_text(output.suffix, recording, analysis, options=options), force=force
    )
    return ExitCode.REJECTED if analysis.grade is Grade.REJECTED else ExitCode.GOOD
