"""One time axis for all messages of a vehicle.

Three clocks are in a log. The vehicle's own (milliseconds or microseconds since it was switched
on) is exact but not in every message; it wraps, and starts again with each reboot. The
recorder's is in every record, but radios deliver late and in bursts, a recorder may be set while it
records, and a simulation may run faster than it. The order of the records is always there. So:

- A message with the vehicle's time is put there; a reboot begins a new stretch, which is placed
  after the one before it by the recorder's clock; a wrap is undone.
- Any other message is put between the stamped ones around it by its place in the stream.
- Where the vehicle's clock is missing or stands still, the recorder's is all there is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from magcomp.log.checksum import OffsetArray
from magcomp.log.frames import MaskArray
from magcomp.model import FloatArray

SECOND = 1_000_000
MILLISECOND_WRAP = (1 << 32) * 1000
MICROSECOND_WRAP = 1 << 32
NO_STAMP = -1

# Messages are stamped a little before they are sent, so neighbours may stand in the wrong order.
_DISORDER = SECOND
_NEAR = 60 * SECOND
_USABLE_SHARE = 0.9


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
    """

    rows: NDArray[np.intp]
    time: OffsetArray
    wrap: int


class _Stream(NamedTuple):
    """Recorder's time and place of all frames, shape (n,) each."""

    arrival: OffsetArray
    place: OffsetArray


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
    leaders = [_merged(leading), *others] if leading else [*others]
    usable = [stamps for stamps in leaders if _runs(stamps)]
    if not usable:
        return _recorder_axis(arrival)
    leader, *followers = usable
    elapsed = _unroll(leader, arrival[leader.rows])
    rows = [leader.rows]
    times = [elapsed]
    for stamps in followers:
        settled_rows, settled = _settle(stamps, leader, elapsed, stream)
        rows.append(settled_rows)
        times.append(settled)
    anchor = np.concatenate(rows)
    order = np.argsort(anchor, kind="stable")
    axis = _between(np.concatenate(times)[order], anchor[order], stream)
    return axis.astype(np.float64) / SECOND


def _merged(group: Sequence[Stamps]) -> Stamps:
    """Stamps of one clock from several messages, in the order of the stream."""
    rows = np.concatenate([stamps.rows for stamps in group])
    order = np.argsort(rows, kind="stable")
    time = np.concatenate([stamps.time for stamps in group])[order]
    return Stamps(rows[order], time, group[0].wrap)


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
    reboot = back & ~older
    step = np.where(reboot, np.where(waited > 0, waited, SECOND), step)
    return np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(step)])


def _settle(
    stamps: Stamps, leading: Stamps, elapsed: OffsetArray, stream: _Stream
) -> tuple[NDArray[np.intp], OffsetArray]:
    """Times of another kind of message on the leading axis, where both agree."""
    nothing = np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.int64)
    if not _runs(stamps):
        return nothing
    after = np.searchsorted(leading.rows, stamps.rows)
    before = np.clip(after - 1, 0, len(elapsed) - 1)
    after = np.clip(after, 0, len(elapsed) - 1)
    expected = _between(elapsed, leading.rows, stream)[stamps.rows]
    room = np.abs(elapsed[after] - elapsed[before]) + _DISORDER
    best = np.full(len(stamps.rows), np.iinfo(np.int64).max)
    settled = np.zeros(len(stamps.rows), dtype=np.int64)
    for neighbour in (before, after):
        # Either neighbour may lie on the other side of a reboot.
        time = stamps.time + (elapsed[neighbour] - leading.time[neighbour])
        time += stamps.wrap * np.rint((expected - time) / stamps.wrap).astype(np.int64)
        error = np.abs(time - expected)
        settled = np.where(error < best, time, settled)
        best = np.minimum(error, best)
    usable: MaskArray = best <= room
    if usable.mean() < _USABLE_SHARE:
        return nothing
    return stamps.rows[usable], settled[usable]


def _between(time: OffsetArray, rows: NDArray[np.intp], stream: _Stream) -> OffsetArray:
    """Times of all frames from those of some, by their place between them, shape (n,)."""
    arrival, place = stream
    index = np.arange(len(arrival), dtype=np.intp)
    after = np.searchsorted(rows, index)
    before = rows[np.clip(after - 1, 0, len(rows) - 1)]
    before_time = time[np.clip(after - 1, 0, len(rows) - 1)]
    after = np.clip(after, 0, len(rows) - 1)
    share = (place - place[before]) / np.maximum(place[rows[after]] - place[before], 1)
    gap = arrival[rows[after]] - arrival[before]
    into = arrival - arrival[before]
    by_clock = (gap > 0) & (into >= 0) & (into <= gap)
    share = np.where(by_clock, into / np.where(gap > 0, gap, 1), share)
    result: OffsetArray = before_time + np.rint(share * (time[after] - before_time)).astype(np.int64)
    # Outside the stamped part only the recorder knows how long ago it was.
    early, late = index < rows[0], index > rows[-1]
    result[early] = time[0] - np.maximum(arrival[rows[0]] - arrival[early], 0)
    result[late] = time[-1] + np.maximum(arrival[late] - arrival[rows[-1]], 0)
    result[rows] = time
    return result
