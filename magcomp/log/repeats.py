"""Find frames that stand in a log twice, because a block of it was copied or sent again."""

from __future__ import annotations

import numpy as np

from magcomp.log.checksum import OffsetArray
from magcomp.log.clock import NO_STAMP
from magcomp.log.frames import Frames, MaskArray


def repeated(frames: Frames, stamp: OffsetArray) -> MaskArray:
    """Which frames of one vehicle are copies of an earlier one, shape (n,).

    Same message, sequence number and checksum, and either the same time of the vehicle or the
    same time of the recorder. A frame without the vehicle's time is a copy under another
    recorder's time only next to a copied frame that has one: heartbeats, say, truly repeat
    every 256 frames.

    Parameters
    ----------
    frames
        In the order of the stream, shape (n,).
    stamp
        The vehicle's time as sent, or ``NO_STAMP``, shape (n,).
    """
    content = (
        (frames.message.astype(np.int64) << 24)
        | (frames.sequence.astype(np.int64) << 16)
        | frames.checksum
    )
    copies = _seen_before(frames.arrival, content)
    stamped = np.flatnonzero(stamp != NO_STAMP)
    copied = _seen_before(stamp[stamped], content[stamped])
    copies[stamped] |= copied
    if copied.any():
        bare = np.flatnonzero(stamp == NO_STAMP)
        after = np.searchsorted(stamped, bare)
        last = len(stamped) - 1
        beside = copied[np.minimum(after, last)] & (after <= last)
        beside |= copied[np.maximum(after - 1, 0)] & (after > 0)
        copies[bare] |= beside & _seen_before(content[bare], content[bare])
    return copies


def _seen_before(key: OffsetArray, content: OffsetArray) -> MaskArray:
    """Which rows equal an earlier row in both arrays, shape (n,)."""
    result = np.zeros(len(key), dtype=bool)
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    same = ordered[1:] == ordered[:-1]
    if not same.any():
        return result
    # Only rows that share their key need the full comparison.
    among = np.zeros(len(key), dtype=bool)
    among[1:] |= same
    among[:-1] |= same
    rows = np.sort(order[among])
    ranked = rows[np.lexsort((content[rows], key[rows]))]
    twice = (key[ranked][1:] == key[ranked][:-1]) & (content[ranked][1:] == content[ranked][:-1])
    result[ranked[1:][twice]] = True
    return result
