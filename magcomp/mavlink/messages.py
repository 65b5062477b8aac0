"""The messages magcomp needs: their numbers, their layouts, and frames decoded into columns.

The layouts come from pymavlink's message map, so this file holds no field offsets of its own.
Only the map is used: pymavlink's own decoder works message by message.
"""

from __future__ import annotations

from enum import IntEnum
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20.ardupilotmega import mavlink_map

from magcomp.mavlink.checksum import ByteArray, OffsetArray
from magcomp.mavlink.frames import Frames
from magcomp.mavlink.header import payload

# Structured: one named column per field of the message.
Table = NDArray[Any]

_LARGEST_KNOWN_ID = 0xFFFF


class Message(IntEnum):
    """Numbers of the messages that a Recording is made of."""

    HEARTBEAT = 0
    SYS_STATUS = 1
    SYSTEM_TIME = 2
    PARAM_VALUE = 22
    GPS_RAW_INT = 24
    SCALED_IMU = 26
    RAW_IMU = 27
    ATTITUDE = 30
    GLOBAL_POSITION_INT = 33
    SERVO_OUTPUT_RAW = 36
    VFR_HUD = 74
    SCALED_IMU2 = 116
    SCALED_IMU3 = 129
    BATTERY_STATUS = 147
    AUTOPILOT_VERSION = 148
    STATUSTEXT = 253


WANTED = frozenset(int(message) for message in Message)


@cache
def crc_extra() -> NDArray[np.int16]:
    """CRC_EXTRA by message id, −1 where the id is unknown, shape (65536,)."""
    table = np.full(_LARGEST_KNOWN_ID + 1, -1, dtype=np.int16)
    for number, message in mavlink_map.items():
        if number <= _LARGEST_KNOWN_ID:
            table[number] = message.crc_extra
    table.setflags(write=False)
    return table


@cache
def layout(message: int) -> np.dtype[Any]:
    """Fields of a message in the order of the wire, extensions included."""
    known = mavlink_map[message]
    codes = bytes(known.native_format).decode("ascii").lstrip("<")
    columns: list[tuple[str, str] | tuple[str, str, int]] = []
    for name, code, count in zip(known.ordered_fieldnames, codes, known.array_lengths, strict=True):
        if code == "c":
            columns.append((name, f"S{count}"))
        elif count:
            columns.append((name, _FORMATS[code], count))
        else:
            columns.append((name, _FORMATS[code]))
    return np.dtype(columns)


_FORMATS = {code: f"<{code}" for code in "bBhHiIfd"} | {"q": "<i8", "Q": "<u8"}
# numpy's "i" and "I" are four bytes on every platform that numpy knows, as are MAVLink's.


def decode(data: ByteArray, frames: Frames, message: int) -> Table:
    """Columns of frames that all carry ``message``.

    A payload shorter than the layout is continued with zeros, as MAVLink 2 prescribes and
    MAVLink 1 without extensions needs; what a longer one has more is left out.

    Returns
    -------
    Table
        Structured, one row per frame, shape (n,).
    """
    fields = layout(message)
    rows = _payloads(data, frames.payload, frames.length, fields.itemsize)
    return rows.view(fields)[:, 0]


def _payloads(data: ByteArray, start: OffsetArray, length: ByteArray, width: int) -> ByteArray:
    """Payload bytes, cut or zero-filled to ``width``, shape (n, width)."""
    rows = np.zeros((len(start), width), dtype=np.uint8)
    for sent in np.flatnonzero(np.bincount(length)).tolist():
        size = min(sent, width)
        if size:
            which = np.flatnonzero(length == sent)
            # A view of every stretch of `size` bytes; indexing it copies whole rows at once.
            stretches = np.ndarray((len(data) - size + 1,), f"V{size}", data, strides=(1,))
            rows[which, :size] = stretches[start[which]].view(np.uint8).reshape(-1, size)
    return rows


def decode_payload(sent: bytes, message: int) -> Table:
    """Columns of one payload, as sent, shape (1,)."""
    fields = layout(message)
    return np.frombuffer(sent[: fields.itemsize].ljust(fields.itemsize, b"\0"), fields)


def decode_frame(frame: bytes, message: int) -> Any:
    """One whole frame's fields, by the names of its message."""
    return decode_payload(payload(frame), message)[0]


def text(column: NDArray[np.bytes_]) -> list[str]:
    """Fixed-width character field as strings, each ended by its first NUL."""
    entries = column.tolist()
    joined = b"\0".join(entries)
    if joined.count(b"\0") == len(entries) - 1:
        return joined.decode("utf-8", "replace").split("\0")
    return [entry.partition(b"\0")[0].decode("utf-8", "replace") for entry in entries]
