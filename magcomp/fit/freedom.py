"""How much of a flight's fit to leave free: no more than the data determine and explain better."""

from __future__ import annotations

import numpy as np

from magcomp.fit.field_model import STRENGTH, lags_of, vertical_of
from magcomp.fit.flight import (
    GROUPS,
    FlightEstimate,
    Problem,
    correction_of,
    estimate,
    is_calibrated,
)
from magcomp.fit.folds import folds
from magcomp.fit.residual import residuals, spread
from magcomp.fit.robust import Estimate
from magcomp.model import OFFSET, FloatArray

WORTH = 1.1
"""A more open fit must lower the unexplained field by this factor to be believed.

A little is always gained: errors of the current move the readings along one direction, and a
soft iron that shrinks that direction seems to fit better.
"""

CLEAR = 1.5
"""Beyond this factor a look at held-out readings would only repeat what is plain."""

SHARP_OFFSET = 0.05
"""Opened offsets must be known to this share of the field's strength."""

LEAST_SOFT_IRON, MOST_SOFT_IRON = 0.6, 1.6
"""Soft iron of a compass that can be used at all has its eigenvalues between these."""

MOST_FREE = len(GROUPS)
QUICK = 2
"""Rounds of a search for what is compared only."""


def choose_freedom(problem: Problem) -> tuple[FlightEstimate, int]:
    """The least open fit that explains the field nearly as well as the most open admissible one.

    Admissible is what the data determine: see :func:`is_determined`. Candidates are compared at
    the lags of the most open fit; the chosen one estimates its own.
    """
    if not is_calibrated(problem.readings.in_force[-1].correction):
        return estimate(problem, MOST_FREE), MOST_FREE
    most, opened = _most_open(problem)
    least = _typical(opened.noise)
    for free in range(1, most):
        tried = estimate(
            problem,
            free,
            start=opened.parameters,
            hold_lags=True,
            errors=opened.errors,
            with_covariance=False,
            rounds=QUICK,
        )
        ratio = _typical(tried.noise) / least
        if ratio <= WORTH or (
            free == most - 1
            and ratio < CLEAR
            and not _pays_on_unseen(problem, (tried, free), (opened, most))
        ):
            return estimate(problem, free, start=tried.parameters, errors=opened.errors), free
    return opened, most


def _most_open(problem: Problem) -> tuple[int, FlightEstimate]:
    """The most open fit whose parameters the data determine.

    With motors alone where they determine no more, unless the data contradict the calibration in
    force: then the open fit stands with its wide covariance, for undetermined means unknown.
    """
    widest = estimate(problem, MOST_FREE)
    if is_determined(widest, problem.earth.strength):
        return MOST_FREE, widest
    for free in range(MOST_FREE - 1, 1, -1):
        found = estimate(problem, free)
        if is_determined(found, problem.earth.strength):
            return free, found
    closed = estimate(problem, 1)
    if _typical(closed.noise) > WORTH * _typical(widest.noise):
        return MOST_FREE, widest
    return 1, closed


def is_determined(found: Estimate, strength: float) -> bool:
    """Whether opened offsets and soft iron came out sharp and possible.

    A flight that hardly tilts cannot tell an offset along z from a soft iron along z; the
    solution then runs away along that valley.
    """
    offset_std = float(np.sqrt(np.max(np.diag(found.covariance)[OFFSET])))
    values = np.linalg.eigvalsh(correction_of(found).soft_iron)
    possible = values[0] > LEAST_SOFT_IRON and values[-1] < MOST_SOFT_IRON
    return bool(possible and offset_std < SHARP_OFFSET * strength)


def _typical(noise: FloatArray) -> float:
    return float(np.exp(np.mean(np.log(noise))))


def _pays_on_unseen(
    problem: Problem, closed: tuple[FlightEstimate, int], opened: tuple[FlightEstimate, int]
) -> bool:
    """Whether the open fit also predicts held-out readings better."""
    fold = folds(problem.readings.time)
    scores = []
    for found, free in (closed, opened):
        lags = lags_of(found.parameters)
        left = []
        for index in range(int(fold.max()) + 1):
            part = estimate(
                problem.where(fold != index),
                free,
                start=found.parameters,
                hold_lags=True,
                errors=found.errors,
                with_covariance=False,
            )
            unseen = problem.where(fold == index).sample(lags)
            left.append(
                residuals(
                    unseen,
                    correction_of(part),
                    float(part.parameters[STRENGTH]),
                    vertical_of(part.parameters),
                )
            )
        scores.append(spread(np.concatenate(left)))
    return scores[1] < scores[0]
