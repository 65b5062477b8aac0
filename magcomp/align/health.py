"""What is wrong with a sensor, told by its readings alone, before anything is fitted."""

from __future__ import annotations

import numpy as np

from magcomp import autopilots
from magcomp.model import FloatArray, Recording, Series, usual_steps

_FROZEN_S = 5.0
_SILENT_S = 1.5
_SILENT_SHARE, _SILENT_STEPS = 0.08, 4.0
"""Links that lose a third of their messages at random are silent for so many steps a thirtieth of
the time."""

_WILD_SHARE = 0.02
_WILD_MGAUSS = 120.0
_JUMPS = 3.0
_LEAST_READINGS = 30
_STUCK_SHARE = 0.25
_SAME_SHARE, _TOP_SHARE, _MORE_OFTEN = 1e-3, 0.1, 3
_LEAST_CHANGE, _CHANGE_SHARE = 0.005, 0.25
"""Of the throttle's spread what it still has while the current stands at its top."""


def compass_complaints(recording: Recording, compass: int) -> tuple[str, ...]:
    """In words for a pilot, why the readings of a compass cannot be trusted; empty where they can.

    Parameters
    ----------
    recording
        From any source.
    compass
        1, 2 or 3.
    """
    reported = recording.field.get(compass)
    if reported is None or len(reported) < _LEAST_READINGS:
        return ()
    found = (_frozen(reported), _silent(reported, recording), _wild(reported))
    return tuple(f"compass {compass} {complaint}" for complaint in found if complaint)


def vehicle_complaints(recording: Recording) -> tuple[str, ...]:
    """The same for the vehicle: whether it has the same compasses from the beginning to the end."""
    history = recording.parameters
    first = {name: history.of(name)[0].value for name in history.names}
    autopilot = autopilots.of(recording)
    before = {each.slot: each.device_id for each in autopilot.compasses(first)}
    for each in autopilot.compasses(history.latest):
        known = before.get(each.slot, 0)
        if known and each.device_id and known != each.device_id:
            return (
                f"the compass of slot {each.slot} has device id {known} first and "
                f"{each.device_id} later: the log holds two aircraft, or a compass was exchanged; "
                "fit each part by itself",
            )
    return ()


def current_complaints(recording: Recording) -> tuple[str, ...]:
    """The same for the battery monitor, as far as throttle and motor outputs contradict it."""
    current = recording.current
    if current is None or len(current) < _LEAST_READINGS:
        return ()
    working = _working(recording, current.time)
    if working is None or np.ptp(working) <= 0.0:
        return ()
    top = float(np.quantile(current.value, 0.995))
    if top <= 0.05 and float(np.quantile(working, 0.9)) > 0.2:
        return (
            "the battery monitor reads 0 A while the motors run: set it up, or fit by throttle",
        )
    found = []
    start, end = _longest_run(current.value, current.time)
    changed = working[(current.time >= start) & (current.time <= end)]
    if end - start > _STUCK_SHARE * float(np.ptp(current.time)) and np.std(changed) > 0.02:
        found.append(
            f"the battery monitor is stuck at {np.interp(start, *_columns(current)):.0f} A from "
            f"{start:.0f} to {end:.0f} s while the throttle changes"
        )
    if not found and _saturates(current.value, working, top):
        found.append(
            f"the battery monitor saturates: it never reads above {top:.0f} A, however hard the "
            "motors work"
        )
    return tuple(found)


def _saturates(current: FloatArray, working: FloatArray, top: float) -> bool:
    """Whether the current keeps its largest value while the motors work harder and less hard.

    Where a monitor tells coarse steps, the largest value is no more frequent than the others.
    """
    at_top = current >= top - _SAME_SHARE * max(abs(top), 1.0)
    others = np.unique(current[~at_top], return_counts=True)[1]
    alone = np.count_nonzero(at_top) > _MORE_OFTEN * int(others.max(initial=0))
    usual = float(np.std(working))
    changes = float(np.std(working[at_top])) > max(_LEAST_CHANGE, _CHANGE_SHARE * usual)
    return bool(np.mean(at_top) > _TOP_SHARE and alone and changes)


def _columns(series: Series) -> tuple[FloatArray, FloatArray]:
    return series.time, series.value


def _working(recording: Recording, time: FloatArray) -> FloatArray | None:
    """How hard the motors work, 0 … 1, by the throttle."""
    if recording.throttle is None or len(recording.throttle) < 2:
        return None
    return np.asarray(np.interp(time, recording.throttle.time, recording.throttle.value))


def _longest_run(value: FloatArray, time: FloatArray) -> tuple[float, float]:
    """When the longest run of one and the same value began and ended."""
    changed = np.any(np.diff(value.reshape(len(value), -1), axis=0) != 0.0, axis=1)
    starts = np.flatnonzero(np.r_[True, changed])
    ends = np.r_[starts[1:] - 1, len(value) - 1]
    longest = int(np.argmax(time[ends] - time[starts]))
    return float(time[starts[longest]]), float(time[ends[longest]])


def _frozen(reported: Series) -> str:
    start, end = _longest_run(reported.value, reported.time)
    changes = np.count_nonzero(np.any(np.diff(reported.value, axis=0) != 0.0, axis=1))
    usual = float(np.ptp(reported.time)) / max(int(changes), 1)
    if end - start < max(_FROZEN_S, 8 * usual):
        return ""
    return (
        f"is frozen from {start:.0f} to {end:.0f} s: it repeats one reading; check its wiring, "
        "and fly again"
    )


def _silent(reported: Series, recording: Recording) -> str:
    """Whether it drops out while the rest of the vehicle goes on talking."""
    if recording.attitude is None or len(recording.attitude) < 2:
        return ""
    step = np.diff(reported.time)
    heard = recording.attitude.time
    usual_of_heard = usual_steps(np.diff(heard))
    lost = 0.0
    for index in np.flatnonzero(step > _longest(step)).tolist():
        first, last = float(reported.time[index]), float(reported.time[index + 1])
        begin, end = np.searchsorted(heard, (first, last))
        # Not divided by the steps: they are 0 where most attitudes tell the time of another.
        spoken = float(np.sum(usual_of_heard[begin:end]))
        lost += last - first if spoken > 0.6 * (last - first) else 0.0
    if lost < _SILENT_SHARE * float(np.ptp(reported.time)):
        return ""
    return (
        f"drops out: it is missing or zero for {lost:.0f} s in all while the rest of the vehicle "
        "goes on; check its wiring"
    )


def _longest(step: FloatArray) -> FloatArray:
    """The longest step near each that is no silence yet, seconds, shape (n,)."""
    return np.maximum(_SILENT_S, _SILENT_STEPS * usual_steps(step))


def _wild(reported: Series) -> str:
    """Readings far from both neighbours, which are near each other: turning makes no such jumps."""
    new = np.r_[True, np.any(np.diff(reported.value, axis=0) != 0.0, axis=1)]
    value = reported.value[new]
    if len(value) < _LEAST_READINGS:
        return ""
    strength = np.linalg.norm(value, axis=1)
    before, here, after = strength[:-2], strength[1:-1], strength[2:]
    apart = np.abs(here - (before + after) / 2.0)
    limit = np.maximum(_JUMPS * np.abs(after - before), max(_WILD_MGAUSS, 10 * np.median(apart)))
    share = float(np.mean(apart > limit))
    if share < _WILD_SHARE:
        return ""
    return f"glitches: {share * 100:.0f} % of its readings jump away from their neighbours"
