"""The flight's answer where something lasts: each belief about the calibration in force is tried.

How far a calibration in force may be off is not known: trusted, ordinary and none are each weighed
by how likely they make the data (docs/method.md, Flights).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from magcomp.fit.control_noise import Noise
from magcomp.fit.field_model import SLOW, lags_of, parameters_of, rows_of
from magcomp.fit.flight import (
    GROUPS,
    OPEN_OFFSET_MGAUSS,
    OPEN_SOFT_IRON,
    TRUSTED_OFFSET_MGAUSS,
    TRUSTED_SOFT_IRON,
    UNPROVEN_OFFSET_MGAUSS,
    UNPROVEN_SOFT_IRON,
    FlightEstimate,
    Problem,
    is_calibrated,
    is_physical,
    prior,
)
from magcomp.fit.robust import Prior
from magcomp.fit.wander import (
    Posterior,
    Rows,
    Wander,
    evidences,
    likeliest,
    mixed,
    posterior,
    reduced,
    weighed,
    weights_and_rest,
)
from magcomp.model import OFFSET, SOFT_IRON, FloatArray, MotorFit, Samples

_BELIEFS = (
    (4, OPEN_OFFSET_MGAUSS, OPEN_SOFT_IRON, 1.0),
    (3, UNPROVEN_OFFSET_MGAUSS, UNPROVEN_SOFT_IRON, 1.0),
    (1, TRUSTED_OFFSET_MGAUSS, TRUSTED_SOFT_IRON, 0.25),
)
"""Groups that move, how far offsets and soft iron of the calibration in force may be off, and how
often that is so: a calibration as good as the last is rare, and data that say little favour it."""

_SIZES_UNKNOWN = 1.08
"""Standard errors are wider by this, for the sizes of what wanders are themselves estimates."""

_SLOW_WIDTH = 0.1
"""Monitors smooth, and a quantity told seldom or rebuilt is flat: what varies within seconds may be
larger or smaller than told by about this share."""


def with_wander(problem: Problem, found: FlightEstimate, free: int) -> tuple[FlightEstimate, int]:
    """The same estimate with what wanders and drifts marginalised, and the groups that moved.

    How far a calibration in force may be off is not known: trusted, ordinary and none are each
    tried and weighed by how likely they make the data.

    Parameters
    ----------
    problem, found
        The data, and least squares' answer to begin at.
    free
        The groups that were open in it; they stand where no marginal solution is possible.
    """

    def rows_at(parameters: FloatArray) -> Rows:
        return _rows(problem.sample(lags_of(parameters)), parameters, found.errors)

    at = found.parameters
    rows = rows_at(at)
    # Weights made anew from each belief's own residuals would be no common measure of beliefs.
    weights = weights_and_rest(rows.time, rows.values)[0]
    first = reduced(rows, weights)
    calibrated = is_calibrated(problem.readings.in_force[-1].correction)
    beliefs = [
        (groups, _believed(problem, offset, soft_iron, is_open=groups == len(GROUPS)), share)
        for groups, offset, soft_iron, share in (_BELIEFS if calibrated else _BELIEFS[:1])
    ]
    wander = likeliest(first, beliefs[0][1], at)
    if free == 1 and not wander.shows:
        held = _believed(problem, TRUSTED_OFFSET_MGAUSS, 0.0, is_open=False)
        of_held, *others = evidences(first, wander, (held, *(b[1] for b in beliefs)), at)
        if of_held > max(others):
            # Least squares is less sensitive to a current that is wrong for seconds.
            return found, free
    each: dict[int, Posterior] = {}
    for groups, known, share in beliefs:
        one = posterior(
            lambda p: reduced(rows_at(p), weights), at, known, is_physical, wander, first
        )
        if one is not None:
            each[groups] = replace(one, evidence=one.evidence + float(np.log(share)))
    if not each:
        return found, free
    answer = mixed(each.values())
    likely = max(each, key=lambda groups: each[groups].evidence)
    if not is_physical(answer.parameters):
        answer = each[likely]
    covariance = _SIZES_UNKNOWN**2 * answer.covariance
    moved = 1 if likely == 1 else len(GROUPS)
    return replace(found, parameters=answer.parameters, covariance=covariance), moved


def wander_beside(samples: Samples, fit: MotorFit, problem: Problem) -> Wander:
    """What wanders and drifts beside a fit that was made without it.

    Parameters
    ----------
    samples
        Readings at the fit's lags.
    fit, problem
        What was found, and in what.
    """
    at = parameters_of(fit, fit.lags)
    return likeliest(weighed(_rows(samples, at, None)), prior(problem, len(GROUPS)), at)


def _rows(samples: Samples, parameters: FloatArray, errors: Noise | None) -> Rows:
    values, slopes, pulls = rows_of(samples, parameters, errors)
    return Rows(samples.time, values, slopes, pulls * float(np.std(samples.total)))


def _believed(problem: Problem, offset: float, soft_iron: float, *, is_open: bool) -> Prior:
    """The prior of a calibration that is off by so much, everything open."""
    known = prior(problem, len(GROUPS) if is_open else 1)
    width = known.width.copy()
    width[OFFSET], width[SOFT_IRON], width[SLOW] = offset, soft_iron, _SLOW_WIDTH
    return Prior(known.mean, width)
