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

from magcomp.align.sample import interpolate
from magcomp.model import (
    CURRENT,
    THROTTLE,
    Control,
    FloatArray,
    ParameterHistory,
    Recording,
    Series,
)

_MOTOR_FUNCTIONS = frozenset([*range(33, 41), *range(82, 86)])
_DEFAULT_MOTORS = 4
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
    duty = _duty(recording)
    if recording.current is not None and _varies(recording.current):
        found.append(Control(CURRENT, recording.current, "battery current"))
        if duty is not None:
            found.extend(_rebuilt(recording.current, duty, CURRENT, "battery current"))
    if recording.throttle is not None and _varies(recording.throttle):
        throttle = Series(recording.throttle.time, _mend_percent(recording.throttle.value))
        found.append(Control(THROTTLE, throttle, "reported throttle"))
        if duty is not None:
            thrust = _thrust(duty, recording)
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


def _motor_channels(parameters: ParameterHistory, outputs: Series) -> list[int]:
    """Indices of the outputs that drive motors: SERVOn_FUNCTION, else the first four."""
    by_function = [
        index
        for index in range(outputs.value.shape[1])
        if parameters.last(f"SERVO{index + 1}_FUNCTION", 0.0) in _MOTOR_FUNCTIONS
    ]
    channels = by_function or list(range(_DEFAULT_MOTORS))
    return [c for c in channels if c < outputs.value.shape[1] and outputs.value[:, c].any()]


def _duty(recording: Recording) -> Series | None:
    """Duty 0 … 1 of each motor, shape (n, motors), from its limits MOT_PWM_MIN and _MAX."""
    outputs = recording.outputs
    if outputs is None or len(outputs) < _LEAST_ROWS:
        return None
    channels = _motor_channels(recording.parameters, outputs)
    if not channels:
        return None
    low = recording.parameters.last("MOT_PWM_MIN", 0.0) or 1000.0
    high = recording.parameters.last("MOT_PWM_MAX", 0.0) or 2000.0
    if not high > low:
        return None
    driven = outputs.value[:, channels]
    duty = np.clip((driven - low) / (high - low), 0.0, 1.0)
    return Series(outputs.time, duty)


def _thrust(duty: Series, recording: Recording) -> Series | None:
    """Mean thrust demand of the motors: the inverse of the firmware's thrust curve.

    Notes
    -----
    AP_MotorsMulticopter: output = spin_min + (spin_max − spin_min) · c(thrust), with
    thrust = (1 − expo) · c + expo · c².
    """
    parameters = recording.parameters
    if not {"MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX"} <= parameters.names:
        return None
    expo = float(np.clip(parameters.last("MOT_THST_EXPO", 0.65), -1.0, 1.0))
    spin_min = parameters.last("MOT_SPIN_MIN", 0.15)
    spin_max = parameters.last("MOT_SPIN_MAX", 0.95)
    if not spin_max > spin_min:
        return None
    curve = np.clip((duty.value - spin_min) / (spin_max - spin_min), 0.0, 1.0)
    return Series(duty.time, np.mean((1 - expo) * curve + expo * curve**2, axis=1))


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
