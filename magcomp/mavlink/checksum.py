"""MAVLink's checksum, CRC-16/MCRF4XX, of many frames at once.

The register starts at 0xFFFF, is fed least significant bit first with the
reflected polynomial 0x8408, and takes the message's CRC_EXTRA byte last (MAVLink
guide, "Serialization"). Two bytes go in per step: the register is exactly two
bytes wide, so the next state depends only on (register XOR those bytes).
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

ByteArray = NDArray[np.uint8]
WordArray = NDArray[np.uint16]
OffsetArray = NDArray[np.int64]

_POLYNOMIAL = 0x8408


@cache
def _byte_step() -> WordArray:
    """Register after eight shifts from every state below 256, shape (256,)."""
    state = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        state = np.where(state & 1, (state >> 1) ^ np.uint16(_POLYNOMIAL), state >> 1)
    return state.astype(np.uint16)


@cache
def _word_step() -> WordArray:
    """Register after sixteen shifts from every state, shape (65536,)."""
    step = _byte_step()
    state = np.arange(65536, dtype=np.uint32).astype(np.uint16)
    for _ in range(2):
        state = step[state & 0xFF] ^ (state >> 8)
    return state


def checksums(
    data: ByteArray, start: OffsetArray, length: OffsetArray, extra: ByteArray
) -> WordArray:
    """Checksum of every span ``data[start : start + length]`` followed by its extra byte.

    Parameters
    ----------
    data
        Bytes that hold all spans, shape (size,).
    start, length
        First byte and number of bytes of each span, shape (n,).
    extra
        CRC_EXTRA of each span's message, shape (n,).

    Returns
    -------
    WordArray
        Checksums in the order of ``start``, shape (n,).
    """
    result = np.empty(len(start), dtype=np.uint16)
    if not len(start):
        return result
    # Longest first, so that the spans that still have bytes left are always a prefix.
    order = np.argsort(length.astype(np.uint16), kind="stable")[::-1]
    spans = length[order]
    words = spans >> 1
    still_active = len(words) - np.cumsum(np.bincount(words))
    register = np.full(len(spans), 0xFFFF, dtype=np.uint16)
    first = start[order]
    # The words that begin at even places, then those that begin at odd ones: whichever a span
    # begins with, its next word stands beside it.
    even, odd = data[: len(data) // 2 * 2], data[1 : (len(data) - 1) // 2 * 2 + 1]
    pairs = np.concatenate([even.view("<u2"), odd.view("<u2")])
    position = (first >> 1) + (first & 1) * (len(even) // 2)
    step = _word_step()
    read = np.empty(len(spans), dtype=np.uint16)
    state = np.empty(len(spans), dtype=np.intp)
    # "clip" only spares numpy a copy: no index is out of range.
    for at, n in enumerate(still_active[:-1].tolist()):
        pairs[at:].take(position[:n], out=read[:n], mode="clip")
        np.bitwise_xor(read[:n], register[:n], out=state[:n])
        step.take(state[:n], out=register[:n], mode="clip")
    left = np.flatnonzero(spans & 1)
    register[left] = _add_byte(register[left], data[first[left] + spans[left] - 1])
    result[order] = _add_byte(register, extra[order])
    return result


def _add_byte(register: WordArray, byte: ByteArray) -> WordArray:
    step: WordArray = _byte_step()[(register ^ byte) & 0xFF] ^ (register >> 8)
    return step
