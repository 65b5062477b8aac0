"""The layout of one MAVLink frame, version 1 and 2 (MAVLink guide, "Packet Serialization").

::

    version 1   FE length sequence system component message(1)                    payload crc(2)
    version 2   FD length incompatible compatible sequence system component message(3)
                                                                payload crc(2) [signature(13)]

A signature is the link's number (1), a time (6, units of 10 µs since 2015) and the first six bytes
of a SHA-256. Functions that take a frame take a whole one, from its marker on.
"""

from __future__ import annotations

import mmap
from typing import NamedTuple

MARKER_1 = 0xFE
MARKER_2 = 0xFD
HEADER_1 = 6
HEADER_2 = 10
CHECKSUM_SIZE = 2
SIGNATURE_SIZE = 13
SIGNED = 0x01
"""The only incompatible flag that this reader knows; a frame with another must not be decoded."""

_DIGEST_SIZE = 6
_ENOUGH = 3

Bytes = bytes | bytearray | mmap.mmap


class Signature(NamedTuple):
    """What stands behind the checksum of a signed frame.

    Attributes
    ----------
    link
        Number that the sender gave the link.
    time
        In units of 10 µs since 2015.
    digest
        First six bytes of SHA-256 over key and ``covered``.
    covered
        What the digest is made of, behind the key.
    """

    link: int
    time: int
    digest: bytes
    covered: bytes


def is_marker(byte: int) -> bool:
    """Tell whether a byte can begin a frame."""
    return byte in (MARKER_1, MARKER_2)


def next_marker(data: bytes | bytearray, position: int) -> int:
    """Index of the next byte that can begin a frame, or the end."""
    found = (data.find(MARKER_1, position), data.find(MARKER_2, position))
    return min((index for index in found if index >= 0), default=len(data))


def frame_length(data: Bytes, start: int) -> int | None:
    """Bytes of the frame whose marker is at ``start``; None while unknown, 0 where it is none."""
    if len(data) - start < _ENOUGH:
        return None
    marker, payload, flags = data[start], data[start + 1], data[start + 2]
    if marker == MARKER_1:
        return HEADER_1 + payload + CHECKSUM_SIZE
    if marker != MARKER_2 or flags & ~SIGNED:
        return 0
    return HEADER_2 + payload + CHECKSUM_SIZE + (SIGNATURE_SIZE if flags else 0)


def is_version_1(frame: bytes | bytearray) -> bool:
    """Tell whether a frame is of MAVLink 1, whose unknown messages cannot be told from noise."""
    return frame[0] == MARKER_1


def message_id(frame: bytes) -> int:
    """Number of the message."""
    return frame[5] if frame[0] == MARKER_1 else int.from_bytes(frame[7:HEADER_2], "little")


def source(frame: bytes) -> tuple[int, int]:
    """System and component that sent the frame."""
    return (frame[3], frame[4]) if frame[0] == MARKER_1 else (frame[5], frame[6])


def sequence(frame: bytes) -> int:
    """The sender's running number, modulo 256."""
    return frame[2] if frame[0] == MARKER_1 else frame[4]


def payload(frame: bytes) -> bytes:
    """Payload as sent; MAVLink 2 leaves its trailing zeros out."""
    begin = HEADER_1 if frame[0] == MARKER_1 else HEADER_2
    return frame[begin : begin + frame[1]]


def is_signed(frame: bytes) -> bool:
    """Tell whether a frame carries a signature."""
    return frame[0] == MARKER_2 and bool(frame[2] & SIGNED)


def signature(frame: bytes) -> Signature:
    """Signature of a signed frame."""
    tail = frame[-SIGNATURE_SIZE:]
    return Signature(
        link=tail[0],
        time=int.from_bytes(tail[1:-_DIGEST_SIZE], "little"),
        digest=tail[-_DIGEST_SIZE:],
        covered=frame[:-_DIGEST_SIZE],
    )
