"""The messages magcomp needs: their numbers, their layouts, and frames decoded into columns.

The layouts stand in dialect.txt, which ``tests/mavlink/write_dialect.py`` writes from pymavlink's
message map. pymavlink itself, with a class for every message, takes longer to import than a log
takes to read, and 100 MB.
"""

from __future__ import annotations

from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
    EXTENDED_SYS_STATE = 245
    STATUSTEXT = 253
    ACTUATOR_OUTPUT_STATUS = 375
    ESC_TELEMETRY_1_TO_4 = 11030
    ESC_TELEMETRY_5_TO_8 = 11031
    ESC_TELEMETRY_9_TO_12 = 11032


WANTED = frozenset(int(message) for message in Message)


@cache
def _dialect() -> dict[int, tuple[int, str]]:
    """CRC_EXTRA and fields, as dialect.txt has them, by message id."""
    lines = Path(__file__).with_name("dialect.txt").read_text(encoding="ascii").splitlines()
    parts = (line.split(" ", 2) for line in lines)
    return {int(number): (int(extra), fields) for number, extra, fields in parts}


@cache
def crc_extra() -> NDArray[np.int16]:
    """CRC_EXTRA by message id, −1 where the id is unknown, shape (65536,)."""
    table = np.full(_LARGEST_KNOWN_ID + 1, -1, dtype=np.int16)
    for number, (extra, _) in _dialect().items():
        table[number] = extra
    table.setflags(write=False)
    return table


@cache
def layout(message: int) -> np.dtype[Any]:
    """Fields of a message in the order of the wire, extensions included.

    Examples
    --------
    >>> layout(Message.ATTITUDE).names
    ('time_boot_ms', 'roll', 'pitch', 'yaw', 'rollspeed', 'pitchspeed', 'yawspeed')
    """
    columns: list[tuple[str, str] | tuple[str, str, int]] = []
    for field in _dialect()[message][1].split():
        name, kind, *count = field.split(":")
        columns.append((name, f"<{kind}", int(count[0])) if count else (name, f"<{kind}"))
    return np.dtype(columns)


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
