"""The evidence before the judge: what is left unexplained on unseen data, and what was covered."""

from __future__ import annotations

import numpy as np

from magcomp.errors import FitRejectedError
from magcomp.fit import Problem, departures, folds, refit, residuals, spread
from magcomp.geometry import heading
from magcomp.model import Coverage, FieldResidual, FloatArray, Lags, MotorFit, Samples, median

_SPHERE_BANDS, _SPHERE_SECTORS = 6, 12
_HEADING_SECTORS = 24
_GAP_S = 2.0
_IDLE_SHARE = 0.05
_LEAST_FOLDS = 3


def used_lags(fit: MotorFit) -> Lags:
    """The lags of a fit, 0 where its method cannot see one."""
    return Lags(
        0.0 if np.isnan(fit.lags.field) else fit.lags.field,
        0.0 if np.isnan(fit.lags.regressor) else fit.lags.regressor,
        fit.lags.applied,
    )


def field_residual(problem: Problem, fit: MotorFit) -> tuple[FieldResidual, FloatArray]:
    """Unexplained field before, after and held out, and the correction's scatter between folds.

    Returns
    -------
    FieldResidual
        Lengths of the residual rows: strength and vertical part, or all three components where
        the vehicle stood still.
    ndarray, shape (folds, 3)
        The motor vector found without each fold, mGauss per unit.
    """
    samples = problem.sample(used_lags(fit))
    fold = folds(samples.time)
    left, motors, before_left = [], [], []
    for index in range(int(fold.max()) + 1):
        unseen = samples.where(fold == index)
        seen = samples.where(fold != index)
        if not len(unseen) or len(seen) < 3:
            continue
        try:
            part = refit(problem, fit, fold != index)
        except FitRejectedError:
            continue
        left.append(_left(part, seen, unseen))
        before_left.append(_left_before(fit, seen, unseen))
        motors.append(part.correction.vector)
    if len(motors) < _LEAST_FOLDS:
        raise FitRejectedError(
            f"A fit needs at least {_LEAST_FOLDS} stretches that can be held out in turn; instead "
            f"compass {fit.compass} has {len(motors)}: record longer, with the "
            f"{problem.control.kind} changing throughout"
        )
    return (
        FieldResidual(
            before=spread(_left_before(fit, samples, samples)),
            after=spread(_left(fit, samples, samples)),
            held_out=spread(np.concatenate(left)),
            held_out_before=spread(np.concatenate(before_left)),
        ),
        np.stack(motors),
    )


def _left(fit: MotorFit, seen: Samples, unseen: Samples) -> FloatArray:
    """Residual rows on unseen readings with a fit made from the seen ones."""
    if fit.method == "sweep":
        constant = np.median(fit.correction.apply(seen.raw, seen.u), axis=0)
        return np.asarray(fit.correction.apply(unseen.raw, unseen.u) - constant)
    return residuals(unseen, fit.correction, fit.strength, fit.vertical)


def _left_before(fit: MotorFit, seen: Samples, unseen: Samples) -> FloatArray:
    """The same with the correction in force and the constants that suit it best."""
    if fit.method == "sweep":
        return np.asarray(unseen.present - np.median(seen.present, axis=0))
    middle = median(departures(seen.present, seen.down, 0.0, 0.0))
    return departures(unseen.present, unseen.down, float(middle[0]), float(middle[1]))


def cover(samples: Samples, corrected: FloatArray) -> Coverage:
    """What the readings cover of attitude, heading and control quantity.

    Parameters
    ----------
    samples
        Readings.
    corrected
        Their field by the best correction there is, mGauss, shape (n, 3).
    """
    yaw = _field_heading(corrected, samples)
    tilt = np.degrees(np.arccos(np.clip(samples.down[:, 2], -1.0, 1.0)))
    steps, total = np.diff(samples.time), samples.total
    return Coverage(
        sphere=_sphere_share(corrected),
        heading=len(np.unique(np.floor(yaw / (2 * np.pi) * _HEADING_SECTORS))) / _HEADING_SECTORS,
        tilt_deg=float(np.quantile(tilt, 0.98)),
        u_low=float(np.quantile(total, 0.02)),
        u_high=float(np.quantile(total, 0.98)),
        seconds=float(np.sum(steps[steps < _GAP_S])),
        u_median=_at_work(total),
    )


def _at_work(total: FloatArray) -> float:
    """Control quantity in use half of the time the motors worked."""
    working = total[total >= _IDLE_SHARE * total.max()]
    # A current told with the wrong sign is never near the largest there is.
    return float(np.median(working if len(working) else total))


def _field_heading(corrected: FloatArray, samples: Samples) -> FloatArray:
    """Magnetic heading of each reading, 0 … 2π."""
    angle = heading(corrected, samples.attitude[:, 0], samples.attitude[:, 1])
    return np.asarray(np.mod(angle, 2 * np.pi))


def _sphere_share(corrected: FloatArray) -> float:
    """Share of equal-area cells of the sphere that the field's direction visited."""
    unit = corrected / np.maximum(np.linalg.norm(corrected, axis=1, keepdims=True), 1e-9)
    band = np.floor((unit[:, 2] + 1) / 2 * _SPHERE_BANDS).clip(0, _SPHERE_BANDS - 1)
    angle = np.arctan2(unit[:, 1], unit[:, 0]) + np.pi
    sector = np.floor(angle / (2 * np.pi) * _SPHERE_SECTORS).clip(0, _SPHERE_SECTORS - 1)
    return len(np.unique(band * _SPHERE_SECTORS + sector)) / (_SPHERE_BANDS * _SPHERE_SECTORS)
