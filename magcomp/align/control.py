"""Control quantities against time: what the autopilot would multiply a motor correction by.

Current and throttle arrive a few times a second, the throttle cut to whole per
cent. Motor outputs often arrive faster and finer. Where they do, the quantity
is rebuilt from them: by the autopilot's own thrust curve where that explains
the throttle, otherwise by regression of the reported quantity on the outputs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from magcomp import autopilots
from magcomp.align.rebuilt import LEAST_ROWS, Rebuilt, rebuild
from magcomp.autopilots.terms import MotorOutputs
from magcomp.model import (
    CURRENT,
    SPEED_CONTROLLERS,
    THROTTLE,
    BoolArray,
    Control,
    FloatArray,
    Recording,
    Series,
    interpolate,
)

_FINER = 4.0
_CUT_SHARE = 0.1


class Duty(NamedTuple):
    """How hard each motor is driven.

    Attributes
    ----------
    series
        Duty 0 … 1, shape (n, k).
    numbers
        Of which motor each column is, as the firmware counts them.
    channels
        From which output, counted from 0.
    """

    series: Series
    numbers: tuple[int, ...]
    channels: tuple[int, ...]


def controls(recording: Recording) -> tuple[Control, ...]:
    """Every usable form of every control quantity of a recording, reported forms first.

    Returns
    -------
    tuple of Control
        Empty where the recording holds neither current nor throttle. Two forms of one kind
        are the same quantity, differently sampled; the fit decides which explains the field.
    """
    found: list[Control] = []
    motors = motors_of(recording)
    duty = _duty(recording.outputs, motors)
    if recording.current is not None and _varies(recording.current):
        of_escs = recording.battery == SPEED_CONTROLLERS
        name = "the speed controllers' current" if of_escs else "battery current"
        found.append(Control(CURRENT, recording.current, name))
        rebuilt = [
            rebuild(recording.current, features, CURRENT, f"{name}, rebuilt from the {source}")
            for features, source in _finer(recording, duty)
        ]
        found.extend(_best(rebuilt))
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
                name = "reported throttle, rebuilt from the motor outputs"
                found.extend(_best([rebuild(throttle, duty, THROTTLE, name)]))
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
    if outputs is None or motors is None or len(outputs) < LEAST_ROWS:
        return None
    runs = _running(outputs, motors)
    if not runs.any():
        return None
    channels = np.array(motors.channels)[runs]
    driven = outputs.value[:, channels]
    duty = np.clip((driven - motors.low) / (motors.high - motors.low), 0.0, 1.0)
    return Series(outputs.time, duty)


def duty_of(recording: Recording) -> Duty | None:
    """How hard each motor is driven; None where the recording does not tell."""
    motors = motors_of(recording)
    duty = _duty(recording.outputs, motors)
    if recording.outputs is None or motors is None or duty is None:
        return None
    numbers = motors.numbers or tuple(range(1, len(motors.channels) + 1))
    runs = _running(recording.outputs, motors)
    driven = [
        (number, channel)
        for number, channel, does in zip(numbers, motors.channels, runs, strict=True)
        if does
    ]
    return Duty(duty, *(tuple(each) for each in zip(*driven, strict=True)))


def _running(outputs: Series, motors: MotorOutputs) -> BoolArray:
    """Which of the motors' channels are driven at all."""
    return np.asarray(outputs.value[:, list(motors.channels)].any(axis=0))


def motors_of(recording: Recording) -> MotorOutputs | None:
    """Which outputs drive motors, and how; None where the recording or its firmware tell none."""
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
    if np.count_nonzero(moving) < LEAST_ROWS:
        return False
    excess = interpolate(thrust, throttle.time[moving]) - throttle.value[moving]
    inside = (excess > -0.004) & (excess < 0.014)
    return bool(np.mean(inside) > 0.8)


def _finer(recording: Recording, duty: Series | None) -> list[tuple[Series, str]]:
    """What the current can be rebuilt from, shape (n, k) each, and what it is in words.

    A throttle cut to whole per cent, or told no more often than the current, is no help.
    """
    found = [] if duty is None else [(duty, "motor outputs")]
    current, throttle = recording.current, recording.throttle
    if current is None or throttle is None or len(throttle) < LEAST_ROWS:
        return found
    cut = float(np.mean(_mend_percent(throttle.value) != throttle.value)) > _CUT_SHARE
    often = float(np.median(np.diff(throttle.time))) * _FINER < float(
        np.median(np.diff(current.time))
    )
    if often and not cut:
        found.append((Series(throttle.time, throttle.value[:, None]), "throttle"))
    return found


def _best(forms: list[Rebuilt | None]) -> list[Control]:
    """The form that explains what was reported best; none where none does."""
    whole = [form for form in forms if form is not None]
    return [min(whole, key=lambda form: form.cost).control] if whole else []
