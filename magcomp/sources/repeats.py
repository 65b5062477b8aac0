"""Find frames that stand in a log twice, because a block of it was copied or sent again."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from magcomp.mavlink.checksum import OffsetArray
from magcomp.mavlink.frames import Frames, MaskArray
from magcomp.sources.clock import NO_STAMP

# Odd, so that no two keys are mixed alike; large, so that neighbouring ones end far apart.
_MIX = np.int64(0x1E3779B97F4A7C15)


def repeated(frames: Frames, stamp: OffsetArray, rows: Mapping[int, NDArray[np.intp]]) -> MaskArray:
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
    rows
        Which frames carry each message, increasing.
    """
    content = (
        (frames.message.astype(np.int64) << 24)
        | (frames.sequence.astype(np.int64) << 16)
        | frames.checksum
    )
    stamped = stamp != NO_STAMP
    key = np.where(stamped, stamp, frames.arrival)
    # A message whose time only ever goes on stands nowhere twice, and that is soon seen.
    doubtful = [each for each in rows.values() if not _goes_on(key[each])]
    if 2 * sum(map(len, doubtful)) > len(frames):
        copies = _seen_before(key, content)
    else:
        copies = np.zeros(len(frames), dtype=bool)
        among = np.sort(np.concatenate([np.zeros(0, np.intp), *doubtful]))
        copies[among] = _seen_before(key[among], content[among])
    copied = copies & stamped
    if copied.any():
        anchors = np.flatnonzero(stamped)
        bare = np.flatnonzero(~stamped)
        after = np.searchsorted(anchors, bare)
        beside = copied[anchors[np.minimum(after, len(anchors) - 1)]] & (after < len(anchors))
        beside |= copied[anchors[np.maximum(after - 1, 0)]] & (after > 0)
        copies[bare] |= beside & _seen_before(content[bare], content[bare])
    return copies


def _goes_on(time: OffsetArray) -> bool:
    return bool((time[1:] > time[:-1]).all())


def _sharing(mixture: OffsetArray) -> NDArray[np.intp]:
    """Rows whose number stands in other rows too, increasing, shape (k,)."""
    ordered = np.sort(mixture)
    shared = ordered[1:][ordered[1:] == ordered[:-1]]
    return np.flatnonzero(np.isin(mixture, shared)) if len(shared) else np.zeros(0, dtype=np.intp)


def _seen_before(key: OffsetArray, content: OffsetArray) -> MaskArray:
    """Which rows equal an earlier row in both arrays, shape (n,)."""
    result = np.zeros(len(key), dtype=bool)
    # Equal rows have equal mixtures; comparing those alone is fast and nearly always settles it.
    rows = _sharing(key * _MIX + content)
    if not len(rows):
        return result
    ranked = rows[np.lexsort((content[rows], key[rows]))]
    twice = (key[ranked][1:] == key[ranked][:-1]) & (content[ranked][1:] == content[ranked][:-1])
    result[ranked[1:][twice]] = True
    return result
