"""Find MAVLink frames in the bytes of a telemetry log, all at once.

A telemetry log is a chain of records: eight bytes of time (big-endian microseconds
since 1970, by the recorder's clock) and one MAVLink 1 or 2 frame. Rules kept here:

- A frame is *verified* when its checksum holds. Only verified frames are handed out.
- A frame that is not verified (another dialect's, or damaged) is still a frame when the next
  record begins exactly where it ends and no verified frame lies in it; it is counted only.
- Whatever lies outside those is skipped, and the search goes on at the very next byte, so
  garbage costs no frame but the one it hit, whatever lengths it pretends.
- A frame cut off by the end of the data is not a frame.

The search runs in windows: memory is bounded by the frames wanted, not by the log.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from magcomp.mavlink.checksum import ByteArray, OffsetArray, WordArray, checksums
from magcomp.mavlink.header import (
    CHECKSUM_SIZE,
    HEADER_1,
    HEADER_2,
    MARKER_1,
    MARKER_2,
    SIGNATURE_SIZE,
    SIGNED,
)
from magcomp.mavlink.records import STAMP_SIZE

MaskArray = NDArray[np.bool_]

_SMALLEST_V1 = STAMP_SIZE + HEADER_1 + CHECKSUM_SIZE
_SMALLEST_V2 = STAMP_SIZE + HEADER_2 + CHECKSUM_SIZE
_LARGEST = _SMALLEST_V2 + 255 + SIGNATURE_SIZE

# Every time before the year 2112 has a first byte of 0 and a second one below 16.
_LATEST_SECOND_BYTE = 16

WINDOW = 1 << 19
_WIDE_WINDOW = 1 << 20
# A wide window costs six times its size in memory and saves an eighth of the time.
_WIDE_FROM = 1 << 23
# What is as large as a window takes longer to be had from the system than to be filled.
_STRETCH = 1 << 17


@dataclass(frozen=True, eq=False)
class Frames:
    """Verified frames in the order in which they stand in the log.

    Attributes
    ----------
    payload
        Offset of each payload's first byte in the data, shape (n,).
    length
        Bytes of payload as sent (MAVLink 2 cuts trailing zeros), shape (n,).
    message
        Message id, shape (n,).
    system, component, sequence
        Of the frame's header, shape (n,).
    checksum
        As sent, and found right, shape (n,).
    arrival
        The recorder's time in microseconds since 1970, shape (n,).
    """

    payload: OffsetArray
    length: ByteArray
    message: NDArray[np.int32]
    system: ByteArray
    component: ByteArray
    sequence: ByteArray
    checksum: WordArray
    arrival: OffsetArray

    def __len__(self) -> int:
        return len(self.payload)

    def __getitem__(self, rows: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Frames:
        return Frames(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


@dataclass(frozen=True, eq=False)
class Scan:
    """What a search found.

    Attributes
    ----------
    frames
        The verified frames of the wanted messages.
    total
        Whole frames of any message, verified or not.
    verified
        Frames of any message whose checksum held.
    bad_checksum
        Whole frames of wanted messages whose checksum failed.
    skipped
        Bytes that belong to no frame.
    talkers
        Every (system, component) that sent a verified frame, sorted.
    """

    frames: Frames
    total: int
    verified: int
    bad_checksum: int
    skipped: int
    talkers: tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Places that look like the start of a record. Arrays of shape (n,)."""

    start: OffsetArray
    end: OffsetArray
    payload: OffsetArray
    length: OffsetArray
    message: NDArray[np.int32]

    def __getitem__(self, rows: MaskArray | NDArray[np.intp] | slice) -> _Candidates:
        return _Candidates(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


def scan(
    data: ByteArray,
    wanted: frozenset[int],
    crc_extra: NDArray[np.int16],
    progress: Callable[[float], None] | None = None,
    window: int | None = None,
) -> Scan:
    """Find every frame of a telemetry log and hand out those of the wanted messages.

    Parameters
    ----------
    data
        The log, or any stretch of it, shape (size,).
    wanted
        Message ids to hand out.
    crc_extra
        CRC_EXTRA by message id, −1 for messages nobody knows, shape (ids,).
    progress
        Called with the searched fraction, 0 to 1.
    window
        Bytes searched at a time; None leaves it to the size of the log.
    """
    size = len(data)
    width = window or (WINDOW if size < _WIDE_FROM else _WIDE_WINDOW)
    is_wanted = np.zeros(len(crc_extra), dtype=bool)
    is_wanted[[i for i in wanted if i < len(crc_extra)]] = True
    parts = [_frames_of(data, _candidates(data, 0, 0))]
    seen = np.zeros(1 << 16, dtype=bool)
    total = verified_total = bad = covered = position = 0
    while position < size:
        stop = position + width
        # Frames that begin shortly after the window may still contradict one that ends there.
        found = _candidates(data, position, stop + _LARGEST)
        sound, loose = _sorted_out(data, found, crc_extra)
        sound = sound[: int(np.searchsorted(sound.start, stop))]
        loose = loose[: int(np.searchsorted(loose.start, stop))]
        system = _sequence_at(sound) + 1
        seen[(data[system].astype(np.uint16) << 8) | data[system + 1]] = True
        parts.append(_frames_of(data, sound[is_wanted[sound.message]]))
        total += len(sound.start) + len(loose.start)
        verified_total += len(sound.start)
        bad += int(_lookup(is_wanted, loose.message, default=False).sum())
        covered += int((sound.end - sound.start).sum() + (loose.end - loose.start).sum())
        position = max([stop, *(int(found.end[-1]) for found in (sound, loose) if len(found.end))])
        if progress is not None:
            progress(min(1.0, position / size))
    return Scan(
        frames=_concatenate(parts),
        total=total,
        verified=verified_total,
        bad_checksum=bad,
        skipped=size - covered,
        talkers=tuple((int(pair) >> 8, int(pair) & 0xFF) for pair in np.flatnonzero(seen)),
    )


def _looks_like_record(data: ByteArray, low: int, high: int) -> NDArray[np.intp]:
    """Offsets in [low, high) with a plausible time followed by a frame's first byte."""
    stretches = range(low, high, _STRETCH)
    return np.concatenate(
        [np.zeros(0, np.intp), *(_starts(data, at, min(at + _STRETCH, high)) for at in stretches)]
    )


def _starts(data: ByteArray, low: int, high: int) -> NDArray[np.intp]:
    """The same of one stretch."""
    region = data[low : high + STAMP_SIZE]
    magic = (region[STAMP_SIZE:] - np.uint8(MARKER_2)) <= MARKER_1 - MARKER_2
    magic &= region[:-STAMP_SIZE] == 0
    magic &= region[1 : 1 - STAMP_SIZE] < _LATEST_SECOND_BYTE
    return np.flatnonzero(magic) + low


def _candidates(data: ByteArray, low: int, high: int) -> _Candidates:
    """Every place in [low, high) where a whole record could begin."""
    size = len(data)
    start = _looks_like_record(data, low, max(low, min(high, size - _SMALLEST_V1 + 1)))
    second = data[start + STAMP_SIZE] == MARKER_2
    length = data[start + 9]
    # A frame with flags that this reader does not know must not be decoded (MAVLink guide).
    flags = np.where(second, data[start + 10], 0)
    payload = start + np.where(second, STAMP_SIZE + HEADER_2, STAMP_SIZE + HEADER_1)
    end = payload + length + np.where(flags, CHECKSUM_SIZE + SIGNATURE_SIZE, CHECKSUM_SIZE)
    whole = (end <= size) & (flags <= SIGNED)
    if not whole.all():
        start, second, length = start[whole], second[whole], length[whole]
        payload, end = payload[whole], end[whole]
    at = payload - np.where(second, 3, 1)
    message = data[at].astype(np.int32)
    wide = slice(None) if second.all() else np.flatnonzero(second)
    message[wide] |= data[at[wide] + 1].astype(np.int32) << 8
    message[wide] |= data[at[wide] + 2].astype(np.int32) << 16
    return _Candidates(start, end, payload, length.astype(np.int64), message)


def _lookup(
    table: NDArray[np.bool_] | NDArray[np.int16], message: NDArray[np.int32], default: int
) -> NDArray[np.int64]:
    """Entry of each message id; ``default`` where the table is too short for it."""
    known = message < len(table)
    return np.where(known, table[np.where(known, message, 0)], default)


def _verified(data: ByteArray, found: _Candidates, crc_extra: NDArray[np.int16]) -> MaskArray:
    """Which candidates carry the right checksum, shape (n,)."""
    if not len(found.start):
        return np.zeros(0, dtype=bool)
    extra = _lookup(crc_extra, found.message, default=-1)
    low = int(found.start[0])
    first = found.start + (STAMP_SIZE + 1 - low)
    length = found.payload + found.length - low - first
    region = data[low : int(found.end.max())]
    computed = checksums(region, first, length, extra.astype(np.uint8))
    right: MaskArray = (computed == _checksum_sent(data, found)) & (extra >= 0)
    return right


def _checksum_sent(data: ByteArray, found: _Candidates) -> WordArray:
    at = found.payload + found.length
    sent: WordArray = data[at] | (data[at + 1].astype(np.uint16) << 8)
    return sent


def _sorted_out(
    data: ByteArray, found: _Candidates, crc_extra: NDArray[np.int16]
) -> tuple[_Candidates, _Candidates]:
    """Candidates that are verified frames, and those that are frames by their place alone."""
    followed = _followed(data, found)
    likely = found if followed.all() else found[followed]
    right = _verified(data, likely, crc_extra)
    sound = likely if right.all() else likely[right]
    sound = sound[_disjoint(sound.start, sound.end)]
    # False starts within sound frames are many and need no checksum; a sound frame before garbage
    # is followed by nothing and does.
    unlikely = found[~followed]
    unlikely = unlikely[_free_of(sound, unlikely.start, unlikely.start + 1)]
    late = unlikely[_verified(data, unlikely, crc_extra)]
    if len(late.start):
        sound = _in_order(sound, late)
        sound = sound[_disjoint(sound.start, sound.end)]
    loose = likely[~right]
    loose = loose[_free_of(sound, loose.start, loose.end)]
    return sound, loose[_disjoint(loose.start, loose.end)]


def _followed(data: ByteArray, found: _Candidates) -> MaskArray:
    """Which candidates end where another record begins or the data end, shape (n,)."""
    last = len(data) - STAMP_SIZE - 1
    at = np.minimum(found.end, max(last, 0))
    magic = data[np.minimum(at + STAMP_SIZE, len(data) - 1)]
    record = (magic == MARKER_1) | (magic == MARKER_2)
    record &= (data[at] == 0) & (data[np.minimum(at + 1, len(data) - 1)] < _LATEST_SECOND_BYTE)
    followed: MaskArray = (record & (found.end <= last)) | (found.end == len(data))
    return followed


def _free_of(sound: _Candidates, start: OffsetArray, end: OffsetArray) -> MaskArray:
    """Which spans overlap none of the sound frames, shape (n,)."""
    if not len(sound.start):
        return np.ones(len(start), dtype=bool)
    before = np.searchsorted(sound.start, end, side="left") - 1
    free: MaskArray = (before < 0) | (sound.end[np.maximum(before, 0)] <= start)
    return free


def _in_order(one: _Candidates, other: _Candidates) -> _Candidates:
    """Both together by their start."""
    both = _Candidates(
        **{
            f.name: np.concatenate([getattr(one, f.name), getattr(other, f.name)])
            for f in fields(_Candidates)
        }
    )
    return both[np.argsort(both.start, kind="stable")]


def _disjoint(start: OffsetArray, end: OffsetArray) -> NDArray[np.intp] | slice:
    """Rows left when, going through the sorted spans, each one that overlaps a kept one goes."""
    if (start[1:] >= end[:-1]).all():
        return slice(None)
    rows = np.arange(len(start), dtype=np.intp)
    following = np.searchsorted(start, end, side="left")
    breaks = np.flatnonzero(following != rows + 1)
    runs = []
    row = 0
    for last in breaks.tolist():
        if last >= row:
            runs.append(rows[row : last + 1])
            row = int(following[last])
    runs.append(rows[row:])
    return np.concatenate(runs)


def _sequence_at(found: _Candidates) -> OffsetArray:
    """Offset of the sequence number; the system and the component come after it."""
    second = found.payload - found.start == STAMP_SIZE + HEADER_2
    return found.payload - np.where(second, 6, 4)


def _frames_of(data: ByteArray, found: _Candidates) -> Frames:
    if len(data) < STAMP_SIZE:
        arrival = np.zeros(0, dtype=np.int64)
    else:
        times = np.ndarray((len(data) - STAMP_SIZE + 1,), ">u8", data, strides=(1,))
        arrival = times[found.start].astype(np.int64)
    sequence = _sequence_at(found)
    return Frames(
        payload=found.payload,
        length=found.length.astype(np.uint8),
        message=found.message,
        system=data[sequence + 1],
        component=data[sequence + 2],
        sequence=data[sequence],
        checksum=_checksum_sent(data, found),
        arrival=arrival,
    )


def _concatenate(parts: list[Frames]) -> Frames:
    return Frames(
        **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Frames)}
    )
