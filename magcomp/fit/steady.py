"""Levels: stretches in which the control quantity does not change."""

from __future__ import annotations

import numpy as np

from magcomp.model import FloatArray, IntArray, Samples, Series

WINDOW_S = 1.0
"""A reading is steady when the control quantity stays put this long before and after it."""

STEADY_SHARE = 0.03
"""Staying put: changing by less than this share of the range of the control quantity."""

_SPLIT_SHARE = 0.05
_WIDEST_SHARE = 0.1
_LEAST_READINGS = 15


def steady_levels(control: Series, samples: Samples) -> IntArray:
    """Level of each reading, in order of the control quantity; −1 where it belongs to none.

    Parameters
    ----------
    control
        The control quantity against time.
    samples
        Readings with their control quantity.
    """
    span = float(np.ptp(samples.total))
    level = np.full(len(samples), -1, dtype=np.intp)
    if span <= 0.0:
        return level
    steady = _change(control, samples) < STEADY_SHARE * span
    if not steady.any():
        return level
    order = np.argsort(samples.total[steady], kind="stable")
    values = samples.total[steady][order]
    group = np.concatenate([[0], np.cumsum(np.diff(values) > _SPLIT_SHARE * span)])
    numbers = np.full(len(order), -1, dtype=np.intp)
    count = 0
    for index in range(int(group[-1]) + 1):
        members = group == index
        if members.sum() >= _LEAST_READINGS and np.ptp(values[members]) <= _WIDEST_SHARE * span:
            numbers[order[members]] = count
            count += 1
    level[steady] = numbers
    return level


def _change(control: Series, samples: Samples) -> FloatArray:
    """Largest change of the control quantity from each reading's within the window, shape (n,)."""
    first = np.searchsorted(control.time, samples.time - WINDOW_S, side="left")
    last = np.searchsorted(control.time, samples.time + WINDOW_S, side="right")
    change = np.full(len(samples), np.inf)
    seen = last > first
    # reduceat over interleaved starts and ends; every other result is the window's.
    padded = np.append(control.value, control.value[-1])
    bounds = np.column_stack([first[seen], last[seen]]).reshape(-1)
    highest = np.maximum.reduceat(padded, bounds)[::2]
    lowest = np.minimum.reduceat(padded, bounds)[::2]
    change[seen] = np.maximum(highest - samples.total[seen], samples.total[seen] - lowest)
    return change
