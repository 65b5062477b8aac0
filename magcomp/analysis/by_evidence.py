"""Whether a compass is better corrected motor by motor, where nobody asked for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from magcomp import autopilots
from magcomp.analysis.compare import Judged, flown
from magcomp.analysis.motor_by_motor import Answer, as_written
from magcomp.errors import MagcompError
from magcomp.judge.finding import severity
from magcomp.model import MOTORS, Form, Recording


def motors_where_better(
    recording: Recording,
    answers: Sequence[Answer],
    forms: Mapping[int, Sequence[Form]],
    fit: Callable[[int], Judged],
) -> list[Answer]:
    """Answers by one current, each replaced by one motor by motor where all the evidence is for it.

    Parameters
    ----------
    recording, answers
        What was fitted, and what came out.
    forms
        By compass, what its field may follow.
    fit
        Fits a compass motor by motor and judges it.

    Notes
    -----
    The firmware must be able to apply it; of all forms it must be the simplest that explains data
    it did not see; and no row of the table of heading errors that was flown may come out worse,
    with what each form leaves of the motors' differences, nor the verdict.
    """
    return [_better(recording, each, forms, fit) for each in answers]


def _better(
    recording: Recording,
    answer: Answer,
    forms: Mapping[int, Sequence[Form]],
    fit: Callable[[int], Judged],
) -> Answer:
    compass = answer.judged.fit.compass
    tried = {form.name: form for form in forms.get(compass, ())}
    motors, now = tried.get(MOTORS), tried.get(answer.judged.fit.regressor)
    law = autopilots.of(recording).motor_law(compass, recording.parameters.latest)
    if law is None or motors is None or now is None or not motors.is_best:
        return answer
    try:
        by_motor = as_written(recording, fit(compass))
    except MagcompError:
        return answer
    if not by_motor.parameters or not is_better(by_motor.judged, answer.judged, now.left_deg):
        return answer
    verdict = by_motor.judged.verdict
    reason = (
        f"motor by motor is the better choice: one {now.name} leaves {now.held_out:.1f} mGauss of "
        f"readings it did not see, motor by motor {motors.held_out:.1f}, and costs up to "
        f"{now.left_deg:.1f}° in this flight"
    )
    told = replace(verdict, reasons=(*verdict.reasons, reason))
    return replace(by_motor, judged=replace(by_motor.judged, verdict=told))


def is_better(by_motor: Judged, by_one: Judged, costs: float) -> bool:
    """Whether no row that was flown, nor the verdict, is worse motor by motor.

    Parameters
    ----------
    by_motor, by_one
        The same compass.
    costs
        Heading error that one quantity for all motors leaves, degrees.
    """
    top = min(by_motor.fit.u_high, by_one.fit.u_high)
    new, old = (flown(each.verdict.heading_error, top) for each in (by_motor, by_one))
    pairs = zip(new, (float(np.hypot(each, costs)) for each in old), strict=True)
    worse = severity(by_motor.verdict.grade) > severity(by_one.verdict.grade)
    return bool(new) and not worse and all(after <= before for after, before in pairs)
