"""Recording → Analysis: every compass fitted and judged with one control quantity for all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from magcomp.align import controls, expected_earth, has_position, readings, reported
from magcomp.align.health import compass_complaints, current_complaints
from magcomp.analysis.emit import emit, emit_anyway
from magcomp.autopilots import ardupilot
from magcomp.earth import EarthField
from magcomp.errors import MissingDataError, UsageError
from magcomp.fit import METHODS, Problem, best_form, fit
from magcomp.judge import judge, judge_present
from magcomp.model import (
    CURRENT,
    THROTTLE,
    Analysis,
    CompassResult,
    Control,
    Grade,
    MotorFit,
    Recording,
    Verdict,
)

REGRESSORS = ("auto", CURRENT, THROTTLE, "motors")

BETTER = 0.97
"""Throttle is written instead of current only where it leaves less than this share unexplained:
current needs no battery at the same voltage."""

Progress = Callable[[str, float], None]
"""What is being done, and the share done, 0 … 1."""


@dataclass(frozen=True)
class Options:
    """What the user asked for.

    Attributes
    ----------
    compass
        One compass; all by default.
    method, regressor
        ``auto`` chooses.
    start, end
        Seconds since the recording began.
    """

    compass: int | None = None
    method: str = "auto"
    regressor: str = "auto"
    start: float = -np.inf
    end: float = np.inf

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise UsageError(
                f"The method must be one of {', '.join(METHODS)}; instead received {self.method}"
            )
        if self.regressor not in REGRESSORS:
            raise UsageError(
                f"The regressor must be one of {', '.join(REGRESSORS)}; "
                f"instead received {self.regressor}"
            )
        if self.regressor == "motors":
            raise UsageError(
                "The regressor must be auto, current or throttle; instead received motors: "
                "compensation per motor is not fitted yet"
            )
        if not self.start < self.end:
            raise UsageError(
                f"The start must be before the end; instead received {self.start} and {self.end}"
            )


def analyse(
    recording: Recording,
    options: Options | None = None,
    progress: Progress = lambda _what, _share: None,
) -> Analysis:
    """Fit and judge the compasses of a recording.

    Parameters
    ----------
    recording
        From any source.
    options
        What to fit and how.
    progress
        Called as the work goes on.

    Raises
    ------
    MissingDataError
        Where the recording lacks a compass, the attitude, or any control quantity.
    FitRejectedError
        Where the method asked for cannot work.
    ParameterFileError
        Where a compass parameter in the recording is not finite.
    """
    wanted = Options() if options is None else options
    found = _controls_of(recording)
    kinds = _kinds(recording, found, wanted)
    earth = expected_earth(recording)
    compasses = _compasses(recording, wanted)
    steps = len(kinds) * len(compasses)
    judged: dict[str, list[_Judged]] = {}
    for kind in kinds:
        forms = [control for control in found if control.kind == kind]
        for compass in compasses:
            progress(f"compass {compass} by {kind}", sum(map(len, judged.values())) / steps)
            result = _one(recording, compass, wanted, forms, reported(found), earth)
            forms = [result.problem.control]
            judged.setdefault(kind, []).append(result)
    progress("done", 1.0)
    chosen = _choose(judged)
    parameters = emit(
        recording, [(j.fit, j.verdict, j.problem.readings.in_force[-1]) for j in judged[chosen]]
    )
    insisted = emit_anyway(recording, [j.fit for j in judged[chosen]])
    return Analysis(
        source=recording.source,
        duration_s=recording.duration_s,
        vehicle=recording.vehicle,
        compasses=tuple(
            CompassResult(
                fit=j.fit,
                verdict=j.verdict,
                in_force=j.problem.readings.in_force[-1].correction,
                parameters=parameters[j.fit.compass],
                insisted=insisted[j.fit.compass],
            )
            for j in judged[chosen]
        ),
        notes=tuple(_notes(recording, judged, chosen)),
    )


def check(recording: Recording, options: Options | None = None) -> Mapping[int, Verdict]:
    """Judge the calibration in force of each compass; nothing is fitted.

    Raises
    ------
    MissingDataError
        As :func:`analyse`.
    """
    wanted = Options() if options is None else options
    found = _controls_of(recording)
    earth = expected_earth(recording)
    by_kind = reported(found)
    verdicts = {}
    for compass in _compasses(recording, wanted):
        new = readings(recording, compass, start=wanted.start, end=wanted.end)
        kind = new.in_force[-1].regressor or found[0].kind
        if kind not in by_kind:
            raise MissingDataError(
                f"Compass {compass} is corrected by {kind}, so {recording.source} must hold the "
                f"{kind}; instead it holds {', '.join(by_kind)}"
            )
        verdicts[compass] = judge_present(Problem(new, by_kind[kind], by_kind, earth))
    return verdicts


def regressor_in_force(recording: Recording) -> str:
    """The control quantity that :func:`check` judges a recording by.

    Raises
    ------
    MissingDataError
        Where the recording holds no control quantity.
    """
    switch = recording.parameters.last(ardupilot.COMPENSATION_SWITCH, 0.0)
    named = (kind for kind, value in ardupilot.COMPENSATION_OF.items() if value == switch)
    return next(named, "") or _controls_of(recording)[0].kind


@dataclass(frozen=True, eq=False)
class _Judged:
    problem: Problem
    fit: MotorFit
    verdict: Verdict


def _one(
    recording: Recording,
    compass: int,
    wanted: Options,
    forms: Iterable[Control],
    in_force: Mapping[str, Control],
    earth: EarthField,
) -> _Judged:
    new = readings(recording, compass, start=wanted.start, end=wanted.end)
    problem = best_form([Problem(new, form, in_force, earth) for form in forms])
    complaints = compass_complaints(recording, compass)
    if problem.control.kind == CURRENT:
        complaints += current_complaints(recording)
    found, verdict = judge(problem, fit(problem, wanted.method), complaints=complaints)
    return _Judged(problem, found, verdict)


def _controls_of(recording: Recording) -> tuple[Control, ...]:
    found = controls(recording)
    if not found:
        raise MissingDataError(
            f"{recording.source} must hold a battery current or a throttle that changes; instead "
            "it holds neither: was the vehicle ever armed?"
        )
    return found


def _kinds(recording: Recording, found: Iterable[Control], wanted: Options) -> list[str]:
    """The control quantities to try, the reported ones first."""
    kinds = list(dict.fromkeys(control.kind for control in found))
    if wanted.regressor == "auto":
        return kinds
    if wanted.regressor not in kinds:
        raise MissingDataError(
            f"{recording.source} must hold a {wanted.regressor} that changes; instead it holds "
            f"only {', '.join(kinds)}"
        )
    return [wanted.regressor]


def _compasses(recording: Recording, wanted: Options) -> list[int]:
    """The compasses to fit; the first cannot be while it is corrected per motor.

    Notes
    -----
    COMPASS_PMOT_EN overrides COMPASS_MOTCT for compass 1 (AUTOPILOTS.md).
    """
    if recording.vehicle.autopilot != "ardupilot":
        raise MissingDataError(
            f"{recording.source} must be of a vehicle with ArduPilot; instead it is of one with "
            f"{recording.vehicle.autopilot}, whose compass correction is not known yet"
        )
    if not recording.field:
        raise MissingDataError(
            f"{recording.source} must hold readings of a compass (RAW_IMU, SCALED_IMU2 or "
            "SCALED_IMU3); instead it holds none"
        )
    asked = sorted(recording.field) if wanted.compass is None else [wanted.compass]
    if not recording.parameters.last("COMPASS_PMOT_EN", 0.0):
        return asked
    left = [compass for compass in asked if compass != 1]
    if not left:
        raise MissingDataError(
            "COMPASS_PMOT_EN must be 0 while compass 1 is recorded; instead it is on, and a "
            "correction per motor cannot be undone from a log"
        )
    return left


def _choose(judged: Mapping[str, list[_Judged]]) -> str:
    """The control quantity that predicts held-out data better; current where it is close."""

    def unexplained(kind: str) -> float:
        # A sweep's residual rows have three components, the others' two.
        logs = [
            np.log(max(j.verdict.residual.held_out, 1e-6) / np.sqrt(2 + (j.fit.method == "sweep")))
            for j in judged[kind]
        ]
        return float(np.exp(np.mean(logs)))

    if len(judged) == 1:
        return next(iter(judged))
    rejected = {
        kind: all(j.verdict.grade is Grade.REJECTED for j in results)
        for kind, results in judged.items()
    }
    if rejected[THROTTLE] or rejected[CURRENT]:
        return CURRENT if rejected[THROTTLE] else THROTTLE
    return THROTTLE if unexplained(THROTTLE) < BETTER * unexplained(CURRENT) else CURRENT


def _notes(recording: Recording, judged: Mapping[str, list[_Judged]], chosen: str) -> Iterable[str]:
    if len(judged) > 1:
        scores = ", ".join(
            f"{kind} leaves "
            + "/".join(f"{j.verdict.residual.held_out:.1f}" for j in results)
            + " mGauss"
            for kind, results in judged.items()
        )
        yield f"{chosen} is used because it is the better choice on held-out data: {scores}"
    elif chosen == THROTTLE and recording.current is None:
        yield "the log holds no battery current, so throttle is used"
    if not has_position(recording):
        yield "the log holds no position: the earth's field is taken from the readings themselves"
    if recording.vehicle.kind not in ("copter", "unknown"):
        yield (
            f"the vehicle is a {recording.vehicle.kind}: magcomp is made for multirotors, whose "
            "thrust demand is the throttle the autopilot multiplies"
        )
    if recording.parameters.last("COMPASS_PMOT_EN", 0.0):
        yield "compass 1 is left out: COMPASS_PMOT_EN is on, so it is corrected per motor"
    if not recording.parameters.names:
        yield (
            "the log holds no parameters: the calibration in force is unknown, so only the motor "
            "vector is given, and it is right only if no motor compensation was in force"
        )
    others = recording.report.others
    if others:
        named = ", ".join(f"{system}:{component}" for system, component in others)
        yield f"messages of other systems were left out ({named})"
    if recording.report.bad_checksum:
        yield f"{recording.report.bad_checksum} damaged messages were left out"
