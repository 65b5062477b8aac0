"""What each motor draws, and what drives it: quantities of as many parts as there are motors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from magcomp.align.between import expected
from magcomp.align.control import (
    POWERS,
    Rebuilt,
    duty_of,
    exponent_of,
    rebuild,
    reported,
    smoothed,
)
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
    """The current of each motor, from the battery's current and what tells each motor's share.

    Returns
    -------
    tuple of Control
        Parts of shape (n, k), in A, that add up to the battery's current: as it is reported and as
        what tells the shares tells it, with different time constants. Empty where the recording
        lacks the current, or anything of every motor that the current follows.

    Notes
    -----
    Where the speed controller of every motor reports its current, that is its share. Else the
    battery's current is regressed on powers of all duties, or on one power of duty times voltage.
    Each power is a sum over the motors, so each motor's share of it is its current. Between the
    times the shares are told at they are what is to be expected (docs/method.md, Motor by motor).
    """
    found = _told(recording)
    if found is None or recording.current is None:
        return ()
    told_at, rebuilt, _, numbers, source = found
    time = _often(rebuilt.time)
    turns = told_at.value.sum(axis=1) > 0.5
    shares = {
        how: _between(told_at, turns, time, lasting=lasting)
        for how, lasting in (("", True), (" as far as they last", False))
    }
    unsure = _apart(interpolate(told_at, time), [*shares.values()][-1])
    totals = {
        f"as the {source} tell it": interpolate(rebuilt, time),
        "as reported": interpolate(recording.current, time),
    }
    return tuple(
        Control(
            MOTORS,
            smoothed(Series(time, share * total[:, None]), constant),
            f"battery current {how}, shared out by the {source}{lasting}, which each motor follows "
            f"within {1000 * constant:.0f} ms",
            numbers,
            unsure,
        )
        for lasting, share in shares.items()
        for how, total in totals.items()
        for constant in SMOOTHINGS_S
    )


class _Told(NamedTuple):
    """What each motor draws when it was told, and who told it.

    Attributes
    ----------
    share
        Of the total, shape (n, k); nothing of motors at rest.
    total
        In A, at the same times.
    told_at
        What these times were before they were brought to the battery's, shape (n,).
    numbers
        Of which motor each column is.
    source
        In words.
    """

    share: Series
    total: Series
    told_at: FloatArray
    numbers: tuple[int, ...]
    source: str


def _told(recording: Recording) -> _Told | None:
    """By the speed controllers where every motor's reports its current, else by the outputs."""
    if recording.current is None:
        return None
    return _told_by_controllers(recording, recording.current) or _told_by_outputs(
        recording, recording.current
    )


def _told_by_controllers(recording: Recording, current: Series) -> _Told | None:
    duty, escs = duty_of(recording), recording.esc_currents
    if duty is None or len(duty.numbers) < _LEAST_MOTORS or not set(duty.channels) <= set(escs):
        return None
    each = [escs[channel] for channel in duty.channels]
    time = each[0].time
    drawn = np.maximum(np.column_stack([interpolate(one, time) for one in each]), 0.0)
    whole = drawn.sum(axis=1, keepdims=True)
    # Of its largest: a battery's current is a curve in what the controllers measure.
    load = Series(time, whole / max(float(whole.max()), _LEAST_A))
    found = rebuild(current, load, MOTORS, "battery current", measured=True)
    if found is None:
        return None
    total = found.control.series
    share = drawn / np.maximum(whole, _LEAST_A)
    return _Told(Series(total.time, share), total, time, duty.numbers, "speed controllers")


def _told_by_outputs(recording: Recording, current: Series) -> _Told | None:
    duty = duty_of(recording)
    if duty is None or len(duty.numbers) < _LEAST_MOTORS:
        return None
    found, driven, powers = _by_powers(recording, current, duty.series)
    if found is None:
        return None
    level, *slopes = found.coefficients
    curved = sum(slope * driven.value**power for slope, power in zip(slopes, powers, strict=True))
    each = np.maximum((level + curved) / len(duty.numbers), 0.0)
    # The battery sags for all motors alike: what outputs do not explain is shared in proportion.
    share = each / np.maximum(each.sum(axis=1, keepdims=True), _LEAST_A)
    total = found.control.series
    return _Told(Series(total.time, share), total, duty.series.time, duty.numbers, "motor outputs")


def _by_powers(
    recording: Recording, current: Series, duty: Series
) -> tuple[Rebuilt | None, Series, Sequence[float]]:
    """The current from powers of what drives each motor, and what that is.

    Of the duty; or one power of the duty times the battery's voltage, which is what a motor draws
    by, where that explains no less: it has fewer numbers, and knows how the battery sags.
    """
    plain = rebuild(current, duty, MOTORS, "battery current")
    drive = drive_of_motors(recording)
    if plain is None or drive is None or not drive.series.value.any():
        return plain, duty, POWERS
    # Of its largest: powers of volts are far from 1.
    driven = Series(duty.time, drive.series.value / float(drive.series.value.max()))
    shift = float(plain.control.series.time[0] - duty.time[0])
    power, cost = exponent_of(current, driven, shift)
    if cost > plain.cost:
        return plain, duty, POWERS
    by_law = rebuild(current, driven, MOTORS, "battery current", powers=(power,))
    return (plain, duty, POWERS) if by_law is None else (by_law, driven, (power,))


def drawn_and_driven(recording: Recording) -> tuple[Control, Control] | None:
    """What each motor draws and what drives it, where both were told, and only then.

    Returns
    -------
    tuple of Control
        In A and in V, of the same rows; None where the recording lacks the voltage, or what
        :func:`currents_of_motors` needs.
    """
    found, drive = _told(recording), drive_of_motors(recording)
    if found is None or drive is None:
        return None
    drawn = Series(found.total.time, found.share.value * found.total.value[:, None])
    drive = replace(drive, series=Series(drawn.time, interpolate(drive.series, found.told_at)))
    return Control(MOTORS, drawn, f"as the {found.source} tell it", found.numbers), drive


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
