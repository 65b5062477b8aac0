"""Records of a telemetry log: eight bytes of time and one whole frame, one after the other.

The time is a big-endian count of microseconds since 1970, by the recorder's clock.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

from magcomp.mavlink.header import Bytes, frame_length

_STAMP = struct.Struct(">Q")
STAMP_SIZE = _STAMP.size

_YEAR_2000_US = 946_684_800_000_000
_YEAR_2100_US = 4_102_444_800_000_000
_SHORTEST = STAMP_SIZE + 3


def record(unix_us: int, frame: bytes) -> bytes:
    """One record of a frame that arrived at ``unix_us``."""
    return _STAMP.pack(unix_us) + frame


def records(data: Bytes) -> Iterator[tuple[int, bytes]]:
    """Times in µs and whole frames of a log's bytes; what is neither is passed over.

    Checksums are not looked at. Records before the year 2000 or after 2100 are taken for noise.
    """
    position = 0
    while position + _SHORTEST <= len(data):
        (stamp,) = _STAMP.unpack_from(data, position)
        length = frame_length(data, position + STAMP_SIZE)
        if not length or not _YEAR_2000_US < stamp < _YEAR_2100_US:
            position += 1
            continue
        end = position + STAMP_SIZE + length
        if end > len(data):
            return
        yield stamp, bytes(data[position + STAMP_SIZE : end])
        position = end


def chain(data: bytes | bytearray) -> Iterator[tuple[bytes, bytes]]:
    """Each record and its frame, where nothing but whole records of any time follow another."""
    position = 0
    while position < len(data):
        length = frame_length(data, position + STAMP_SIZE)
        if not length:
            return
        end = position + STAMP_SIZE + length
        whole = bytes(data[position:end])
        yield whole, whole[STAMP_SIZE:]
        position = end
