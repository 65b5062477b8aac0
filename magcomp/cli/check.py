"""``magcomp check``: judge the calibration in force; fit nothing."""

from __future__ import annotations

from pathlib import Path

import click

from magcomp.analysis import Options, regressor_in_force
from magcomp.cli.options import Selection, json_option, log_argument, selection_options
from magcomp.cli.output import answer, look
from magcomp.cli.work import check_log
from magcomp.errors import ExitCode
from magcomp.model import Grade
from magcomp.report import as_json


@click.command("check")
@log_argument
@selection_options
@json_option
def check(log: Path, selection: Selection, to_json: bool) -> ExitCode:
    """Judge the compass calibration in force in LOG; nothing is fitted.

    Ends with exit code 1 where the judge rejects any compass.
    """
    options = Options(selection.compass, start=selection.start, end=selection.end)
    recording, verdicts = check_log(log, options, selection)
    kind = regressor_in_force(recording)
    if to_json:
        answer(as_json.dumps(as_json.check_object(recording, verdicts, kind)))
    else:
        from magcomp.report import as_text  # noqa: PLC0415 - only people need rich

        answer(as_text.check_text(recording, verdicts, kind, look(), selection.compass))
    rejected = any(verdict.grade is Grade.REJECTED for verdict in verdicts.values())
    return ExitCode.REJECTED if rejected else ExitCode.GOOD
