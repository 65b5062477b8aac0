"""Which method, and which form of the control quantity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from magcomp.errors import FitRejectedError, MissingDataError, UsageError
from magcomp.fit.beliefs import wander_beside, with_wander
from magcomp.fit.combine import still_rows, with_sweep
from magcomp.fit.field_model import (
    FIELD_LAG,
    REGRESSOR_LAG,
    SIZE,
    STRENGTH,
    correction_at,
    errors_of,
    indices_of_correction,
    lags_of,
    parameters_of,
    vertical_of,
)
from magcomp.fit.flight import (
    GROUPS,
    FlightEstimate,
    Problem,
    correction_of,
    estimate,
    estimate_lags,
    near,
)
from magcomp.fit.freedom import MOST_FREE, QUICK, choose_freedom
from magcomp.fit.levels import (
    centres_of_flight,
    drift_of_centres,
    fit_levels,
    through_centres,
    usable_levels,
    with_line,
)
from magcomp.fit.motors import alike_where_unseen, differences_of, no_surer_than
from magcomp.fit.residual import residuals
from magcomp.fit.sweep import fit_sweep, is_still
from magcomp.model import (
    MOTOR,
    OFFSET,
    BoolArray,
    FloatArray,
    IntArray,
    Lags,
    MotorFit,
    Readings,
    Samples,
)

METHODS = ("auto", "sweep", "levels", "flight")

CERTAIN_MGAUSS = 0.5
"""A tenth of a degree of heading: which of two centres is known better does not matter below."""

CLEARLY_SURER = 1.5
"""Of two answers about as sure, the one that needs no attitude stands."""

LEAST_READINGS = 60


def fit(problem: Problem, method: str = "auto") -> MotorFit:
    """Fit one compass against one control quantity.

    Parameters
    ----------
    problem
        The data.
    method
        One of :data:`METHODS`.

    Raises
    ------
    UsageError
        For a method that does not exist.
    MissingDataError
        With too few readings.
    FitRejectedError
        Where the method asked for cannot work on these data.
    """
    if method not in METHODS:
        raise UsageError(
            f"The method must be one of {', '.join(METHODS)}; instead received {method}"
        )
    require_readings(problem.readings)
    samples = problem.sample(Lags())
    still = is_still(samples)
    if method == "sweep" and not still:
        raise FitRejectedError(
            "The method of sweeps needs the vehicle to stand still while the "
            f"{problem.control.kind} changes; instead it moved"
        )
    if method in ("auto", "sweep") and still:
        return fit_sweep(problem)
    by_one = problem.control.parts == 1
    if method == "levels" and not by_one:
        raise FitRejectedError(
            "The method of levels needs one current or throttle; instead received the current of "
            "each motor, which steady levels do not tell apart: use the method flight"
        )
    if method in ("auto", "levels") and by_one:
        rows, level = usable_levels(problem)
        count = len(np.unique(level))
        if count >= 2 and (method == "levels" or len(rows) > 0.4 * len(samples)):
            found = _drifting(problem, rows, level)
            top = float(np.quantile(samples.total, 0.98))
            if method == "levels" or _doubt_of_centre(found, top) <= CERTAIN_MGAUSS:
                return found
            return _surer(found, fit_flight(problem), top)
        if method == "levels":
            raise FitRejectedError(
                "The method of levels needs turns about all axes at two or more steady levels of "
                f"{problem.control.kind}; instead the log holds {count}"
            )
    return fit_flight(problem)


def require_readings(readings: Readings) -> None:
    """Refuse a compass with too few readings.

    Raises
    ------
    MissingDataError
        With fewer than ``LEAST_READINGS``.
    """
    if len(readings) < LEAST_READINGS:
        raise MissingDataError(
            f"Compass {readings.compass} must have at least {LEAST_READINGS} new readings; "
            f"instead it has {len(readings)}"
        )


def refit(problem: Problem, fit: MotorFit, keep: BoolArray) -> MotorFit:
    """The same fit, same method and same freedom, from a part of the readings.

    Parameters
    ----------
    problem, fit
        What was fitted and what came out.
    keep
        The readings to use, shape (n,).
    """
    part = problem.where(keep)
    if fit.method == "sweep":
        return fit_sweep(part, lag=fit.lags.regressor, drifts=False)
    if fit.method == "levels":
        rows, level = usable_levels(part)
        if len(np.unique(level)) < 2:
            return fit
        again = fit_levels(part, rows, level)[0]
        return replace(again, lags=fit.lags, lags_std=fit.lags_std, vertical=fit.vertical)
    return _updated(fit, near(part, _groups(fit), parameters_of(fit, fit.lags)))


def _surer(by_levels: MotorFit, by_flight: MotorFit, top: float) -> MotorFit:
    """Of two fits the one whose centre is better known where it is known least.

    Turns that hardly cover each level leave its ellipsoid's centre free; gravity then tells more.
    """
    if _doubt_of_centre(by_levels, top) <= CLEARLY_SURER * _doubt_of_centre(by_flight, top):
        return by_levels
    why = "gravity tells more of this log than the turns at steady levels alone"
    return replace(by_flight, why=f"{why}; {by_flight.why}")


def _doubt_of_centre(fit: MotorFit, top: float) -> float:
    """Standard error of the field's shift, mGauss, at rest or at the top, whichever is larger.

    The top is the recording's: levels may have been held up to a part of it only.
    """
    of_parameters = fit.covariance[: OFFSET.stop, : OFFSET.stop]
    doubts = []
    for u in (0.0, top):
        shift = np.hstack([u * np.eye(3), fit.correction.soft_iron])
        doubts.append(float(np.sqrt(np.trace(shift @ of_parameters @ shift.T))))
    return max(doubts)


def _drifting(problem: Problem, rows: Samples, level: IntArray) -> MotorFit:
    """The levels' fit with lags, and with what the sensor drifts from level to level."""
    bare, ellipsoids = fit_levels(problem, rows, level)
    bare = _with_lags(problem, bare)
    samples = problem.sample(bare.lags)
    turned = samples.where(np.isin(samples.time, rows.time))
    drift = drift_of_centres(rows.time, level, wander_beside(turned, bare, problem))
    found = through_centres(problem, rows, level, ellipsoids.drifting(drift))
    return replace(found, lags=bare.lags, lags_std=bare.lags_std, vertical=bare.vertical)


def _with_lags(problem: Problem, fit: MotorFit) -> MotorFit:
    lags, std = estimate_lags(problem, fit.correction)
    rows = problem.sample(lags)
    vertical = np.median(residuals(rows, fit.correction, 0.0, 0.0)[:, 1])
    return replace(fit, lags=lags, lags_std=std, vertical=float(vertical))


def fit_flight(problem: Problem) -> MotorFit:
    """Fit a flight, opening as many groups of parameters as the data deserve.

    A sweep on the ground in the same recording is fitted by itself, and the two are put together.
    """
    still = still_rows(problem.sample(Lags())) if problem.control.parts == 1 else None
    flown = problem if still is None else problem.where(~still)
    plain, opened = choose_freedom(flown)
    found, free = with_wander(flown, plain, opened)
    tell = differences_of(len(found.parameters))
    told_apart = np.empty((0, 0))
    if len(tell):
        stretch = no_surer_than(plain, found)
        told_apart = tell @ stretch @ found.covariance @ stretch.T @ tell.T
        found = alike_where_unseen(found, stretch, problem.control.unsure)
    bare = replace(_of_flight(problem, found, free), told_apart=told_apart)
    if still is not None:
        bare = with_sweep(bare, fit_sweep(problem.where(still)))
    samples = problem.sample(bare.lags)
    centres = centres_of_flight(
        samples, bare.correction, (bare.strength, bare.vertical), bare.noise
    )
    return with_line(bare, centres)


def fit_alike(problem: Problem, fit: MotorFit) -> MotorFit:
    """A flight against another control quantity with the freedom of a fit that exists.

    To be compared with that fit on held-out readings, at a tenth of the price of a fit of its own:
    it has no covariance and no centres.

    Parameters
    ----------
    problem
        The other control quantity, and the readings of the fit.
    fit
        Of a flight.
    """
    free = _groups(fit)
    begin = parameters_of(fit, fit.lags)
    # The same field from another quantity: so much per unit that its range gives what the other's.
    of_range = float(np.quantile(problem.control.total.value, 0.98)) or 1.0
    begin[MOTOR] *= fit.u_high / of_range
    begin[SIZE:] = 0.0
    # Near enough for the sizes of the errors.
    found = estimate(problem, free, start=begin, with_covariance=False, rounds=1)
    errors = errors_of(problem.sample(lags_of(found.parameters)), found.parameters)
    found = estimate(
        problem, free, start=found.parameters, errors=errors, with_covariance=False, rounds=QUICK
    )
    return _of_flight(problem, found, free)


def _of_flight(problem: Problem, found: FlightEstimate, free: int) -> MotorFit:
    lags = lags_of(found.parameters)
    samples = problem.sample(lags)
    std = np.sqrt(np.diag(found.covariance))
    among = indices_of_correction(len(found.parameters))
    return MotorFit(
        compass=samples.compass,
        method="flight",
        why=_why(free),
        regressor=problem.control.kind,
        origin=problem.control.origin,
        correction=correction_of(found),
        covariance=found.covariance[np.ix_(among, among)],
        free=frozenset(GROUPS[:free]),
        lags=lags,
        lags_std=Lags(float(std[FIELD_LAG]), float(std[REGRESSOR_LAG])),
        strength=float(found.parameters[STRENGTH]),
        vertical=vertical_of(found.parameters),
        noise=float(np.sqrt(np.mean(found.noise**2))),
        levels=(),
        line=None,
        u_low=float(np.quantile(samples.total, 0.02)),
        u_high=float(np.quantile(samples.total, 0.98)),
        count=len(samples),
        numbers=problem.control.numbers,
    )


def _why(free: int) -> str:
    if free == 1:
        return "the calibration in force explains the field but for the motors"
    opened = {2: "offsets", 3: "offsets and soft-iron diagonal", 4: "offsets and soft iron"}[free]
    return f"the calibration in force does not explain the field: {opened} were fitted too"


def _groups(fit: MotorFit) -> int:
    return sum(1 for group in GROUPS if group in fit.free)


def _updated(fit: MotorFit, parameters: FloatArray) -> MotorFit:
    return replace(
        fit,
        correction=correction_at(parameters),
        strength=float(parameters[STRENGTH]),
        vertical=vertical_of(parameters),
    )


def best_form(problems: Sequence[Problem]) -> Problem:
    """Of several forms of one control quantity the one that explains the field best.

    Parameters
    ----------
    problems
        The same readings against each form; at least one.
    """
    if len(problems) == 1:
        return problems[0]
    if is_still(problems[0].sample(Lags())):
        return min(problems, key=lambda p: fit_sweep(p, drifts=False).noise)
    return min(problems, key=lambda p: estimate(p, MOST_FREE, with_covariance=False).cost)
