"""``magcomp fit``: from a log to a parameter file."""

from __future__ import annotations

from pathlib import Path

import click

from magcomp.analysis import Options, parameter_set
from magcomp.cli.options import (
    Selection,
    check_output,
    json_option,
    log_argument,
    method_option,
    regressor_option,
    selection_options,
    verbose_option,
)
from magcomp.cli.output import answer, complain, look
from magcomp.cli.work import fit_log
from magcomp.errors import ExitCode, UsageError
from magcomp.model import Grade
from magcomp.report import as_json
from magcomp.report import files as report_files
from magcomp.writing.files import SUFFIXES, write_parameter_file


@click.command("fit")
@log_argument
@method_option
@regressor_option
@selection_options
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help=f"Write the parameters; the suffix chooses the form: {', '.join(SUFFIXES)}.",
)
@click.option(
    "--report",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help=f"Write a report; the suffix chooses the form: {', '.join(report_files.SUFFIXES)}.",
)
@json_option
@verbose_option
@click.option(
    "--force",
    is_flag=True,
    help="Overwrite; also write a fit the judge rejects (still exit code 1).",
)
def fit(
    log: Path,
    method: str,
    regressor: str,
    selection: Selection,
    output: Path | None,
    report: Path | None,
    to_json: bool,
    verbose: bool,
    force: bool,
) -> ExitCode:
    """Find in LOG how the motors shift the compass, and what cancels the shift.

    The answer is judged on stretches of the log that the fit did not see. Nothing is written
    without -o, and nothing that the judge rejects is written without --force.
    """
    options = Options(selection.compass, method, regressor, selection.start, selection.end)
    if output is not None:
        check_output(output, SUFFIXES, log, force=force)
    if report is not None:
        check_output(report, report_files.SUFFIXES, log, force=force)
    recording, analysis = fit_log(log, options, selection)
    if output is not None and analysis.only_to_look_at:
        raise UsageError(f"{output} must hold parameters; instead {analysis.only_to_look_at}")
    rejected = analysis.grade is Grade.REJECTED
    chosen = parameter_set(analysis, include_rejected=rejected and force)
    written = None
    if output is not None and (force or not rejected):
        write_parameter_file(output, chosen, force=force)
        written = str(output)
    if report is not None:
        page = report_files.report_text(
            report.suffix, recording, analysis, options=options, written=written
        )
        report_files.write_text(report, page, force=force)
    if to_json:
        answer(as_json.dumps(as_json.analysis_object(analysis, written)))
    else:
        # Rich is only worth its import where an answer is for people.
        from magcomp.report import as_text  # noqa: PLC0415

        present = recording.parameters.latest
        answer(
            as_text.analysis_text(
                analysis,
                chosen.values,
                present,
                look(),
                written=written,
                report=None if report is None else str(report),
                verbose=verbose,
            )
        )
    if not rejected:
        return ExitCode.GOOD
    if output is not None and written is None:
        complain(
            f"{output} is not written because no compass has a fit to be trusted; --force writes "
            "it all the same"
        )
    return ExitCode.REJECTED
