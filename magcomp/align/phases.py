"""Hover and forward flight of a quadplane: two sources of interference, told apart.

In forward flight the lift motors rest and a pusher draws the current, through other wires. One
vector fits neither where both are mixed. A firmware that says in which it is, is believed; of
others the outputs tell.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from magcomp.align.control import duty_of, motors_of
from magcomp.model import BoolArray, FloatArray, Recording, Series

_RESTING = 0.03
"""Mean duty of lift motors that do not lift."""

_RUNS_US = 50.0
"""Above its least output by this a pusher runs."""

_LEAST_US = 800.0
_DRAWING = 0.15
"""Of the largest usual current: more than the electronics alone draw."""

_LEAST_SHARE = 0.02
_MARGIN_S = 1.0
_STEP_S = 0.5


def on_lift_alone(recording: Recording) -> tuple[Recording, str]:
    """What was flown on the lift motors alone, and in words what was left out.

    Returns
    -------
    Recording
        The same where the vehicle is none that has both, or never flew forward.
    str
        Empty where nothing was left out.
    """
    said = _said(recording)
    pushed = _pushed(recording) if said is None else said
    if pushed is None:
        return recording, ""
    time, away, share = pushed
    if share < _LEAST_SHARE:
        return recording, ""

    def kept(series: Series) -> Series:
        hover = ~_near(series.time, time[away])
        return Series(series.time[hover], series.value[hover])

    field = {compass: kept(series) for compass, series in recording.field.items()}
    current = None if recording.current is None else kept(recording.current)
    what = "a pusher drives the vehicle" if said is None else "the vehicle flies forward"
    told = (
        f"{what} in {100.0 * share:.0f} % of the time its motors work: only "
        "what was flown on the lift motors alone is used, and the answer holds for hovering, for a "
        "pusher's current disturbs in its own way"
    )
    return replace(recording, field=field, current=current), told


def _said(recording: Recording) -> tuple[FloatArray, BoolArray, float] | None:
    """The same by what the firmware says of itself; None where it does not."""
    forward, current = recording.forward, recording.current
    if forward is None or not len(forward) or current is None or not len(current):
        return None
    time = np.arange(forward.time[0], max(forward.time[-1], current.time[-1]), _STEP_S)
    last = np.searchsorted(forward.time, time, side="right") - 1
    away = forward.value[last] > 0.0
    busy = np.interp(time, current.time, current.value) > _least_drawn(current)
    share = float(np.mean(away[busy])) if busy.any() else 0.0
    return time, np.asarray(away), share


def _least_drawn(current: Series) -> float:
    """What motors draw at least, A."""
    return _DRAWING * float(np.quantile(current.value, 0.98))


def _pushed(recording: Recording) -> tuple[FloatArray, BoolArray, float] | None:
    """Times, whether something other than lift motors draws the current then, and how often."""
    outputs, current = recording.outputs, recording.current
    if recording.vehicle.kind != "plane" or outputs is None or current is None or not len(current):
        return None
    motors, duty = motors_of(recording), duty_of(recording)
    if motors is None or not motors.named or duty is None:
        return None
    time = outputs.time
    drawn = np.interp(time, current.time, current.value)
    resting = duty.series.value.mean(axis=1) < _RESTING
    working = drawn > _least_drawn(current)
    away = resting & working
    for channel in motors.pushers:
        told = outputs.value[:, channel]
        live = told > _LEAST_US
        if live.any():
            away |= told > float(told[live].min()) + _RUNS_US
    busy = working | ~resting
    share = float(np.mean(away[busy])) if busy.any() else 0.0
    return time, np.asarray(away), share


def _near(time: FloatArray, away: FloatArray) -> BoolArray:
    """Whether each time is within a second of one at which the vehicle was pushed."""
    if not len(away):
        return np.zeros(len(time), dtype=bool)
    after = np.clip(np.searchsorted(away, time), 0, len(away) - 1)
    before = np.maximum(after - 1, 0)
    apart = np.minimum(np.abs(away[after] - time), np.abs(away[before] - time))
    return np.asarray(apart < _MARGIN_S)
