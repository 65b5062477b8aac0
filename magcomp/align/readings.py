"""New readings of one compass, without repeats, gaps and stretches that cannot be used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from magcomp import autopilots
from magcomp.autopilots import Kind
from magcomp.errors import MissingDataError, UsageError
from magcomp.model import (
    Applied,
    BoolArray,
    FloatArray,
    InForce,
    IntArray,
    Readings,
    Recording,
    Series,
    usual_steps,
)

PARAMETER_SETTLE_S = 1.5
"""A changed compass parameter is in force somewhere within this time of its report."""

ARMED_ENOUGH_S = 30.0
"""With this much armed time, disarmed time (carried about, parked on steel) is left out."""

SHORT_PAUSE_S = 6.0
"""A pause between two armed stretches in which nobody carries a vehicle about: of motor tests."""

_LEAST_GAP_S, _GAP_STEPS = 0.5, 2.5

MOST_READINGS = 20_000
"""Half an hour at 10 Hz. More are thinned before a fit: the bound of an hour's flight is that of
its drift, not of its noise."""


def readings(
    recording: Recording, compass: int, *, start: float = -np.inf, end: float = np.inf
) -> Readings:
    """New readings of one compass.

    Parameters
    ----------
    recording
        From any source.
    compass
        1, 2 or 3: the autopilot's priority order.
    start, end
        Seconds since the recording began.

    Raises
    ------
    MissingDataError
        Without this compass, without attitude, or with no reading left between start and end.
    UsageError
        Where the recording ends before the start, or begins after the end.
    ParameterFileError
        Where a compass parameter of the recording is not finite.

    Notes
    -----
    ArduPilot repeats a reading until the next one: only changes are new (docs/autopilots.md,
    ArduPilot: timing).
    """
    reported = recording.field.get(compass)
    if reported is None:
        raise MissingDataError(
            f"{recording.source} must hold readings of compass {compass}; instead it holds "
            f"{_list_compasses(recording)}"
        )
    if recording.attitude is None or len(recording.attitude) < 2:
        raise MissingDataError(
            f"{recording.source} must hold the vehicle's attitude (message ATTITUDE); "
            "instead it holds none, and gravity cannot be known without it"
        )
    asked = _within_span(recording, reported.time, start, end)
    keep = is_new(reported.value) & asked
    autopilot = autopilots.of(recording)
    applied = recording.applied.get(compass)
    corrected = compass not in recording.raw_compasses
    changes = autopilot.changes(
        recording.parameters, armed=recording.armed, told_per_reading=applied is not None
    )
    if corrected:
        keep &= _away_from(reported.time, changes)
    keep &= ~in_gap(reported.time, recording.attitude.time)
    keep &= _usable_state(reported.time, recording.armed)
    if not keep.any():
        raise MissingDataError(
            f"{recording.source} must hold usable readings of compass {compass}"
            f"{_span(start, end, recording.duration_s)}; instead "
            f"{_unusable(int(asked.sum()), len(reported))}"
        )
    time = reported.time[keep]
    in_force, stretch = _corrections(recording, compass, time, changes)
    told_offset = told_motor = None
    if applied is not None:
        told_offset, told_motor = applied.offset.value[keep], applied.motor.value[keep]
        in_force = (*in_force[:-1], _told(in_force[-1], applied))
    meaning = autopilot.field_meaning(recording.format)
    value = reported.value[keep]
    return Readings(
        compass=compass,
        time=time,
        reported=_mend_truncation(value) if meaning.truncated else value,
        stretch=stretch,
        in_force=in_force,
        attitude=Series(recording.attitude.time, np.unwrap(recording.attitude.value, axis=0)),
        corrected=corrected,
        applied_later=meaning.applied_later_s,
        told_offset=told_offset,
        told_motor=told_motor,
    )


def _within_span(recording: Recording, time: FloatArray, start: float, end: float) -> BoolArray:
    """Which moments lie in the time asked for, which must meet the recording's own."""
    duration = recording.duration_s
    if start > duration:
        raise UsageError(
            f"The start must be before the log ends at {duration:.0f} s; instead received "
            f"{start:g} s"
        )
    if end < 0.0:
        raise UsageError(f"The end must be after the log begins at 0 s; instead received {end:g} s")
    return np.asarray((time >= start) & (time <= end))


def _span(start: float, end: float, duration: float) -> str:
    """The time asked for, in words; nothing where that is all there is."""
    if start <= 0.0 and end >= duration:
        return ""
    until = f" to {end:g} s" if end < duration else f", and the log ends at {duration:.0f} s"
    return f" from {max(start, 0.0):g} s{until}"


def _unusable(asked: int, all_: int) -> str:
    """In words, why no reading is left of those in the time asked for."""
    if not asked:
        return f"none of its {all_} is there"
    return f"all {asked} there were repeats, in gaps of the attitude, or taken disarmed"


def within(readings: Readings, known: Series) -> Readings:
    """The readings at times where another quantity is known, not interpolated across a gap."""
    inside = ~in_gap(readings.time, known.time)
    return readings if inside.all() else readings.where(inside)


def thinned(readings: Readings, most: int = MOST_READINGS) -> Readings:
    """Every k-th reading of a log of hours, so that at most ``most`` are left.

    Neighbouring readings err alike: of ten a second, nine say little. Attitude and control
    quantity keep all of their own values.
    """
    step = -(-len(readings) // most)
    return readings if step <= 1 else readings.where(np.arange(len(readings)) % step == 0)


def _list_compasses(recording: Recording) -> str:
    present = sorted(recording.field)
    return f"compass {', '.join(map(str, present))}" if present else "no compass at all"


def is_new(value: FloatArray) -> BoolArray:
    """Whether each reading, shape (n, 3), differs from the one before it; shape (n,).

    Examples
    --------
    >>> is_new(np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [1.0, 2.0, 4.0]])).tolist()
    [True, False, True]
    """
    new = np.ones(len(value), dtype=bool)
    new[1:] = np.any(np.diff(value, axis=0) != 0.0, axis=1)
    return new


def _away_from(time: FloatArray, moments: tuple[float, ...]) -> BoolArray:
    if not moments:
        return np.ones(len(time), dtype=bool)
    at = np.array(moments)
    after = np.searchsorted(at, time)
    # Sorted, so only the moments before and after a time can be near it.
    near = np.minimum(
        np.abs(time - at[np.maximum(after - 1, 0)]), np.abs(time - at[after % len(at)])
    )
    return np.asarray(near > PARAMETER_SETTLE_S)


def in_gap(time: FloatArray, known: FloatArray) -> BoolArray:
    """Whether the neighbours in ``known`` stand too far apart to interpolate between.

    One value alone is a constant: it holds everywhere.
    """
    if len(known) < 2:
        return np.zeros(len(time), dtype=bool)
    step = np.diff(known)
    limit = np.maximum(_LEAST_GAP_S, _GAP_STEPS * usual_steps(step))
    after = np.clip(np.searchsorted(known, time), 1, len(step))
    outside = (time < known[0] - limit[0]) | (time > known[-1] + limit[-1])
    return np.asarray((step[after - 1] > limit[after - 1]) | outside)


def _usable_state(time: FloatArray, armed: Series | None) -> BoolArray:
    """Armed time where there is enough of it, else all time."""
    everything = np.ones(len(time), dtype=bool)
    if armed is None or len(armed) < 2:
        return everything
    is_armed = _with_short_pauses(armed)
    state = is_armed[np.clip(np.searchsorted(armed.time, time, "right") - 1, 0, None)]
    seconds = float(np.sum(np.diff(armed.time) * armed.value[:-1]))
    return np.asarray(state) if seconds >= ARMED_ENOUGH_S and state.any() else everything


def _with_short_pauses(armed: Series) -> BoolArray:
    """Whether each state counts as armed: it is, or pauses shortly between two that are."""
    is_armed = armed.value > 0.5
    edges = np.flatnonzero(np.diff(is_armed)) + 1
    begin = np.concatenate([[-np.inf], armed.time[edges]])
    end = np.concatenate([armed.time[edges], [np.inf]])
    short = end - begin <= SHORT_PAUSE_S
    return np.asarray(is_armed | short[np.searchsorted(edges, np.arange(len(armed)), "right")])


def _mend_truncation(value: FloatArray) -> FloatArray:
    """Undo the mean of the firmware's cut towards zero when it casts to int16."""
    return np.where(value == np.trunc(value), value + 0.5 * np.sign(value), value)


def _corrections(
    recording: Recording, compass: int, time: FloatArray, changes: tuple[float, ...]
) -> tuple[tuple[InForce, ...], IntArray]:
    """Corrections in force, oldest first, the last one being that of the end; which at each time.

    Only those of the times are worked out: a log may hold many changes between two readings.
    """
    autopilot = autopilots.of(recording)
    moments = np.array([-np.inf, *changes])
    last = len(moments) - 1
    period = np.searchsorted(moments, time, side="right") - 1
    periods, stretch = np.unique(np.append(period, last), return_inverse=True)
    in_force: list[InForce] = []
    number = np.empty(len(periods), dtype=np.intp)
    forces = autopilot.in_force_over(
        recording.parameters, compass, moments[periods].tolist(), armed=recording.armed
    )
    for index, now in enumerate(forces):
        if not in_force or not _corrects_alike(now, in_force[-1]):
            in_force.append(now)
        number[index] = len(in_force) - 1
    return tuple(in_force), number[stretch[:-1]]


def _told(in_force: InForce, applied: Applied) -> InForce:
    """The present correction, with what the log tells in the place of parameters it does not.

    An offset that the log tells is the one in force, whatever was reported: a vehicle that learns
    reports its offsets late or never. A motor correction of 0 throughout says that there was none.
    """
    offset = applied.offset.value[-1]
    idle = not applied.motor.value.any()
    told = {Kind.OFFSET, Kind.MOTOR, Kind.SWITCH} if idle else {Kind.OFFSET}
    return replace(
        in_force,
        correction=replace(in_force.correction, offset=offset),
        unseen=tuple(
            name
            for name in in_force.unseen
            if (found := autopilots.parse(name)) is None or found.kind not in told
        ),
    )


def _corrects_alike(one: InForce, other: InForce) -> bool:
    return (
        one.regressor == other.regressor
        and one.exponent == other.exponent
        and np.array_equal(one.correction.offset, other.correction.offset)
        and np.array_equal(one.correction.soft_iron, other.correction.soft_iron)
        and np.array_equal(one.correction.motor, other.correction.motor)
    )
