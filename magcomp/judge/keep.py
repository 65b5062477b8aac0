"""Whether the calibration in force stays: a fit that cannot tell itself from it is no better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from magcomp.model import MOTOR, Correction, FloatArray, HeadingError, MotorFit, pack

CLOSE = 0.6
"""The calibration in force stays where it is off by less than this share of the fit's own bound."""

_CHI2_95_OF_3 = 7.81


def is_close(fit: MotorFit, present: Correction, errors: Sequence[HeadingError]) -> bool:
    """Whether the data cannot tell the calibration in force from the fit.

    Parameters
    ----------
    fit
        With its covariance as the judge widened it.
    present
        The correction in force, against the fit's own control quantity.
    errors
        The fit's table of heading errors.

    Notes
    -----
    A sweep knows the motors far better than all else, so its bound as a whole says nothing about
    them; a sweep is never set aside.
    """
    if fit.method == "sweep":
        return False
    flown = [row for row in errors if row.u <= max(fit.u_high, errors[1].u)]
    return all(row.before <= CLOSE * row.p95 for row in flown) and _is_likely(fit, present.vector)


def _is_likely(fit: MotorFit, motor: FloatArray) -> bool:
    """Whether the motor vector in force lies within what the fit allows."""
    apart = motor - fit.correction.vector
    inverse = np.linalg.pinv(fit.shared_covariance[MOTOR, MOTOR], hermitian=True)
    return float(apart @ inverse @ apart) <= _CHI2_95_OF_3


def keep(fit: MotorFit, present: Correction) -> MotorFit:
    """The fit with the correction in force as its answer.

    Its covariance grows by the distance to what was fitted, so that standard errors are those of
    what is written.
    """
    apart = pack(present) - pack(fit.correction)
    return replace(
        fit,
        correction=present,
        covariance=fit.covariance + np.outer(apart, apart),
        kept=True,
        why="the data cannot tell the calibration in force from a better one, so it stays",
    )
