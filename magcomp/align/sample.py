"""Readings at given lags: gravity, control quantity and raw field at the moment of measurement."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from magcomp.align.low_pass import low_pass
from magcomp.errors import MissingDataError
from magcomp.geometry import gravity_and_rate
from magcomp.model import (
    LEANS_S,
    Control,
    FloatArray,
    Lags,
    Readings,
    Samples,
    Series,
    interpolate,
    quantity_of,
)

_RATE_STEP_S = 0.05


def sample(
    readings: Readings, control: Control, in_force: Mapping[str, Control], lags: Lags
) -> Samples:
    """Samples of one compass at given lags.

    Parameters
    ----------
    readings
        From :func:`magcomp.align.readings`.
    control
        The regressor.
    in_force
        Control quantities by kind, to undo the motor corrections that were in force.
    lags
        Of the field behind the attitude and of the control quantity behind the field.

    Raises
    ------
    MissingDataError
        Where a motor correction was in force whose control quantity the recording lacks.

    Notes
    -----
    raw = soft_iron⁻¹ · (corrected − MOT · u) − OFS, undone
    as in docs/autopilots.md, ArduPilot: correction.
    """
    measured = readings.time - lags.field
    commanded = readings.time - lags.regressor
    attitude = interpolate(readings.attitude, measured)
    tilt = Series(readings.attitude.time, readings.attitude.value[:, :2])
    down, down_rate = gravity_and_rate(*attitude[:, :2].T, *_rate(tilt, measured).T)
    later = lags.regressor + readings.applied_later if lags.applied is None else lags.applied
    applied = readings.time - later
    raw, raw_rate = _undo(readings, in_force, applied)
    u = _columns(interpolate(control.series, commanded))
    return Samples(
        compass=readings.compass,
        lags=lags,
        time=readings.time,
        raw=raw,
        raw_rate=raw_rate,
        present=_as_now(readings, raw, in_force, applied),
        attitude=attitude,
        down=down,
        down_rate=down_rate,
        lean=_lean(readings, attitude[:, :2]),
        u=u,
        u_rate=_columns(_rate(control.series, commanded)),
        u_blur=_columns(interpolate(control.blurred, commanded)) - u,
        u_slow=_columns(interpolate(control.slow, commanded)) - u,
    )


def _lean(readings: Readings, tilt: FloatArray) -> FloatArray:
    """What acceleration does to attitude, shape (n, 4); see :attr:`magcomp.model.Samples.lean`.

    A multirotor accelerates where it leans, and its attitude filter takes the acceleration for
    gravity within seconds. A sum of a fast and a slow one comes near any in between, and near one
    that lets go again, as the vehicle does when its drag has caught up with its lean.
    """
    leaning = tilt - readings.usual_tilt
    step = readings.step
    return np.hstack([low_pass(leaning, step / (each + step)) for each in LEANS_S])


def _columns(values: FloatArray) -> FloatArray:
    """One number a row, shape (n,), as the column of a matrix; (n, k) stays."""
    return values[:, None] if values.ndim == 1 else values


def _rate(series: Series, time: FloatArray) -> FloatArray:
    later = interpolate(series, time + _RATE_STEP_S)
    return np.asarray((later - interpolate(series, time - _RATE_STEP_S)) / (2 * _RATE_STEP_S))


def _undo(
    readings: Readings, controls: Mapping[str, Control], applied: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Raw field and its change per second of regressor lag, both of shape (n, 3)."""
    if not readings.corrected:
        return readings.reported, np.zeros_like(readings.reported)
    if readings.told_offset is not None and readings.told_motor is not None:
        raw = _undo_told(readings, readings.told_offset, readings.told_motor)
        return raw, np.zeros_like(raw)
    raw = np.empty_like(readings.reported)
    raw_rate = np.zeros_like(raw)
    for index, stretch in enumerate(readings.in_force):
        rows = readings.stretch == index
        if not rows.any():
            continue
        field = readings.reported[rows]
        inverse = np.linalg.inv(stretch.correction.soft_iron)
        if stretch.regressor is not None:
            if stretch.regressor not in controls:
                raise MissingDataError(
                    f"A motor compensation by {stretch.regressor} was in force, so the log must "
                    f"hold the {stretch.regressor}; instead it holds none"
                    + quantity_of(stretch.regressor).how_to_have
                )
            series = controls[stretch.regressor].series
            series = Series(series.time, stretch.multiplied(series.value))
            added = stretch.correction.added
            field = field - added(interpolate(series, applied[rows]))
            # The derivative of −MOT·u(t − applied) by applied is +MOT·u̇.
            raw_rate[rows] = added(_rate(series, applied[rows])) @ inverse.T
        raw[rows] = field @ inverse.T - stretch.correction.offset
    return raw, raw_rate


def _undo_told(readings: Readings, told_offset: FloatArray, told_motor: FloatArray) -> FloatArray:
    """Raw field, shape (n, 3), where the log tells offset and motor correction of each reading."""
    raw = np.empty_like(readings.reported)
    for index, stretch in enumerate(readings.in_force):
        rows = readings.stretch == index
        if rows.any():
            inverse = np.linalg.inv(stretch.correction.soft_iron)
            raw[rows] = (readings.reported[rows] - told_motor[rows]) @ inverse.T - told_offset[rows]
    return raw


def _as_now(
    readings: Readings, raw: FloatArray, controls: Mapping[str, Control], applied: FloatArray
) -> FloatArray:
    """Every reading as the present correction would report it, shape (n, 3)."""
    present = readings.in_force[-1]
    field = readings.reported.copy()
    rows = readings.stretch != len(readings.in_force) - 1
    if not readings.corrected:
        rows[:] = True
    if readings.told_offset is not None:
        rows |= np.any(readings.told_offset != present.correction.offset, axis=1)
    if rows.any():
        u = np.zeros(int(rows.sum()))
        if present.regressor is not None and present.regressor in controls:
            u = present.multiplied(interpolate(controls[present.regressor].series, applied[rows]))
        field[rows] = present.correction.apply(raw[rows], u)
    return field
