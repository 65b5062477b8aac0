"""From field to degrees: what a correction leaves of heading error, and how sure that is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from magcomp.fit.nearest import moved, nearest
from magcomp.geometry import (
    body_from_earth,
    heading_shift,
    horizontal_part,
    level_matrix,
    wrap_angle,
)
from magcomp.model import (
    CORRECTION_SIZE,
    MOTOR,
    OFFSET,
    SOFT_IRON,
    Control,
    Correction,
    FloatArray,
    HeadingError,
    InForce,
    MotorFit,
    Samples,
    interpolate,
    quantity_of,
    symmetric,
)

TILT_RAD = np.radians(20.0)
"""Heading errors are given level and at this tilt, whichever is larger."""

_YAWS = np.radians(np.arange(0.0, 360.0, 10.0))
_DRAWS = 400
_TURNING_STEPS = 5


def attitudes() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Roll, pitch and yaw of a full turn level and tilted four ways, radians, shape (k,) each."""
    tilts = [(0.0, 0.0), (TILT_RAD, 0.0), (-TILT_RAD, 0.0), (0.0, TILT_RAD), (0.0, -TILT_RAD)]
    roll, pitch = (np.repeat([tilt[axis] for tilt in tilts], len(_YAWS)) for axis in (0, 1))
    return roll, pitch, np.tile(_YAWS, len(tilts))


def control_grid(fit: MotorFit) -> FloatArray:
    """Control quantities a table of heading errors is given at."""
    return quantity_of(fit.regressor).rows(fit.u_high)


def multiplied_in_force(
    u: FloatArray,
    kind: str | None,
    fit: MotorFit,
    controls: Mapping[str, Control],
    samples: Samples,
) -> FloatArray:
    """What the motor correction in force multiplies at each control quantity, shape (k,).

    Parameters
    ----------
    u
        Of the fit, shape (k,).
    kind
        The control quantity that the correction in force multiplies; None where it is off.
    fit, samples
        The fit, and the readings at its lags.
    controls
        The control quantities as the autopilot reported them.

    Notes
    -----
    Another quantity than the fit's own is taken as a straight line of it, as the recording shows.
    """
    if kind in (None, fit.regressor) or kind not in controls or controls[kind].parts > 1:
        return u
    other = interpolate(controls[kind].series, samples.time - samples.lags.regressor)
    slope, intercept = np.polyfit(samples.total, other, 1)
    return np.asarray(np.maximum(intercept + slope * u, 0.0))


def present_by(present: InForce, controls: Mapping[str, Control], samples: Samples) -> Correction:
    """The correction in force; one motor by motor as the nearest by the fit's own quantity.

    Parameters
    ----------
    present
        What is in force.
    controls, samples
        As for :func:`multiplied_in_force`.
    """
    known = controls.get(present.regressor or "")
    if known is None or known.parts == 1:
        return present.correction
    then = samples.time - samples.lags.regressor
    added = present.correction.added(present.multiplied(interpolate(known.series, then)))
    return moved(present.correction, nearest(added, samples.total[:, None])[0])


def heading_errors(
    fit: MotorFit,
    present: Correction,
    present_u: FloatArray,
    rng: np.random.Generator,
    *,
    applied: Correction | None = None,
) -> tuple[HeadingError, ...]:
    """Largest heading error over all yaws, level and tilted, by control quantity.

    Parameters
    ----------
    fit
        Its correction is taken as the truth for ``before``; its covariance makes ``after``.
    present
        The correction in force.
    present_u
        What ``present``'s motor vector is multiplied by at each control quantity of
        :func:`control_grid`, shape (k,).
    rng
        For the draws from the covariance.
    applied
        ``after`` and ``p95`` of this correction, where something else than the fit will correct:
        the one in force where it is left as it is, or what a firmware makes of the fit.

    Notes
    -----
    ``before`` is exact; ``after`` and ``p95`` use the first-order shift of docs/method.md,
    Equation 7, on draws of all 12 parameters.
    """
    roll, pitch, yaw = attitudes()
    field = _field_at(fit, roll, pitch, yaw)
    draws = rng.standard_normal((_DRAWS, CORRECTION_SIZE)) @ _root(fit.shared_covariance)
    inverse = np.linalg.inv(fit.correction.soft_iron)
    rows = []
    for u, u_present in zip(control_grid(fit), present_u, strict=True):
        raw = (field - u * fit.correction.vector) @ inverse.T - fit.correction.offset
        before = present.apply(raw, np.full(len(raw), u_present))
        slopes = _shift_slopes(field, raw + fit.correction.offset, roll, pitch, u, fit)
        off = shifts(before, field, roll, pitch)
        beside = np.zeros(len(raw))
        if applied is not None:
            beside = shifts(applied.apply(raw, np.full(len(raw), u)), field, roll, pitch)
        largest = np.abs(draws @ slopes.T + beside).max(axis=1)
        rows.append(
            HeadingError(
                u=float(u),
                before=float(np.degrees(np.abs(off).max())),
                after=min(float(np.degrees(np.median(largest))), 180.0),
                p95=min(float(np.degrees(np.quantile(largest, 0.95))), 180.0),
            )
        )
    return tuple(rows)


def turning(fit: MotorFit) -> FloatArray:
    """What deviations of the 12 parameters cost over the control quantities flown.

    Returns
    -------
    ndarray, shape (12, 12)
        A deviation d turns the heading by d · turning · d, mean square, radians², over all yaws,
        level and tilted, from no control quantity to the largest flown (at least the first step
        of :func:`control_grid`).
    """
    roll, pitch, yaw = attitudes()
    field = _field_at(fit, roll, pitch, yaw)
    inverse = np.linalg.inv(fit.correction.soft_iron).T
    found = np.zeros((CORRECTION_SIZE, CORRECTION_SIZE))
    steps = np.linspace(0.0, max(fit.u_high, float(control_grid(fit)[1])), _TURNING_STEPS)
    for u in steps.tolist():
        centred = (field - u * fit.correction.vector) @ inverse
        slopes = _shift_slopes(field, centred, roll, pitch, u, fit)
        found += slopes.T @ slopes
    return found / (len(field) * len(steps))


def _root(covariance: FloatArray) -> FloatArray:
    """The symmetric square root, shape (k, k): an eigenvector's sign, which is chance, cancels."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def variance_shares(fit: MotorFit, u: float) -> dict[str, float]:
    """Variance of the heading that each group of parameters makes at ``u``, where it is largest.

    Returns
    -------
    dict
        Square radians by ``"motor"``, ``"offset"`` and ``"soft iron"``.
    """
    roll, pitch, yaw = attitudes()
    field = _field_at(fit, roll, pitch, yaw)
    centred = (field - u * fit.correction.vector) @ np.linalg.inv(fit.correction.soft_iron).T
    slopes = _shift_slopes(field, centred, roll, pitch, u, fit)
    covariance = fit.shared_covariance
    worst = slopes[int(np.argmax(np.einsum("ki,ij,kj->k", slopes, covariance, slopes)))]
    groups = {"motor": MOTOR, "offset": OFFSET, "soft iron": SOFT_IRON}
    return {
        name: float(worst[part] @ covariance[part, part] @ worst[part])
        for name, part in groups.items()
    }


def level_errors(fit: MotorFit, present: Correction, u: float, present_u: float) -> FloatArray:
    """Heading error of the correction in force over a level turn, at one control quantity.

    Parameters
    ----------
    fit
        Its correction is taken as the truth.
    present
        The correction in force.
    u, present_u
        The control quantity, and what ``present.motor`` is multiplied by there.

    Returns
    -------
    ndarray, shape (36,)
        Heading found less true heading, radians, at true headings 0°, 10° … 350°.
    """
    roll = np.zeros_like(_YAWS)
    field = _field_at(fit, roll, roll, _YAWS)
    raw = fit.correction.undo(field, np.full(len(field), u))
    return shifts(present.apply(raw, np.full(len(raw), present_u)), field, roll, roll)


def _field_at(fit: MotorFit, roll: FloatArray, pitch: FloatArray, yaw: FloatArray) -> FloatArray:
    """The earth's field as found, in body axes at each attitude, mGauss, shape (k, 3)."""
    horizontal = horizontal_part(fit.strength, fit.vertical)
    earth = np.array([horizontal, 0.0, fit.vertical])
    return np.asarray(body_from_earth(roll, pitch, yaw) @ earth)


def apart_at_rest(fit: MotorFit, other: Correction) -> float:
    """Largest heading error, degrees, of another correction with the motors off, by this fit.

    Parameters
    ----------
    fit
        Its correction is taken as the truth.
    other
        By whatever control quantity: at rest each is 0.
    """
    roll, pitch, yaw = attitudes()
    field = _field_at(fit, roll, pitch, yaw)
    off = np.zeros((len(field), fit.correction.motor.shape[1]))
    raw = fit.correction.undo(field, off)
    return largest_shift(other.apply(raw, np.zeros(len(raw))), field, roll, pitch)


def largest_shift(
    found: FloatArray, true: FloatArray, roll: FloatArray, pitch: FloatArray
) -> float:
    """Largest difference of heading between two fields, degrees.

    Examples
    --------
    >>> north, askew = np.array([[200.0, 0.0, 400.0]]), np.array([[200.0, 200.0, 400.0]])
    >>> largest_shift(askew, north, np.zeros(1), np.zeros(1))
    45.0
    """
    return float(np.degrees(np.abs(shifts(found, true, roll, pitch)).max()))


def shifts(found: FloatArray, true: FloatArray, roll: FloatArray, pitch: FloatArray) -> FloatArray:
    """Difference of heading between two fields at each attitude, radians, shape (k,)."""
    level = level_matrix(roll, pitch)
    found, true = (np.einsum("kij,kj->ki", level, f) for f in (found, true))
    shift = np.arctan2(-found[:, 1], found[:, 0]) - np.arctan2(-true[:, 1], true[:, 0])
    return np.asarray(wrap_angle(shift))


def _shift_slopes(
    field: FloatArray,
    centred: FloatArray,
    roll: FloatArray,
    pitch: FloatArray,
    u: float,
    fit: MotorFit,
) -> FloatArray:
    """Change of heading per unit of each of the 12 parameters, radians, shape (k, 12)."""
    slopes = np.empty((len(field), CORRECTION_SIZE))
    for index in range(3):
        unit = np.eye(3)[index]
        slopes[:, index] = heading_shift(np.tile(u * unit, (len(field), 1)), field, roll, pitch)
        column = np.tile(fit.correction.soft_iron[:, index], (len(field), 1))
        slopes[:, OFFSET.start + index] = heading_shift(column, field, roll, pitch)
    for index in range(6):
        moved = centred @ symmetric(np.eye(6)[index]).T
        slopes[:, SOFT_IRON.start + index] = heading_shift(moved, field, roll, pitch)
    return slopes
