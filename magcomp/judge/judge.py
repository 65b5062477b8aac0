"""The verdict: good, marginal or rejected, and why, in words for a pilot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from magcomp.fit import Problem
from magcomp.judge.evidence import cover, field_residual, used_lags
from magcomp.judge.finding import Finding, severity
from magcomp.judge.gates import on_control, on_turn, on_unseen_parameters
from magcomp.judge.heading_error import (
    control_grid,
    heading_errors,
    multiplied_in_force,
    present_by,
)
from magcomp.judge.keep import is_close, keep
from magcomp.judge.lacking import lacking
from magcomp.judge.motors import on_motors
from magcomp.judge.thresholds import Thresholds
from magcomp.judge.whole import on_constancy, on_earth
from magcomp.model import (
    CORRECTION_SIZE,
    MOTOR,
    OFFSET,
    Correction,
    Coverage,
    FieldResidual,
    FloatArray,
    Grade,
    HeadingError,
    MotorFit,
    Samples,
    Verdict,
    quantity_of,
)

DEFAULT_SEED = 20_240_601

UNSEEN = 1.25
"""Standard errors are widened by this for errors alike in every block and every fold: a current
sensor's scale that drifts with it, a lag that is not one number, wires that share unequally.
benchmarks/coverage.py counts how often the bounds hold on simulated vehicles."""

FLOOR_THROTTLE = 0.05
"""The current is no straight line in the throttle: by this share of the motor vector a flight's fit
may be off at the top, and by half of it in the other direction at rest."""

FLOOR_MOTOR, FLOOR_OFFSET_MGAUSS, FLOOR_SOFT_IRON = 0.005, 0.3, 0.001
"""What no residual shows: a share of the motor vector for wires that share unequally and current
sensors that are not straight, and what temperature moves of offsets and scale."""


def judge(
    problem: Problem,
    fit: MotorFit,
    thresholds: Thresholds | None = None,
    rng: np.random.Generator | None = None,
    complaints: tuple[str, ...] = (),
    applied: Callable[[MotorFit], Correction] | None = None,
) -> tuple[MotorFit, Verdict]:
    """Judge a fit on data it did not see.

    Parameters
    ----------
    problem, fit
        What was fitted and what came out.
    thresholds
        The limits; the defaults are the product's.
    rng
        For the draws that turn covariance into degrees; fixed by default, so that the same log
        always gets the same answer.
    complaints
        What is wrong with the sensors, in words: any of them rejects.
    applied
        What a firmware makes of a fit that it cannot take over as it is; None where it can.

    Returns
    -------
    MotorFit
        The fit with its covariance widened where the folds scatter more than it says; with the
        correction in force as its answer where the data cannot tell the two apart.
    Verdict
        Grade, reasons and evidence.
    """
    limits = Thresholds() if thresholds is None else thresholds
    rng = np.random.default_rng(DEFAULT_SEED) if rng is None else rng
    samples = problem.sample(used_lags(fit))
    residual, motors = field_residual(problem, fit)
    fit = _widened(fit, motors)
    in_force = problem.readings.in_force[-1]
    table = partial(
        heading_errors,
        fit,
        present_by(in_force, problem.in_force, samples),
        multiplied_in_force(control_grid(fit), in_force.regressor, fit, problem.in_force, samples),
    )
    errors = table(rng)
    alike = in_force.regressor in (None, fit.regressor) and problem.control.parts == 1
    stays = alike and is_close(fit, in_force.correction, errors)
    if stays:
        errors = table(rng, applied=in_force.correction)
        residual = replace(residual, after=residual.before, held_out=residual.held_out_before)
    elif applied is not None:
        errors = table(rng, applied=applied(fit))
    covered = cover(samples, fit.correction.apply(samples.raw, samples.u))
    findings = [
        *(Finding(Grade.REJECTED, complaint) for complaint in complaints),
        *on_earth(problem, samples, fit),
        *on_constancy(problem, fit, limits, _worst_flown(fit, errors).p95),
        *on_unseen_parameters(in_force.unseen),
        *on_motors(fit, covered, limits),
        *_findings(fit, errors, residual, (samples, covered), limits),
    ]
    grade = max((f.grade for f in findings), key=severity, default=Grade.GOOD)
    fit = keep(fit, in_force.correction) if stays else fit
    summary = _summary(fit, errors, residual)
    reasons = tuple(
        f.reason for f in sorted(findings, key=lambda f: severity(f.grade), reverse=True)
    )
    return fit, Verdict(grade, (*reasons, summary), errors, residual, covered)


def _widened(fit: MotorFit, motors: FloatArray) -> MotorFit:
    """The covariance scaled up where leaving out a fold moves the answer more, and its floor.

    Notes
    -----
    Delete-a-group jackknife: with k folds the variance of the motor vector is
    (k − 1) / k · Σ (pᵢ − p̄)². The factor is the mean ratio over the three axes.
    """
    count = len(motors)
    jackknife = (count - 1) / count * np.sum((motors - motors.mean(axis=0)) ** 2, axis=0)
    stated = np.maximum(np.diag(fit.shared_covariance)[MOTOR], 1e-18)
    factor = max(1.0, float(np.mean(jackknife / stated))) if fit.method != "flight" else 1.0
    scale = np.full(len(fit.covariance), np.sqrt(factor) * UNSEEN)
    if fit.method == "sweep":
        # What a vehicle at rest cannot show does not scatter between its folds either.
        scale[MOTOR.stop : CORRECTION_SIZE] = 1.0
    widened = fit.covariance * np.outer(scale, scale) + np.diag(_floor(fit) ** 2)
    return replace(fit, covariance=widened)


def _floor(fit: MotorFit) -> FloatArray:
    """Standard errors that no residual shows, one a parameter."""
    bent = not quantity_of(fit.regressor).is_straight and fit.method == "flight"
    motor = (FLOOR_THROTTLE if bent else FLOOR_MOTOR) * float(np.linalg.norm(fit.correction.vector))
    floor = np.full(len(fit.covariance), FLOOR_SOFT_IRON)
    floor[MOTOR] = floor[CORRECTION_SIZE:] = motor
    floor[OFFSET] = np.hypot(FLOOR_OFFSET_MGAUSS, motor * fit.u_high / 2.0 if bent else 0.0)
    return floor


def _findings(
    fit: MotorFit,
    errors: tuple[HeadingError, ...],
    residual: FieldResidual,
    seen: tuple[Samples, Coverage],
    limits: Thresholds,
) -> Iterator[Finding]:
    worst, covered = _worst_flown(fit, errors), seen[1]
    known = worst.p95 <= limits.marginal_deg
    yield from on_control(fit.regressor, covered, limits, known=known)
    yield from _on_unseen(fit, errors, residual, limits)
    yield from _on_bound(fit, errors, worst, seen, limits)
    yield from _on_shape(fit, residual, covered, limits, known=known)


def _on_unseen(
    fit: MotorFit,
    errors: tuple[HeadingError, ...],
    residual: FieldResidual,
    limits: Thresholds,
) -> Iterator[Finding]:
    at_top = error_at(errors, fit.u_high)
    claims = at_top.before > at_top.p95
    fall = _fall(residual)
    if claims and fall < 0.0:
        yield Finding(
            Grade.REJECTED,
            "on stretches it did not see, the new correction explains the field worse than the "
            f"one in force ({residual.held_out:.1f} instead of {residual.held_out_before:.1f} "
            "mGauss): something else than the motors disturbs this compass",
        )
    elif claims and fall < limits.improvement:
        yield Finding(
            Grade.MARGINAL,
            f"on stretches it did not see, the unexplained field falls only from "
            f"{residual.held_out_before:.1f} to {residual.held_out:.1f} mGauss",
        )


def _fall(residual: FieldResidual) -> float:
    """Share of the held-out field variation that the fit removes."""
    before = residual.held_out_before
    return 1.0 - residual.held_out / before if before > 0.0 else 0.0


def _on_bound(
    fit: MotorFit,
    errors: tuple[HeadingError, ...],
    worst: HeadingError,
    seen: tuple[Samples, Coverage],
    limits: Thresholds,
) -> Iterator[Finding]:
    samples, covered = seen
    if worst.p95 <= limits.good_deg:
        return
    tolerable = max(limits.marginal_deg, limits.lesser_evil * worst.before)
    tolerable = min(tolerable, limits.useless_deg)
    if fit.method == "sweep" and _of_motors(errors[0], error_at(errors, fit.u_high)) <= tolerable:
        yield _on_calibration_at_rest(worst, limits)
        return
    grade = Grade.MARGINAL if worst.p95 <= tolerable else Grade.REJECTED
    yield Finding(
        grade,
        f"the heading could still be wrong by {worst.p95:.1f}° at "
        f"{_quantity(fit, worst.u)}: {lacking(fit, samples, covered, worst.u)}",
    )


def _on_calibration_at_rest(worst: HeadingError, limits: Thresholds) -> Finding:
    """What a sweep leaves open where it knows the motors: hard and soft iron."""
    known = (
        "what the motors add is known, but the heading could still be wrong by "
        f"{worst.p95:.1f}° whatever they do: "
    )
    if worst.p95 > limits.useless_deg:
        return Finding(
            Grade.REJECTED,
            f"{known}the calibration in force does not fit the earth's field here, or nobody ever "
            "made one; calibrate the compass, then sweep again",
        )
    return Finding(
        Grade.MARGINAL,
        f"{known}a vehicle that stands still cannot show whether its calibration is right; fly, "
        "and turn all the way round",
    )


def _worst_flown(fit: MotorFit, errors: tuple[HeadingError, ...]) -> HeadingError:
    """The row of the largest bound from 0 to the largest control quantity seen."""
    flown = [row for row in errors if row.u < fit.u_high]
    return max((*flown, error_at(errors, fit.u_high)), key=lambda row: row.p95)


def _of_motors(rest: HeadingError, top: HeadingError) -> float:
    """The part of the bound that grows with the control quantity, degrees."""
    return float(np.sqrt(max(top.p95**2 - rest.p95**2, 0.0)))


def _on_shape(
    fit: MotorFit,
    residual: FieldResidual,
    covered: Coverage,
    limits: Thresholds,
    *,
    known: bool,
) -> Iterator[Finding]:
    if fit.method == "flight":
        yield from on_turn(covered, limits, known=known)
    if residual.held_out > limits.noise_share * fit.strength:
        yield Finding(
            Grade.MARGINAL if _fall(residual) > limits.worthwhile else Grade.REJECTED,
            f"{residual.held_out:.0f} mGauss of {fit.strength:.0f} stay unexplained: look for "
            "iron, loose wiring or other currents near this compass",
        )
    line = fit.line
    if line is not None and len(fit.levels) > 2:
        length = float(np.ptp(line.positions))
        noise = float(np.sqrt(np.mean([np.trace(lv.covariance) for lv in fit.levels])))
        if line.rms > limits.bends * length and line.rms > 2.0 * noise:
            yield Finding(
                Grade.MARGINAL,
                f"the shift does not follow a straight line ({line.rms:.1f} mGauss off a line of "
                f"{length:.0f}): the motors' wires may carry their currents unequally",
            )


def error_at(errors: tuple[HeadingError, ...], u: float) -> HeadingError:
    """The table at a control quantity, linearly between its rows."""
    grid = [row.u for row in errors]
    before, after, p95 = (
        float(np.interp(u, grid, [getattr(row, name) for row in errors]))
        for name in ("before", "after", "p95")
    )
    return HeadingError(u, before, after, p95)


def _quantity(fit: MotorFit, u: float) -> str:
    return quantity_of(fit.regressor).in_sentence(u)


def _summary(fit: MotorFit, errors: tuple[HeadingError, ...], residual: FieldResidual) -> str:
    at_top = error_at(errors, fit.u_high)
    where = _quantity(fit, at_top.u)
    unseen = (
        f"on stretches it did not see, the unexplained field goes from "
        f"{residual.held_out_before:.1f} to {residual.held_out:.1f} mGauss"
    )
    if fit.kept:
        return (
            f"the calibration in force stays: what this log shows is within {at_top.before:.1f}° "
            f"of it at {where}, and it is off by at most {at_top.p95:.1f}° (95 %)"
        )
    if at_top.before <= at_top.p95:
        return (
            f"the correction in force is already as good as this log can tell: at {where} it is "
            f"within {at_top.before:.1f}°, the fit within {at_top.p95:.1f}° (95 %); {unseen}"
        )
    return (
        f"at {where} the heading error falls from {at_top.before:.1f}° to at most "
        f"{at_top.p95:.1f}° (95 %); {unseen}"
    )
