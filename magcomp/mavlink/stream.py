"""Raw MAVLink without times: frames that follow one another directly."""

from __future__ import annotations

import numpy as np

from magcomp.mavlink.checksum import checksums
from magcomp.mavlink.header import (
    CHECKSUM_SIZE,
    SIGNATURE_SIZE,
    frame_length,
    is_marker,
    is_signed,
    message_id,
    next_marker,
)
from magcomp.mavlink.messages import crc_extra

_IN_A_ROW = 3
_UNKNOWN = -1


def is_sound(frame: bytes) -> bool:
    """Tell whether a whole frame's message is known and its checksum holds."""
    number, table = message_id(frame), crc_extra()
    extra = int(table[number]) if number < len(table) else _UNKNOWN
    if extra == _UNKNOWN:
        return False
    end = len(frame) - CHECKSUM_SIZE - (SIGNATURE_SIZE if is_signed(frame) else 0)
    computed = checksums(
        np.frombuffer(frame, dtype=np.uint8),
        np.array([1], dtype=np.int64),
        np.array([end - 1], dtype=np.int64),
        np.array([extra], dtype=np.uint8),
    )
    return int(computed[0]) == int.from_bytes(frame[end : end + CHECKSUM_SIZE], "little")


def is_unstamped(data: bytes) -> bool:
    """Tell whether three sound frames in ``data`` follow one another with nothing between them.

    In a telemetry log eight bytes of time stand between any two.
    """
    start = next_marker(data, 0)
    row = 0
    while (length := frame_length(data, start)) is not None:
        end = start + length
        whole = bool(length) and end <= len(data)
        # Most false markers fail here, long before a checksum.
        follows = whole and (end == len(data) or is_marker(data[end]))
        if follows and is_sound(data[start:end]):
            row += 1
            if row == _IN_A_ROW:
                return True
            start = end
        else:
            row = 0
            start = next_marker(data, start + 1)
    return False
