"""One time axis for all messages of a vehicle.

Three clocks are in a log. The vehicle's own (milliseconds or microseconds since it was switched
on) is exact but not in every message; it wraps, and starts again with each reboot. The
recorder's is in every record, but radios deliver late and in bursts, a recorder may be set while it
records, and a simulation may run faster than it. The order of the records is always there. So:

- A message with the vehicle's time is put there; a reboot begins a new stretch, which is placed
  after the one before it by the recorder's clock, as does a leap of the vehicle's clock during
  which next to no time was recorded; a wrap is undone.
- Any other message is put between the stamped ones around it by its place in the stream.
- Where the vehicle's clock is missing or stands still, the recorder's is all there is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from magcomp.mavlink.checksum import OffsetArray
from magcomp.mavlink.frames import MaskArray
from magcomp.model import FloatArray

SECOND = 1_000_000
MILLISECOND_WRAP = (1 << 32) * 1000
MICROSECOND_WRAP = 1 << 32
NO_STAMP = -1

# Messages are stamped a little before they are sent, so neighbours may stand in the wrong order.
_DISORDER = SECOND
_NEAR = 60 * SECOND
_LATE_FRAMES = 10
_USABLE_SHARE = 0.9
_PACE = 2.0


@dataclass(frozen=True, eq=False)
class Stamps:
    """The vehicle's times of messages of one kind.

    Attributes
    ----------
    rows
        Which of the vehicle's frames these are, increasing, shape (n,).
    time
        Vehicle's time in microseconds as sent, shape (n,).
    wrap
        The clock's range in microseconds.
    at_sending
        Whether this is when the message was sent, so that its neighbours were sent then, too.
        A position may carry the time of the fix.
    """

    rows: NDArray[np.intp]
    time: OffsetArray
    wrap: int
    at_sending: bool = True


class _Stream(NamedTuple):
    """Recorder's time and place of all frames, shape (n,) each."""

    arrival: OffsetArray
    place: OffsetArray


class _Settled(NamedTuple):
    """Frames and their microseconds on the leading axis, shape (n,) each."""

    rows: NDArray[np.intp]
    time: OffsetArray


def time_axis(
    arrival: OffsetArray, place: OffsetArray, leading: Sequence[Stamps], others: Sequence[Stamps]
) -> FloatArray:
    """Time of each frame of one vehicle, in seconds from an arbitrary zero.

    Parameters
    ----------
    arrival
        The recorder's time in microseconds of all frames in the order of the stream, shape (n,).
    place
        Place of each frame in the stream, increasing, shape (n,).
    leading
        Times in milliseconds that say reliably when the message was sent. They find the
        reboots and wraps. Without them the first of the others does.
    others
        Further times, put in relation to the leading ones and used only where they agree.

    Returns
    -------
    FloatArray
        Shape (n,). Not sorted: frames may stand in the log in another order.
    """
    stream = _Stream(arrival, place)
    n = len(arrival)
    leaders = [_merged(leading, n), *others] if leading else [*others]
    usable = [stamps for stamps in leaders if _runs(stamps)]
    if not usable:
        return _recorder_axis(arrival)
    leader, *followers = usable
    elapsed = _unroll(leader, arrival[leader.rows])
    settled = [_settle(stamps, leader, elapsed, stream) for stamps in followers]
    axis = np.zeros(n, dtype=np.int64)
    is_anchor = np.zeros(n, dtype=bool)
    axis[leader.rows], is_anchor[leader.rows] = elapsed, True
    for stamps, own in zip(followers, settled, strict=True):
        if stamps.at_sending:
            axis[own.rows], is_anchor[own.rows] = own.time, True
    anchors, bare = np.flatnonzero(is_anchor), np.flatnonzero(~is_anchor)
    around = _neighbours(anchors, bare, n)
    axis[bare] = _between(axis[anchors], anchors, bare, around, stream)
    for own in settled:
        axis[own.rows] = own.time
    return np.divide(axis, SECOND)


def _merged(group: Sequence[Stamps], n: int) -> Stamps:
    """Stamps of one clock from several messages, in the order of the stream."""
    if len(group) == 1:
        return group[0]
    time = np.full(n, NO_STAMP, dtype=np.int64)
    for stamps in group:
        time[stamps.rows] = stamps.time
    rows = np.flatnonzero(time != NO_STAMP)
    return Stamps(rows, time[rows], group[0].wrap)


def _runs(stamps: Stamps) -> bool:
    return len(stamps.time) > 1 and int(stamps.time.max()) > int(stamps.time.min())


def _recorder_axis(arrival: OffsetArray) -> FloatArray:
    """The recorder's clock, stopped wherever it goes back."""
    steps = np.maximum(np.diff(arrival, prepend=arrival[:1]), 0)
    return np.cumsum(steps).astype(np.float64) / SECOND


def _unroll(stamps: Stamps, arrival: OffsetArray) -> OffsetArray:
    """Time since the first stamp, wraps and reboots undone, in microseconds, shape (n,)."""
    step = np.diff(stamps.time)
    waited = np.diff(arrival)
    wrapped = step + stamps.wrap
    is_wrap = (step < -stamps.wrap // 2) & ((wrapped < _NEAR) | (np.abs(wrapped - waited) < _NEAR))
    step = np.where(is_wrap, wrapped, step)
    back = step < -_DISORDER
    # Both clocks go back by the same amount: an older piece of the log, not a reboot.
    older = back & (waited < 0) & (np.abs(waited - step) < np.maximum(2 * SECOND, -step // 2))
    # A few frames that took a longer way: the next ones are back where it was.
    drops = np.flatnonzero(back)
    soon = np.minimum(drops[:, np.newaxis] + 1 + np.arange(_LATE_FRAMES), len(step))
    older[drops] |= stamps.time[soon].max(axis=1) >= stamps.time[drops] - _DISORDER
    reboot = back & ~older
    step = np.where(reboot, np.where(waited > 0, waited, SECOND), step)
    step = np.where(_leapt(step, waited), waited, step)
    return np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(step)])


def _leapt(step: OffsetArray, waited: OffsetArray) -> MaskArray:
    """Which steps of the vehicle's clock are a leap: no such time passed where it was recorded.

    Told only where the recorder keeps pace; a simulation may run faster than it.
    """
    usual = (np.abs(step) < _NEAR) & (waited >= 0) & (waited < _NEAR)
    passed = int(waited[usual].sum())
    pace = int(step[usual].sum()) / passed if passed > 0 else 0.0
    if not 1.0 / _PACE < pace < _PACE:
        return np.zeros(len(step), dtype=bool)
    return np.asarray((waited >= 0) & (step > _PACE * waited + _NEAR))


def _settle(stamps: Stamps, leader: Stamps, elapsed: OffsetArray, stream: _Stream) -> _Settled:
    """Times of another kind of message on the leading axis, where both agree."""
    before, after = _neighbours(leader.rows, stamps.rows, len(stream.arrival))
    expected = _between(elapsed, leader.rows, stamps.rows, (before, after), stream)
    room = np.abs(elapsed[after] - elapsed[before]) + np.where(before == after, _NEAR, _DISORDER)
    best = np.full(len(stamps.rows), np.iinfo(np.int64).max)
    settled = np.zeros(len(stamps.rows), dtype=np.int64)
    for neighbour in (before, after):
        # Either neighbour may lie on the other side of a reboot.
        time = stamps.time + (elapsed[neighbour] - leader.time[neighbour])
        time += stamps.wrap * np.rint((expected - time) / stamps.wrap).astype(np.int64)
        error = np.abs(time - expected)
        settled = np.where(error < best, time, settled)
        best = np.minimum(error, best)
    usable: MaskArray = best <= room
    if usable.mean() < _USABLE_SHARE:
        usable[:] = False
    return _Settled(stamps.rows[usable], settled[usable])


def _neighbours(
    anchors: NDArray[np.intp], rows: NDArray[np.intp], n: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Index of the last anchor before each of n rows and of the first from it on."""
    counted = np.zeros(n + 1, dtype=np.intp)
    counted[anchors + 1] = 1
    after = np.cumsum(counted)[rows]
    return np.maximum(after - 1, 0), np.minimum(after, len(anchors) - 1)


def _between(
    time: OffsetArray,
    anchors: NDArray[np.intp],
    rows: NDArray[np.intp],
    neighbours: tuple[NDArray[np.intp], NDArray[np.intp]],
    stream: _Stream,
) -> OffsetArray:
    """Times of some rows by their place between anchors whose times are known, shape (n,).

    Between two anchors the recorder's clock says how far, where it went on from one to the
    other: a vehicle sends in bursts, and the place in the stream alone would spread them evenly.
    """
    arrival, place = stream.arrival[rows], stream.place[rows]
    before, after = neighbours
    last, following = anchors[before], anchors[after]
    from_arrival = stream.arrival[last]
    from_place = stream.place[last]
    share = (place - from_place) / np.maximum(stream.place[following] - from_place, 1)
    waited = stream.arrival[following] - from_arrival
    into = arrival - from_arrival
    told = (into >= 0) & (into <= waited) & (waited > 0)
    share[told] = into[told] / waited[told]
    result: OffsetArray = time[before]
    result += np.rint(share * (time[after] - result)).astype(np.int64)
    # Outside the anchors only the recorder knows how long ago it was.
    early = rows < anchors[0]
    result[early] = time[0] - np.maximum(stream.arrival[anchors[0]] - arrival[early], 0)
    late = rows > anchors[-1]
    result[late] = time[-1] + np.maximum(arrival[late] - stream.arrival[anchors[-1]], 0)
    return result
