"""Judging the calibration in force without fitting another one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from magcomp.fit import (
    Problem,
    centres_of_flight,
    departures,
    is_still,
    require_readings,
    spread,
)
from magcomp.geometry import body_from_earth, horizontal_part
from magcomp.judge.evidence import cover
from magcomp.judge.finding import Finding, severity
from magcomp.judge.gates import on_control, on_duration, on_turn, on_unseen_parameters
from magcomp.judge.heading_error import attitudes, largest_shift, present_by
from magcomp.judge.thresholds import TWO_SIDED_95, Thresholds
from magcomp.model import (
    Correction,
    FieldResidual,
    FloatArray,
    Grade,
    HeadingError,
    Level,
    Samples,
    Verdict,
    quantity_of,
)

_MAD_TO_STD = 1.4826
_BINS = 6


def judge_present(
    problem: Problem, thresholds: Thresholds | None = None, complaints: tuple[str, ...] = ()
) -> Verdict:
    """Judge the calibration in force.

    Parameters
    ----------
    problem
        A compass and the control quantity that its correction in force multiplies, or any
        where none is in force.
    thresholds
        The limits.
    complaints
        What is wrong with the sensors, in words: any of them rejects.

    Raises
    ------
    MissingDataError
        With too few readings.

    Notes
    -----
    At each level of the control quantity, what the reported field is off by on average, as one
    body-fixed vector, is turned into degrees: off the earth's field at the place, for what a
    median of the readings shows has in it what the motors add on the whole. A heading error that
    is the same at every level and changes neither strength nor dip cannot be seen this way.
    """
    limits = Thresholds() if thresholds is None else thresholds
    require_readings(problem.readings)
    samples = problem.sample(problem.usual_lags())
    in_force = problem.readings.in_force[-1]
    present = present_by(in_force, problem.in_force, samples)
    if present is not in_force.correction:
        # Told by one quantity, it must still correct every reading as the firmware did.
        samples = replace(samples, raw=present.undo(samples.present, samples.u))
    earth = (problem.earth.strength, problem.earth.vertical)
    left = departures(samples.present, samples.down, *earth)
    noise = max(_MAD_TO_STD * float(np.median(np.abs(left))), 0.2)
    still = is_still(samples)
    levels = (
        _still_levels(samples, present, noise)
        if still
        else centres_of_flight(samples, present, earth, noise, _BINS)
    )
    errors = tuple(_error(level, present, earth) for level in levels)
    unexplained = spread(left)
    covered = cover(samples, samples.present)
    found = _measured(errors, problem.control.kind, limits)
    known = found.grade is Grade.GOOD
    findings = [
        found,
        *(Finding(Grade.REJECTED, complaint) for complaint in complaints),
        *on_unseen_parameters(problem.readings.in_force[-1].unseen),
        *on_duration(covered, limits),
        *on_control(problem.control.kind, covered, limits, known=known),
        *(_on_stillness() if still else on_turn(covered, limits, known=False)),
    ]
    findings.sort(key=lambda finding: severity(finding.grade), reverse=True)
    return Verdict(
        grade=findings[0].grade,
        reasons=(
            *(finding.reason for finding in findings),
            f"of the field's {earth[0]:.0f} mGauss {unexplained:.1f} are not the earth's: motors, "
            "iron, noise",
        ),
        heading_error=errors,
        residual=FieldResidual(unexplained, unexplained, unexplained, unexplained),
        coverage=covered,
    )


def _on_stillness() -> tuple[Finding, ...]:
    return (
        Finding(
            Grade.MARGINAL,
            "a vehicle that stands still shows what its motors add, not whether its calibration "
            "is right: fly, and turn all the way round",
        ),
    )


def _still_levels(samples: Samples, present: Correction, noise: float) -> tuple[Level, ...]:
    """Mean departure of the field from its value at the lowest control quantity, as centres."""
    edges = np.linspace(samples.total.min(), samples.total.max(), _BINS + 1)
    bin_of = np.clip(np.searchsorted(edges, samples.total, side="right") - 1, 0, _BINS - 1)
    inverse = np.linalg.inv(present.soft_iron)
    rest = np.median(samples.present[bin_of == bin_of.min()], axis=0)
    levels = []
    for index in np.unique(bin_of):
        rows = bin_of == index
        u = float(np.mean(samples.total[rows]))
        delta = np.median(samples.present[rows], axis=0) - rest
        count = int(np.count_nonzero(rows))
        levels.append(
            Level(
                u=u,
                u_std=0.0,
                centre=present.centre(u) + inverse @ delta,
                covariance=noise**2 / count * inverse @ inverse.T,
                count=count,
            )
        )
    return tuple(levels)


def _error(level: Level, present: Correction, earth: tuple[float, float]) -> HeadingError:
    """Heading error that a level's departure from the present correction makes."""
    delta = present.soft_iron @ (level.centre - present.centre(level.u))
    covariance = present.soft_iron @ level.covariance @ present.soft_iron.T
    doubt = TWO_SIDED_95 * float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    size = float(np.linalg.norm(delta))
    direction: FloatArray = delta / size if size > 0 else np.array([1.0, 0.0, 0.0])
    found = _shift(delta, earth)
    return HeadingError(
        u=level.u, before=found, after=found, p95=_shift(direction * (size + doubt), earth)
    )


def _shift(delta: FloatArray, earth: tuple[float, float]) -> float:
    strength, vertical = earth
    roll, pitch, yaw = attitudes()
    horizontal = horizontal_part(strength, vertical)
    field = body_from_earth(roll, pitch, yaw) @ np.array([horizontal, 0.0, vertical])
    return largest_shift(field + delta, field, roll, pitch)


def _measured(errors: tuple[HeadingError, ...], kind: str, limits: Thresholds) -> Finding:
    if not errors:
        return Finding(
            Grade.REJECTED, "the recording is too short to judge the calibration in force"
        )
    worst = max(errors, key=lambda row: row.before)
    where = quantity_of(kind).in_sentence(worst.u)
    found = (
        f"with the calibration in force the heading is wrong by up to {worst.before:.1f}° at "
        f"{where} (at most {worst.p95:.1f}° with 95 %)"
    )
    if worst.before > limits.marginal_deg:
        return Finding(Grade.REJECTED, found)
    if worst.before > limits.good_deg or worst.p95 > limits.marginal_deg:
        return Finding(Grade.MARGINAL, found)
    return Finding(Grade.GOOD, found)
