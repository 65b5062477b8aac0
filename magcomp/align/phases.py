"""Hover and forward flight of a quadplane: two sources of interference, told apart.

In forward flight the lift motors rest and a pusher draws the current, through other wires. One
vector fits neither where both are mixed. A firmware that says in which it is, is believed; where
outputs tell that a pusher runs, that is left out too.
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


def on_lift_alone(recording: Recording) -> tuple[Recording, str]:
    """What was flown on the lift motors alone, and in words what was left out.

    Returns
    -------
    Recording
        The same where the vehicle is none that has both, or never flew forward.
    str
        Empty where nothing was left out.
    """
    both = {
        "the vehicle flies forward": _said(recording),
        "a pusher drives the vehicle": _pushed(recording),
    }
    told = {words: found for words, found in both.items() if found and found[1] >= _LEAST_SHARE}
    if not told:
        return recording, ""

    def kept(series: Series) -> Series:
        hover = np.ones(len(series), dtype=bool)
        for away, _ in told.values():
            hover &= ~_near(series.time, away)
        return Series(series.time[hover], series.value[hover])

    words, (_, share) = next(iter(told.items()))
    current, throttle = recording.current, recording.throttle
    attitude = recording.attitude
    hover = replace(
        recording,
        field={compass: kept(series) for compass, series in recording.field.items()},
        current=None if current is None else kept(current),
        throttle=None if throttle is None else kept(throttle),
        # A compass that is silent while the vehicle goes on talking would have dropped out.
        attitude=None if attitude is None else kept(attitude),
    )
    return hover, (
        f"{words} in {100.0 * share:.0f} % of the time its motors work: only "
        "what was flown on the lift motors alone is used, and the answer holds for hovering, for a "
        "pusher's current disturbs in its own way"
    )


def _said(recording: Recording) -> tuple[Series, float] | None:
    """The same by what the firmware says of itself; None where it does not."""
    forward = recording.forward
    drawn = recording.throttle if recording.current is None else recording.current
    if forward is None or not len(forward) or drawn is None or not len(drawn):
        return None
    told = drawn.time >= forward.time[0]
    busy = drawn.time[told & (drawn.value > _least_drawn(drawn))]
    last = np.searchsorted(forward.time, busy, side="right") - 1
    share = float(np.mean(forward.value[last] > 0.0)) if len(busy) else 0.0
    return forward, share


def _least_drawn(drawn: Series) -> float:
    """What motors draw at least, in the series' unit."""
    return _DRAWING * float(np.quantile(drawn.value, 0.98))


def _pushed(recording: Recording) -> tuple[Series, float] | None:
    """When something other than lift motors draws the current, and in which share of the time."""
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
    return Series(time, away.astype(np.float64)), share


def _near(time: FloatArray, away: Series) -> BoolArray:
    """Whether each time is within a second of one at which the vehicle was pushed."""
    pushed = np.r_[0, np.cumsum(away.value > 0.0)]
    first = np.searchsorted(away.time, time - _MARGIN_S, side="right") - 1
    last = np.searchsorted(away.time, time + _MARGIN_S, side="right")
    return np.asarray(pushed[last] > pushed[np.maximum(first, 0)])
