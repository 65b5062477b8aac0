"""Recording → Analysis: every compass fitted and judged with one control quantity for all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from magcomp import autopilots
from magcomp.align import (
    currents_of_motors,
    expected_earth,
    readings,
    reported,
    thinned,
    to_undo,
)
from magcomp.align.health import compass_complaints, current_complaints, vehicle_complaints
from magcomp.align.orientation import orientation_complaint
from magcomp.analysis.by_evidence import motors_where_better
from magcomp.analysis.choose import with_speed_controllers
from magcomp.analysis.compare import Judged, Rival, beaten, better, doubted
from magcomp.analysis.emit import Emission, emit, what_applies
from magcomp.analysis.forms import compared, forms_notes
from magcomp.analysis.missing import controls_of, hover_of, no_motors, with_cure
from magcomp.analysis.motor_by_motor import Answer, as_written
from magcomp.analysis.multiplied import kinds_to_try, why_only_to_look_at
from magcomp.analysis.notes import lacking_notes, notes_of
from magcomp.analysis.origin import hints
from magcomp.analysis.vehicle_words import in_words_of
from magcomp.earth import EarthField
from magcomp.errors import MissingDataError, UsageError
from magcomp.fit import (
    METHODS,
    Problem,
    best_form,
    fit,
    require_finite,
    require_readings,
    solvable,
)
from magcomp.judge import judge, judge_present
from magcomp.model import (
    CURRENT,
    MOTORS,
    THROTTLE,
    Analysis,
    CompassResult,
    Control,
    Form,
    Recording,
    Verdict,
    pack,
    quantity_of,
)

ESC = "esc"
REGRESSORS = ("auto", CURRENT, THROTTLE, MOTORS, ESC)

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
        Where every compass asked for has a parameter that is not finite.
    """
    wanted = Options() if options is None else options
    if wanted.regressor == ESC:
        recording = with_speed_controllers(recording)
        wanted = replace(wanted, regressor=CURRENT)
    recording, left_out = hover_of(recording)
    compasses = _compasses(recording, wanted)
    found = controls_of(recording)
    motors = currents_of_motors(recording)
    if wanted.regressor == MOTORS and not motors:
        raise no_motors(recording)
    kinds = _kinds(recording, found, wanted)
    earth, in_force = expected_earth(recording), to_undo(recording, found)
    steps = len(kinds) * len(compasses)
    judged: dict[str, list[Judged]] = {}
    lacking: dict[int, MissingDataError] = {}
    rivals: tuple[Rival, ...] = ()
    for kind in kinds:
        forms = [control for control in (*found, *motors) if control.kind == kind]
        if (
            quantity_of(kind).is_throttle
            and CURRENT in judged
            and (rivals := beaten(judged[CURRENT], forms))
        ):
            continue
        for compass in compasses:
            progress(f"compass {compass} by {kind}", sum(map(len, judged.values())) / steps)
            try:
                result = _one(recording, compass, wanted, forms, in_force, earth)
            except MissingDataError as error:
                lacking.setdefault(compass, error)
                continue
            forms = [result.problem.control]
            judged.setdefault(kind, []).append(result)
    if not judged:
        raise with_cure(recording, compasses[0], lacking[compasses[0]])
    progress("done", 1.0)
    chosen = MOTORS if MOTORS in judged else better(judged)
    judged[chosen] = list(doubted(judged, chosen, rivals))
    answers = [as_written(recording, each) for each in judged[chosen]]
    forms_of = compared(judged, motors, reported(found).get(THROTTLE))
    if wanted.regressor == "auto" and quantity_of(chosen).of_each:
        answers = motors_where_better(
            recording,
            answers,
            forms_of,
            lambda compass: _one(recording, compass, wanted, motors, in_force, earth),
        )
    emitted = emit(recording, [each.written for each in answers])
    nothing = all(each.judged.is_rejected for each in answers)
    each_left = judged | ({THROTTLE: rivals} if rivals else {})
    held_out = {k: tuple(each.held_out for each in found) for k, found in each_left.items()}
    why_not = why_only_to_look_at(recording, chosen)
    return Analysis(
        source=recording.source,
        duration_s=recording.duration_s,
        vehicle=recording.vehicle,
        compasses=tuple(
            _result(
                each,
                Emission({}, {}) if why_not else emitted[each.written.compass],
                forms_of.get(each.written.compass, ()),
                nothing_accepted=nothing,
            )
            for each in answers
        ),
        notes=(
            *([left_out] if left_out else []),
            *notes_of(recording, wanted.compass, held_out, chosen),
            *forms_notes(
                {
                    each.judged.fit.compass: forms_of[each.judged.fit.compass]
                    for each in answers
                    if each.judged.fit.compass in forms_of and not each.parameters
                },
                judged,
                chosen,
            ),
            *lacking_notes(lacking, judged),
            *hints([each.judged.fit for each in answers]),
        ),
        only_to_look_at=why_not,
    )


def _result(
    answer: Answer, emitted: Emission, forms: tuple[Form, ...], *, nothing_accepted: bool
) -> CompassResult:
    judged = answer.judged
    accepted = answer.parameters or emitted.accepted
    left_out = {} if nothing_accepted else emitted.left_out
    return CompassResult(
        fit=judged.fit,
        verdict=judged.verdict,
        in_force=judged.problem.readings.in_force[-1].correction,
        parameters=left_out if judged.is_rejected else accepted,
        insisted=accepted,
        left_out=emitted.left_out,
        forms=forms,
        as_written=answer.told,
    )


def check(recording: Recording, options: Options | None = None) -> Mapping[int, Verdict]:
    """Judge the calibration in force of each compass; nothing is fitted.

    A compass of which too much is missing is left out, as by :func:`analyse`.

    Raises
    ------
    MissingDataError
        As :func:`analyse`.
    """
    wanted = Options() if options is None else options
    recording, _ = hover_of(recording)
    compasses = _compasses(recording, wanted)
    found = controls_of(recording)
    earth = expected_earth(recording)
    by_kind = to_undo(recording, found)
    verdicts: dict[int, Verdict] = {}
    lacking: list[MissingDataError] = []
    for compass in compasses:
        try:
            verdicts[compass] = _checked(recording, compass, wanted, found[0].kind, by_kind, earth)
        except MissingDataError as error:
            lacking.append(error)
    if not verdicts:
        raise lacking[0]
    return verdicts


def _checked(
    recording: Recording,
    compass: int,
    wanted: Options,
    usual: str,
    by_kind: Mapping[str, Control],
    earth: EarthField,
) -> Verdict:
    new = thinned(readings(recording, compass, start=wanted.start, end=wanted.end))
    kind = _single(new.in_force[-1].regressor) or usual
    if kind not in by_kind:
        raise MissingDataError(
            f"Compass {compass} is corrected by {kind}, so {recording.source} must hold the "
            f"{kind}; instead it holds {', '.join(by_kind)}"
        )
    problem = Problem(new, by_kind[kind], by_kind, earth)
    with solvable(compass):
        verdict = judge_present(problem, complaints=_complaints(recording, compass, kind))
    require_finite(compass, _bounds(verdict))
    return _in_words_of(recording, verdict)


def _single(kind: str | None) -> str | None:
    """The quantity of one part by which a correction in force is told."""
    return None if kind is None else quantity_of(kind).single


def regressor_in_force(recording: Recording) -> str:
    """The control quantity that :func:`check` judges a recording by.

    Raises
    ------
    MissingDataError
        Where the recording holds no control quantity.
    """
    in_force = autopilots.of(recording).regressor(recording.parameters.latest)
    return in_force or controls_of(recording)[0].kind


def _one(
    recording: Recording,
    compass: int,
    wanted: Options,
    forms: Iterable[Control],
    in_force: Mapping[str, Control],
    earth: EarthField,
) -> Judged:
    new = thinned(readings(recording, compass, start=wanted.start, end=wanted.end))
    require_readings(new)
    with solvable(compass):
        problem = best_form([Problem(new, form, in_force, earth) for form in forms])
    complaints = _complaints(recording, compass, problem.control.kind)
    with solvable(compass):
        samples = problem.sample(problem.usual_lags())
        if turned := orientation_complaint(recording, samples, earth):
            complaints = (turned, *complaints)
        found, verdict = judge(
            problem,
            fit(problem, wanted.method),
            complaints=complaints,
            applied=what_applies(recording, problem.control.kind),
        )
    require_finite(compass, (found.covariance, pack(found.correction), *_bounds(verdict)))
    return Judged(problem, found, _in_words_of(recording, verdict))


def _bounds(verdict: Verdict) -> list[float]:
    return [error for row in verdict.heading_error for error in (row.before, row.p95)]


def _complaints(recording: Recording, compass: int, kind: str) -> tuple[str, ...]:
    """What is wrong with the sensors that an answer by a control quantity rests on."""
    of_compass = compass_complaints(recording, compass) + vehicle_complaints(recording)
    by_throttle = quantity_of(kind).is_throttle
    return of_compass if by_throttle else of_compass + current_complaints(recording)


def _in_words_of(recording: Recording, verdict: Verdict) -> Verdict:
    kind = recording.vehicle.kind
    return replace(verdict, reasons=tuple(in_words_of(kind, each) for each in verdict.reasons))


def _kinds(recording: Recording, found: Iterable[Control], wanted: Options) -> list[str]:
    """The control quantities to try, the reported ones first."""
    kinds = list(dict.fromkeys(control.kind for control in found))
    if wanted.regressor == "auto":
        return kinds_to_try(recording, kinds)
    if wanted.regressor == MOTORS:
        # What one current leaves is what the motors have to be weighed against.
        return [*(kind for kind in kinds if kind == quantity_of(MOTORS).single), MOTORS]
    if wanted.regressor not in kinds:
        raise MissingDataError(
            f"{recording.source} must hold a {wanted.regressor} that changes; instead it holds "
            f"only {', '.join(kinds)}"
        )
    return [wanted.regressor]


def _compasses(recording: Recording, wanted: Options) -> list[int]:
    """The compasses to fit: those asked for whose correction can be undone."""
    autopilot = autopilots.of(recording)
    autopilot.require_fittable(recording)
    if not recording.field:
        raise MissingDataError(
            f"{recording.source} must hold readings of a compass; instead it holds none: "
            f"{autopilot.how_to_record('compass', recording.format)}"
        )
    asked = sorted(recording.field) if wanted.compass is None else [wanted.compass]
    left_out = autopilot.left_out(recording.parameters)
    found = [compass for compass in asked if compass not in left_out]
    if not found:
        raise left_out[asked[0]]
    return found
