"""What each motor draws, and what drives it: quantities of as many parts as there are motors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from magcomp.align.control import POWERS, duty_of, rebuild, reported, smoothed
from magcomp.model import DRIVE, MOTORS, Control, Recording, Series, interpolate

SMOOTHINGS_S = (0.0, 0.05)
"""Time constants with which a motor may follow its output; the fit decides."""

_LEAST_MOTORS = 2
_LEAST_A = 1e-3


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
    motors, so each motor's share of it is its current (docs/method.md, Motor by motor).
    """
    duty = duty_of(recording)
    if recording.current is None or duty is None or len(duty.numbers) < _LEAST_MOTORS:
        return ()
    found = rebuild(recording.current, duty.series, MOTORS, "battery current")
    if found is None:
        return ()
    level, *slopes = found.coefficients
    curved = sum(
        slope * duty.series.value**power for slope, power in zip(slopes, POWERS, strict=True)
    )
    each = np.maximum((level + curved) / len(duty.numbers), 0.0)
    time = found.control.series.time
    # The battery sags for all motors alike: what outputs do not explain is shared in proportion.
    share = each / np.maximum(each.sum(axis=1, keepdims=True), _LEAST_A)
    totals = {
        "as the outputs tell it": found.control.series.value,
        "as reported": interpolate(recording.current, time),
    }
    return tuple(
        Control(
            MOTORS,
            smoothed(Series(time, share * total[:, None]), constant),
            f"battery current {how}, shared out by the motor outputs, which each motor follows "
            f"within {1000 * constant:.0f} ms",
            duty.numbers,
        )
        for how, total in totals.items()
        for constant in SMOOTHINGS_S
    )


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
