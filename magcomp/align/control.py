"""Control quantities against time: what the autopilot would multiply a motor correction by.

Current and throttle arrive a few times a second, the throttle cut to whole per
cent. Motor outputs often arrive faster and finer. Where they do, the quantity
is rebuilt from them: by the autopilot's own thrust curve where that explains
the throttle, otherwise by regression of the reported quantity on the outputs.
A regression leaves an error that is independent of the rebuilt quantity, so it
does not bias a slope the way an error of interpolation does.
"""

from __future__ import annotations

import numpy as np

from magcomp import autopilots
from magcomp.align.sample import interpolate
from magcomp.autopilots.protocol import MotorOutputs
from magcomp.model import (
    CURRENT,
    SPEED_CONTROLLERS,
    THROTTLE,
    Control,
    FloatArray,
    Recording,
    Series,
)

_SHIFTS = np.arange(-0.2, 0.301, 0.02)
_TREND_S = 5.0
_LEAST_ROWS = 30
_LEAST_EXPLAINED = 0.8


def controls(recording: Recording) -> tuple[Control, ...]:
    """Every usable form of every control quantity of a recording, reported forms first.

    Returns
    -------
    tuple of Control
        Empty where the recording holds neither current nor throttle. Two forms of one kind
        are the same quantity, differently sampled; the fit decides which explains the field.
    """
    found: list[Control] = []
    motors = _motors(recording)
    duty = _duty(recording.outputs, motors)
    if recording.current is not None and _varies(recording.current):
        of_escs = recording.battery == SPEED_CONTROLLERS
        name = "the speed controllers' current" if of_escs else "battery current"
        found.append(Control(CURRENT, recording.current, name))
        if duty is not None:
            found.extend(_rebuilt(recording.current, duty, CURRENT, name))
    if recording.throttle is not None and _varies(recording.throttle):
        throttle = Series(recording.throttle.time, _mend_percent(recording.throttle.value))
        found.append(Control(THROTTLE, throttle, "reported throttle"))
        if duty is not None:
            thrust = _thrust(duty, motors)
            exact = thrust is not None and _explains(thrust, recording.throttle)
            if thrust is not None and exact:
                found.append(
                    Control(THROTTLE, thrust, "motor outputs through the autopilot's thrust curve")
                )
            else:
                found.extend(_rebuilt(throttle, duty, THROTTLE, "reported throttle"))
    return tuple(found)


def reported(found: tuple[Control, ...]) -> dict[str, Control]:
    """The first, that is the reported, form of each kind."""
    by_kind: dict[str, Control] = {}
    for control in found:
        by_kind.setdefault(control.kind, control)
    return by_kind


def _varies(series: Series) -> bool:
    return len(series) >= 2 and bool(np.ptp(series.value) > 0.0)


def _mend_percent(value: FloatArray) -> FloatArray:
    """Undo the mean of the cut to whole per cent; a throttle of 0 is 0."""
    whole = np.isclose(value * 100, np.rint(value * 100), atol=1e-6)
    return np.where((value > 0.0) & whole & (value < 1.0), value + 0.005, value)


def _duty(outputs: Series | None, motors: MotorOutputs | None) -> Series | None:
    """Duty 0 … 1 of each motor that is driven, shape (n, motors)."""
    if outputs is None or motors is None or len(outputs) < _LEAST_ROWS:
        return None
    channels = [c for c in motors.channels if outputs.value[:, c].any()]
    if not channels:
        return None
    driven = outputs.value[:, channels]
    duty = np.clip((driven - motors.low) / (motors.high - motors.low), 0.0, 1.0)
    return Series(outputs.time, duty)


def _motors(recording: Recording) -> MotorOutputs | None:
    if recording.outputs is None:
        return None
    count = recording.outputs.value.shape[1]
    return autopilots.of(recording).motor_outputs(recording.parameters, count)


def _thrust(duty: Series, motors: MotorOutputs | None) -> Series | None:
    """Mean thrust demand of the motors: the inverse of the firmware's thrust curve."""
    if motors is None or motors.curve is None:
        return None
    return Series(duty.time, np.mean(motors.curve.thrust(duty.value), axis=1))


def _explains(thrust: Series, throttle: Series) -> bool:
    """Whether the throttle, cut to whole per cent, is the thrust at nearly every moment."""
    moving = throttle.value > 0.0
    if np.count_nonzero(moving) < _LEAST_ROWS:
        return False
    excess = interpolate(thrust, throttle.time[moving]) - throttle.value[moving]
    inside = (excess > -0.004) & (excess < 0.014)
    return bool(np.mean(inside) > 0.8)


def _rebuilt(reference: Series, duty: Series, kind: str, name: str) -> list[Control]:
    """The reference regressed on powers of the duty, where the duty is sampled more often."""
    if len(reference) < _LEAST_ROWS:
        return []
    powers = np.stack([np.mean(duty.value**k, axis=1) for k in (1, 2, 3)], axis=1)
    features = Series(duty.time, powers)
    fits = [_regress(reference, features, shift) for shift in _SHIFTS]
    best = min(range(len(fits)), key=lambda k: fits[k][1])
    coefficients, cost = fits[best]
    if not cost < (1 - _LEAST_EXPLAINED) * float(np.var(reference.value)):
        return []
    modelled = coefficients[0] + powers @ coefficients[1:]
    series = Series(duty.time + _SHIFTS[best], modelled)
    left = reference.value - interpolate(series, reference.time)
    trend = _running_mean(Series(reference.time, left), _TREND_S)
    value = np.maximum(modelled + interpolate(trend, series.time), 0.0)
    return [Control(kind, Series(series.time, value), f"{name}, rebuilt from the motor outputs")]


def _regress(reference: Series, features: Series, shift: float) -> tuple[FloatArray, float]:
    """Robust coefficients at one shift in time, and the robust mean square they leave."""
    rows = np.column_stack([np.ones(len(reference)), interpolate(features, reference.time - shift)])
    weight = np.ones(len(reference))
    ridge = 1e-9 * np.eye(rows.shape[1]) * len(reference)
    for _ in range(4):
        weighted = rows * weight[:, None]
        coefficients = np.linalg.solve(rows.T @ weighted + ridge, weighted.T @ reference.value)
        left = reference.value - rows @ coefficients
        spread = 1.4826 * float(np.median(np.abs(left))) + 1e-3 * float(np.ptp(reference.value))
        weight = 1 / (1 + (left / (3 * spread)) ** 2)
    return np.asarray(coefficients), float(np.average(left**2, weights=weight))


def _running_mean(series: Series, half_width: float) -> Series:
    """Mean over a window in time, for what drifts slowly: battery sag, temperature."""
    total = np.concatenate([[0.0], np.cumsum(series.value)])
    first = np.searchsorted(series.time, series.time - half_width, side="left")
    last = np.searchsorted(series.time, series.time + half_width, side="right")
    return Series(series.time, (total[last] - total[first]) / (last - first))
