"""Hostile inputs from sound ones: bytes turned, cut and doubled, or frames with hostile values."""

from __future__ import annotations

import functools
import random
import struct
from collections.abc import Sequence

import numpy as np
from pymavlink.generator.mavcrc import x25crc

from magcomp.mavlink import header
from magcomp.mavlink.messages import crc_extra
from magcomp.mavlink.records import record, records

_FLOATS = [
    struct.pack("<f", value)
    for value in (0.0, -0.0, 1.0, -1.0, 1e-38, 1e38, -3e38, float("inf"), -float("inf"))
] + [b"\0\0\xc0\x7f", b"\1\0\x80\xff", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80"]
_WORDS = (
    b"<script>",
    b"=1+1",
    b"\x1b[31m",
    b"\r\n",
    b"\0",
    b"../../x",
    b"@SUM(A1)",
    b"%s{}",
    b"\xff",
)
_MOST = 1 << 20
"""No input grows beyond a mebibyte."""

_USUAL = 2000


def drawn(chance: random.Random, seeds: Sequence[bytes]) -> bytes:
    """One of the seeds, a short one rather than a long one: it is tried so much faster."""
    return chance.choices(seeds, [1 / (_USUAL + len(seed)) ** 2 for seed in seeds])[0]


def of_bytes(chance: random.Random, seeds: Sequence[bytes]) -> bytes:
    """A seed with a few bytes, numbers, words or stretches changed."""
    data = bytearray(drawn(chance, seeds))
    for _ in range(chance.choice((1, 1, 1, 2, 4, 64 if len(data) > _USUAL else 12))):
        at = chance.randrange(len(data) + 1)
        match chance.randrange(8):
            case 0:
                data[at : at + 1] = bytes([chance.randrange(256)])
            case 1:
                data[at : at + 4] = chance.choice(_FLOATS)
            case 2:
                data[at:at] = chance.choice(_WORDS)
            case 3:
                del data[at : at + chance.choice((1, 4, 64, 1024))]
            case 4:
                end = at + chance.choice((1, 16, 256, 4096))
                data[at:at] = data[at:end] * chance.choice((1, 1, 2, 9))
            case 5:
                other = chance.choice(seeds)
                start = chance.randrange(len(other) + 1)
                data[at:at] = other[start : start + chance.choice((8, 128, 2048))]
            case 6:
                data[at : at + 1] = bytes(
                    [data[at] ^ (1 << chance.randrange(8))] if data[at:] else []
                )
            case _:
                data[at : at + 8] = chance.randbytes(8)
    return bytes(data[:_MOST])


def of_frames(chance: random.Random, seeds: Sequence[bytes]) -> bytes:
    """A telemetry log of sound frames, some with hostile values, late, early, lost or doubled."""
    said, kinds = _said(drawn(chance, seeds))
    # Now and then all messages of one kind say the same nonsense.
    every = chance.choice(kinds) if kinds and chance.random() < 0.4 else -1
    share = chance.choice((0.0, 0.001, 0.02, 0.3))
    place, pattern = chance.randrange(40), chance.choice(_FLOATS)
    made = []
    for stamp, frame, kind in said:
        if kind == every:
            made.append((stamp, changed(frame, place, pattern)))
        elif chance.random() < share:
            made += _disturbed(chance, stamp, frame)
        else:
            made.append((stamp, frame))
    return b"".join(record(stamp, frame) for stamp, frame in made)[:_MOST]


@functools.lru_cache(maxsize=256)
def _said(seed: bytes) -> tuple[list[tuple[int, bytes, int]], list[int]]:
    """Time, frame and message number of a seed's records, and which numbers there are."""
    said = [(stamp, frame, header.message_id(frame)) for stamp, frame in records(seed)]
    return said, sorted({kind for _, _, kind in said})


def _disturbed(chance: random.Random, stamp: int, frame: bytes) -> list[tuple[int, bytes]]:
    match chance.randrange(6):
        case 0:
            return []
        case 1:
            return [(stamp, frame)] * chance.choice((2, 50))
        case 2:
            return [(max(stamp + chance.randrange(-(10**12), 10**12), 0) % (1 << 60), frame)]
        case 3:
            return [(stamp, frame[:5] + bytes([chance.randrange(256)]) + frame[6:])]
        case _:
            return [(stamp, changed(frame, chance.randrange(40), chance.choice(_FLOATS)))]


def changed(frame: bytes, place: int, pattern: bytes) -> bytes:
    """A frame with other bytes somewhere in its payload, and the checksum that goes with it."""
    extra = crc_extra()
    number = header.message_id(frame)
    if number >= len(extra) or extra[number] < 0 or header.is_signed(frame):
        return frame
    payload = bytearray(header.payload(frame))
    at = place % len(payload) if payload else 0
    payload[at : at + len(pattern)] = pattern[: len(payload) - at]
    first = 6 if header.is_version_1(frame) else 10
    body = frame[1:first] + bytes(payload)
    check = x25crc(body + bytes([int(np.int64(extra[number]))])).crc
    return frame[:1] + body + int(check).to_bytes(2, "little")
