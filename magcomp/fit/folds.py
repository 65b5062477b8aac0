"""Blocks of time held out in turn.

Neighbouring readings share their errors, so single readings held out would prove nothing.
"""

from __future__ import annotations

import numpy as np

from magcomp.fit.robust import recorded_time, time_blocks
from magcomp.model import FloatArray, IntArray

FOLDS = 5
_LEAST_BLOCK_S = 4.0
_ROUNDS = 6


def folds(time: FloatArray, count: int = FOLDS) -> IntArray:
    """Fold 0 … count − 1 of each reading, shape (n,): blocks of time dealt out in turn.

    Every fold gets about six blocks spread over the recording, so that none misses a whole
    manoeuvre and none is a neighbour of itself.

    Examples
    --------
    >>> folds(np.arange(0.0, 300.0, 10.0)).tolist()[:8]
    [0, 1, 2, 3, 4, 0, 1, 2]
    """
    duration = float(recorded_time(time)[-1]) if len(time) else 0.0
    length = max(_LEAST_BLOCK_S, duration / (count * _ROUNDS))
    return np.asarray(time_blocks(time, length) % count)
