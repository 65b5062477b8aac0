"""Findings on the recording as a whole: the earth it shows, and whether one model holds it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from magcomp.fit import Problem
from magcomp.fit.flight import DIP_WIDTH
from magcomp.geometry import horizontal_part
from magcomp.judge.constancy import Departure, departures_of
from magcomp.judge.evidence import used_lags
from magcomp.judge.finding import Finding
from magcomp.judge.thresholds import TWO_SIDED_95, Thresholds
from magcomp.model import Grade, MotorFit, Readings, Samples, quantity_of

_WEAKEST_SHARE, _STRONGEST_SHARE = 0.35, 2.5
"""Hard iron of any size a compass still works with keeps its median field between these shares."""

_DIP_WIDTHS = 4.0

_TOO_FEW_FOR_A_LINE = 2

_ANEW_MGAUSS = 20.0
"""Offsets that jump so far were not learnt on the way."""


def on_earth(problem: Problem, samples: Samples, fit: MotorFit) -> Iterator[Finding]:
    """Whether strength and dip are the earth's."""
    expected = problem.earth.strength
    shown = float(np.median(np.linalg.norm(samples.present, axis=1)))
    if not _WEAKEST_SHARE < shown / expected < _STRONGEST_SHARE:
        yield Finding(
            Grade.REJECTED,
            f"the field has a strength of {shown:.0f} mGauss instead of {expected:.0f}: the "
            "compass reports in another unit, or something magnetic is right beside it",
        )
    dip, model = np.arcsin(np.clip(fit.vertical / fit.strength, -1, 1)), problem.earth.dip
    if fit.method != "sweep" and abs(np.sin(dip) - np.sin(model)) > _DIP_WIDTHS * DIP_WIDTH:
        yield Finding(
            Grade.REJECTED,
            f"the field dips by {np.degrees(dip):.0f}° instead of the {np.degrees(model):.0f}° "
            "that the world model gives for the log's position: the position is wrong, or the "
            "compass is not mounted as its orientation says",
        )


def on_constancy(
    problem: Problem, fit: MotorFit, limits: Thresholds, bound: float
) -> Iterator[Finding]:
    """Whether the shift is straight in the control quantity and alike throughout.

    A small step may be a sensor's usual drift, which the bound has in it already: it matters where
    bound and step together are more than a good fit may leave.
    """
    if fit.method == "sweep":
        return
    every = departures_of(problem, fit, used_lags(fit))
    found = [
        departure
        for departure in every
        if departure.is_plain and departure.degrees > _tolerated(departure, limits, bound)
    ]
    if found:
        # A step of one thing looks like a step of others: what explains most is what it is.
        likeliest = max(found, key=lambda d: d.gain)
        yield Finding(
            Grade.MARGINAL if likeliest.degrees < limits.marginal_deg else Grade.REJECTED,
            _words(likeliest, problem.control.kind) + _calibrated_anew(problem.readings),
        )
    elif fit.method == "levels" and len(fit.levels) == _TOO_FEW_FOR_A_LINE:
        yield from _on_two_levels(fit, every, limits, bound)


def _on_two_levels(
    fit: MotorFit, departures: tuple[Departure, ...], limits: Thresholds, bound: float
) -> Iterator[Finding]:
    """Whether a bend between two levels, through which a straight line always goes, is ruled out.

    The bow of a square between two levels is a quarter of what lies between them: more is no motor.
    """
    low, high = sorted(level.u for level in fit.levels)
    length = float(np.linalg.norm(fit.correction.vector)) * (high - low)
    horizontal = horizontal_part(fit.strength, fit.vertical)
    bow = float(np.degrees(length / 4.0 / horizontal))
    for each in departures:
        if each.kind == "curve":
            bow = min(bow, each.degrees + TWO_SIDED_95 * each.degrees_std)
    if np.hypot(bound, bow) > limits.good_deg:
        in_words = quantity_of(fit.regressor).in_sentence
        yield Finding(
            Grade.MARGINAL,
            f"only {in_words(low)} and {in_words(high)} were held, and nothing shows that the "
            f"shift follows a straight line between them: hold {in_words((low + high) / 2)} too, "
            "and turn as much there",
        )


def _tolerated(departure: Departure, limits: Thresholds, bound: float) -> float:
    """Degrees a departure may have beside a bound without being spoken of."""
    return limits.departure_deg if departure.kind == "curve" else limits.beside(bound)


def _calibrated_anew(readings: Readings) -> str:
    """In words, when another calibration came into force; nothing where none did.

    Offsets that are learnt in flight creep; they do not jump, and soft iron is not learnt.
    """
    for change in np.flatnonzero(np.diff(readings.stretch)):
        before, after = (readings.in_force[readings.stretch[change + k]].correction for k in (0, 1))
        jump = float(np.linalg.norm(after.offset - before.offset))
        if jump > _ANEW_MGAUSS or not np.array_equal(after.soft_iron, before.soft_iron):
            return (
                f"; at {readings.time[change + 1]:.0f} s another calibration came into force: "
                "where the flight of another aircraft begins there, fit each part by itself"
            )
    return ""


def _words(departure: Departure, kind: str) -> str:
    size = f"{departure.degrees:.0f}° ({departure.mgauss:.0f} mGauss)"
    moment = f"{departure.at_s:.0f} s"
    return {
        "curve": f"the shift does not follow a straight line in the {kind}: it bends by {size}, "
        "so one number an axis cannot cancel it",
        "step": f"the compass itself changed by {size} near {moment}: a payload, a gimbal or loose "
        "iron moved, or its calibration was changed unseen; fly with everything fixed",
        "motors": f"what the motors add changed by {size} near {moment}: a wire moved, or another "
        "load shares the battery",
        "place": f"the local field changed by {departure.mgauss:.0f} mGauss near {moment}: fly "
        "away from steel, buildings and the ground",
        "wander": f"the compass's own offset keeps moving, by {size}: a gimbal, a servo or loose "
        "iron near it, or a field that changes with place",
    }[departure.kind]
