"""What each motor draws, and what drives it: quantities of as many parts as there are motors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from magcomp.align.between import expected
from magcomp.align.control import POWERS, duty_of, rebuild, reported, smoothed
from magcomp.align.readings import in_gap
from magcomp.model import (
    DRIVE,
    MOTORS,
    BoolArray,
    Control,
    FloatArray,
    Recording,
    Series,
    interpolate,
)

SMOOTHINGS_S = (0.0, 0.05)
"""Time constants with which a motor may follow its output; the fit decides."""

_LEAST_MOTORS = 2
_LEAST_A = 1e-3
_STEP_S, _MOST_ROWS = 0.1, 100_000


def currents_of_motors(recording: Recording) -> tuple[Control, ...]:
    """The current of each motor, from the battery's current and what drives each motor.

    Returns
    -------
    tuple of Control
        Parts of shape (n, k), in A, that add up to the battery's current: as it is reported and as
        the outputs tell it, with different time constants. Empty where the recording lacks the
        current or the outputs of two motors, or the one does not follow the other.

    Notes
    -----
    The battery's current is regressed on powers of all duties. Each power is a sum over the
    motors, so each motor's share of it is its current. Between the times the outputs are told at
    the share is what is to be expected (docs/method.md, Motor by motor).
    """
    found = _told(recording)
    if found is None or recording.current is None:
        return ()
    told_at, rebuilt, numbers = found
    time = _often(rebuilt.time)
    turns = told_at.value.sum(axis=1) > 0.5
    shares = {
        how: _between(told_at, turns, time, lasting=lasting)
        for how, lasting in (("", True), (" as far as they last", False))
    }
    unsure = _apart(interpolate(told_at, time), [*shares.values()][-1])
    totals = {
        "as the outputs tell it": interpolate(rebuilt, time),
        "as reported": interpolate(recording.current, time),
    }
    return tuple(
        Control(
            MOTORS,
            smoothed(Series(time, share * total[:, None]), constant),
            f"battery current {how}, shared out by the motor outputs{lasting}, which each motor "
            f"follows within {1000 * constant:.0f} ms",
            numbers,
            unsure,
        )
        for lasting, share in shares.items()
        for how, total in totals.items()
        for constant in SMOOTHINGS_S
    )


def _told(recording: Recording) -> tuple[Series, Series, tuple[int, ...]] | None:
    """Shares of the motors and their total current when the outputs were told, and which motors.

    The shares of motors at rest are nothing.
    """
    duty = duty_of(recording)
    if recording.current is None or duty is None or len(duty.numbers) < _LEAST_MOTORS:
        return None
    found = rebuild(recording.current, duty.series, MOTORS, "battery current")
    if found is None:
        return None
    level, *slopes = found.coefficients
    curved = sum(
        slope * duty.series.value**power for slope, power in zip(slopes, POWERS, strict=True)
    )
    each = np.maximum((level + curved) / len(duty.numbers), 0.0)
    # The battery sags for all motors alike: what outputs do not explain is shared in proportion.
    share = each / np.maximum(each.sum(axis=1, keepdims=True), _LEAST_A)
    total = found.control.series
    return Series(total.time, share), total, duty.numbers


def drawn_and_driven(recording: Recording) -> tuple[Control, Control] | None:
    """What each motor draws and what drives it, at the times the outputs were told, and only then.

    Returns
    -------
    tuple of Control
        In A and in V, of the same rows; None where the recording lacks the voltage, or what
        :func:`currents_of_motors` needs.
    """
    found, drive = _told(recording), drive_of_motors(recording)
    if found is None or drive is None:
        return None
    share, total, numbers = found
    drawn = Series(total.time, share.value * total.value[:, None])
    return Control(MOTORS, drawn, "as the outputs tell it", numbers), drive


def _often(time: FloatArray) -> FloatArray:
    """Times so close that a straight line between two of them is exact; none where nobody told."""
    count = min(int((time[-1] - time[0]) / _STEP_S) + 1, _MOST_ROWS)
    even = np.linspace(time[0], time[-1], max(count, len(time)))
    return np.asarray(even[~in_gap(even, time)])


def _between(told: Series, turns: BoolArray, time: FloatArray, *, lasting: bool) -> FloatArray:
    """Shares of the motors at other times; what was told at rest says nothing of a flight."""
    if not turns.any():
        return interpolate(told, time)
    return np.maximum(
        expected(Series(told.time[turns], told.value[turns]), time, lasting=lasting), 0.0
    )


def _apart(kept: FloatArray, passing: FloatArray) -> float:
    """How uncertain the size of the differences is: the truth is anywhere between the two.

    Where what is gone at once was taken to last, a slope comes out too small by its share of the
    square; evenly likely from there to nothing, that has the standard deviation of 1 / √3 of it.
    """
    square = float(np.mean((kept - kept.mean(axis=0)) ** 2))
    gone = float(np.mean((kept - passing) ** 2))
    return min(1.0, gone / square) / float(np.sqrt(3.0)) if square > 0.0 else 0.0


def drive_of_motors(recording: Recording) -> Control | None:
    """Duty times the battery's voltage of each motor; None where the recording lacks either."""
    duty = duty_of(recording)
    if duty is None or recording.voltage is None or not len(recording.voltage):
        return None
    volts = interpolate(recording.voltage, duty.series.time)
    series = Series(duty.series.time, duty.series.value * volts[:, None])
    return Control(DRIVE, series, "motor outputs and battery voltage", duty.numbers)


def to_undo(recording: Recording, found: tuple[Control, ...]) -> Mapping[str, Control]:
    """By kind, what corrections that were in force may have been multiplied by.

    Parameters
    ----------
    recording
        From any source.
    found
        Its :func:`magcomp.align.controls`.
    """
    drive = drive_of_motors(recording)
    return reported(found) | ({} if drive is None else {DRIVE: drive})
