"""What commands do with a log, with progress."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from magcomp.analysis import Options, analyse, check
from magcomp.analysis.choose import with_attitude, with_battery
from magcomp.cli.options import Selection
from magcomp.cli.output import complain, progress
from magcomp.model import Analysis, ParameterSet, Recording, Verdict
from magcomp.sources import read
from magcomp.writing.files import read_parameter_file

_READING = 0.1
"""Share of the progress bar that reading the log takes."""


def fit_log(log: Path, options: Options, selection: Selection) -> tuple[Recording, Analysis]:
    """Read a log, fit and judge it."""
    with progress() as step:
        recording = _read(log, selection, lambda share: step("reading the log", share * _READING))
        analysis = analyse(
            recording,
            options,
            lambda what, share: step(f"fitting {what}", _READING + share * (1.0 - _READING)),
        )
    return recording, analysis


def check_log(
    log: Path, options: Options, selection: Selection
) -> tuple[Recording, Mapping[int, Verdict]]:
    """Read a log and judge the calibration in force."""
    with progress() as step:
        recording = _read(log, selection, lambda share: step("reading the log", share))
        step("judging", 1.0)
        return recording, check(recording, options)


def read_log(log: Path, selection: Selection) -> Recording:
    """Read a log."""
    with progress() as step:
        return _read(log, selection, lambda share: step("reading the log", share))


def read_parameters(path: Path) -> ParameterSet:
    """Read a parameter file, and say what it leaves in doubt."""
    found = read_parameter_file(path)
    for warning in found.warnings:
        complain(warning)
    return found


def _read(log: Path, selection: Selection, progress: Callable[[float], None]) -> Recording:
    recording = read(log, system=selection.system, component=selection.component, progress=progress)
    if selection.battery is not None:
        recording = with_battery(recording, selection.battery)
    if selection.attitude is not None:
        recording = with_attitude(recording, selection.attitude)
    return recording
