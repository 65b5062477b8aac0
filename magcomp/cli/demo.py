"""``magcomp demo``: fit a recorded flight whose truth is known, and compare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import click

import magcomp
from magcomp.cli.output import answer, look
from magcomp.cli.truth import KnownTruth
from magcomp.cli.work import fit_log, present_parameters
from magcomp.errors import ExitCode, InputError
from magcomp.model import Grade, Recording
from magcomp.session import Options, parameter_set

_NAME = "flight"
_CURRENTS = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0)


@click.command("demo")
def demo() -> ExitCode:
    """Fit a recorded flight of the real firmware in simulation, and compare with its truth."""
    from magcomp.report import as_text  # noqa: PLC0415 - rich only where text is made

    log, truth = _recording()
    recording, analysis = fit_log(log, Options(), None)
    present, fitted = present_parameters(recording), parameter_set(analysis).values
    answer(as_text.analysis_text(analysis, fitted, present, look(), advise=False))
    rows = _against(truth, recording, fitted, [result.fit.compass for result in analysis.compasses])
    answer(as_text.truth_text(str(log.with_suffix(".json")), rows, look()))
    return ExitCode.REJECTED if analysis.grade is Grade.REJECTED else ExitCode.GOOD


def _recording() -> tuple[Path, KnownTruth]:
    """The recording to show, in the checkout or in the working directory."""
    for root in (Path(magcomp.__file__).parents[1], Path.cwd()):
        log = root / "sitl_fixtures" / f"{_NAME}.tlog"
        if log.is_file():
            if log.is_relative_to(Path.cwd()):
                log = log.relative_to(Path.cwd())
            return log, KnownTruth(log.with_suffix(".json"))
    raise InputError(
        f"the demo needs sitl_fixtures/{_NAME}.tlog of magcomp's source; instead it is neither "
        "beside the package nor in this directory: run it in a checkout"
    )


def _against(
    truth: KnownTruth, recording: Recording, fitted: Mapping[str, float], compasses: Sequence[int]
) -> list[tuple[float, float, float]]:
    """Current, and the true heading error of the worst compass before and after."""
    before = present_parameters(recording)
    after = {**before, **fitted}

    def worst(parameters: dict[str, float], amperes: float) -> float:
        return max(
            truth.heading_error_deg(parameters, compass, amperes, recording.start_unix_s)
            for compass in compasses
        )

    return [(amperes, worst(before, amperes), worst(after, amperes)) for amperes in _CURRENTS]
