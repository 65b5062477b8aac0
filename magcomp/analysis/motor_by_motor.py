"""A correction motor by motor, as this vehicle's firmware can apply it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from magcomp import autopilots
from magcomp.align import drawn_and_driven
from magcomp.analysis.compare import Judged
from magcomp.autopilots.terms import MotorLaw
from magcomp.fit.nearest import moved, nearest
from magcomp.judge.evidence import used_lags
from magcomp.judge.finding import severity
from magcomp.judge.forms import left_deg
from magcomp.judge.thresholds import Thresholds
from magcomp.model import (
    MOTORS,
    AsWritten,
    Control,
    FloatArray,
    Grade,
    HeadingError,
    MotorFit,
    Recording,
    Samples,
    least_at,
    quantity_of,
)

_LEAST_EXPONENT, _STEPS, _FINE = 0.3, 18, 0.01


@dataclass(frozen=True, eq=False)
class Answer:
    """What of a fit can be written.

    Attributes
    ----------
    judged
        The fit and its verdict.
    written
        The fit by one quantity; of a fit motor by motor the nearest to it over the range flown.
    parameters
        Of the correction motor by motor; empty where one quantity is written.
    told
        Which of the two is written, and what it leaves; None where that is the fit itself.
    """

    judged: Judged
    written: MotorFit
    parameters: Mapping[str, float] = field(default_factory=dict)
    told: AsWritten | None = None


def as_written(recording: Recording, judged: Judged) -> Answer:
    """Bring a fit into the form that the firmware multiplies.

    Parameters
    ----------
    recording, judged
        What was fitted, and what came out.
    """
    problem, fit = judged.problem, judged.fit
    if problem.control.parts == 1:
        return Answer(judged, fit)
    samples = problem.sample(used_lags(fit))
    whole = fit.correction.apply(samples.raw, samples.u)
    added = fit.correction.added(samples.u)
    found, left = nearest(added, samples.total[:, None])
    single = replace(
        fit,
        regressor=quantity_of(fit.regressor).single,
        correction=moved(fit.correction, found),
        covariance=fit.shared_covariance,
        numbers=(),
    )
    told = AsWritten(single.regressor, np.nan, left_deg(left, whole, samples))
    autopilot, values = autopilots.of(recording), recording.parameters.latest
    law = autopilot.motor_law(fit.compass, values)
    rows = None if law is None else _rows(recording, problem.control, samples, law)
    if law is None or rows is None:
        return _answer(recording, judged, single, {}, told)
    drawn, drive = rows
    added = fit.correction.added(drawn)
    exponent = _exponent(added, drive, law.most_exponent)
    found, left = nearest(added, drive**exponent)
    by_law = AsWritten(MOTORS, exponent, left_deg(left, whole, samples))
    if by_law.left_deg > told.left_deg:
        # Volts that fall while currents rise, or currents steeper than the law can be.
        return _answer(recording, judged, single, {}, told, than_law=by_law)
    parameters = autopilot.per_motor_parameters(
        moved(fit.correction, found),
        exponent,
        fit.compass,
        values,
        soft_iron_fitted="diagonal" in fit.free,
    )
    return _answer(recording, judged, single, parameters, by_law)


def _exponent(added: FloatArray, drive: FloatArray, most: float) -> float:
    """The exponent of the drive, up to the most, by which a field is followed best."""

    def cost(exponent: float) -> float:
        return float(np.sum(nearest(added, drive**exponent)[1] ** 2))

    grid = np.linspace(_LEAST_EXPONENT, most, _STEPS)
    return least_at(cost, grid, _FINE, _LEAST_EXPONENT, most)[0]


def _answer(
    recording: Recording,
    judged: Judged,
    written: MotorFit,
    parameters: Mapping[str, float],
    told: AsWritten,
    than_law: AsWritten | None = None,
) -> Answer:
    """With a word on what the firmware's form leaves, and no better a grade than that allows."""
    title, limits = autopilots.of(recording).title, Thresholds()
    how = (
        f"{title} corrects it motor by motor, with an exponent of {told.exponent:.2f}"
        if parameters
        else f"{title}'s law for each motor leaves {than_law.left_deg:.1f}°, and one "
        f"{told.regressor} follows them better"
        if than_law is not None
        else f"{title} multiplies one {told.regressor} for all motors of this compass"
    )
    grade = (
        Grade.GOOD
        if told.left_deg <= limits.good_deg
        else Grade.MARGINAL
        if told.left_deg <= limits.marginal_deg
        else Grade.REJECTED
    )
    reason = f"{how}: as this flight was flown, that leaves up to {told.left_deg:.1f}°"
    verdict = judged.verdict
    worse = max(grade, verdict.grade, key=severity)
    reasons = (*verdict.reasons, reason) if grade is Grade.GOOD else (reason, *verdict.reasons)
    errors = tuple(_with(row, told.left_deg) for row in verdict.heading_error)
    verdict = replace(verdict, grade=worse, reasons=reasons, heading_error=errors)
    again = replace(judged, verdict=verdict)
    return Answer(again, written, parameters, told)


def _with(row: HeadingError, left: float) -> HeadingError:
    """A row with what the firmware's form leaves, which is independent of the rest."""
    return replace(row, after=float(np.hypot(row.after, left)), p95=float(np.hypot(row.p95, left)))


def _rows(
    recording: Recording, control: Control, samples: Samples, law: MotorLaw
) -> tuple[FloatArray, FloatArray] | None:
    """What each motor draws and what drives it near each reading, shape (n, k) both.

    Both as the outputs told them together, for the firmware multiplies what it just told, and not
    what was to be expected. None where other motors turn than the law has.
    """
    found = drawn_and_driven(recording)
    if found is None or any(each.numbers != law.numbers for each in (*found, control)):
        return None
    drawn, driven = (each.series for each in found)
    then = samples.time - samples.lags.regressor
    after = np.clip(np.searchsorted(drawn.time, then), 1, len(drawn) - 1)
    row = after - (then - drawn.time[after - 1] < drawn.time[after] - then)
    return drawn.value[row], np.maximum(driven.value[row], 0.0)
