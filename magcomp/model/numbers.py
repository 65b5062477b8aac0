"""Numbers of a file or a frame made into numbers to reckon with; medians, steps and the least."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

_NEAR_STEPS = 16


def as_floats(values: NDArray[Any]) -> NDArray[np.float64]:
    """Any numbers as float64, shape kept; a signalling NaN becomes a quiet one, and no warning.

    Examples
    --------
    The bytes of a signalling NaN, which NumPy by itself would warn of:

    >>> signalling = np.frombuffer(bytes.fromhex("0100807f"), dtype="<f4")
    >>> as_floats(signalling).tolist()
    [nan]
    """
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)


def median(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of each column, shape (n,) or (n, k) → () or (k,); NaN where a column holds one.

    Notes
    -----
    By sorting, which processors do many numbers at a time: of a flight's readings in a fifth of the
    time that NumPy's own median takes, and fits ask for thousands.

    Examples
    --------
    >>> median(np.array([[1.0, 7.0], [3.0, np.nan], [2.0, 5.0], [9.0, 6.0]])).tolist()
    [2.5, nan]
    """
    ordered = np.sort(np.array(values.T), axis=-1)
    count = len(values)
    middle = (ordered[..., (count - 1) // 2] + ordered[..., count // 2]) / 2.0
    return np.asarray(np.where(np.isnan(ordered[..., -1]), np.nan, middle))


def usual_steps(step: NDArray[np.float64]) -> NDArray[np.float64]:
    """Median of the steps near each, shape (n,): a stream may be asked for more often later on.

    Parameters
    ----------
    step
        From each moment to the next, shape (n,).

    Examples
    --------
    >>> seldom_then_often = np.r_[np.full(32, 1.0), np.full(320, 0.1)]
    >>> usual_steps(seldom_then_often)[[0, 20, 100]].tolist()
    [1.0, 1.0, 0.1]
    """
    near = -(-len(step) // max(1, len(step) // _NEAR_STEPS))
    padded = np.append(step, np.repeat(step[-1:], -len(step) % near)).reshape(-1, near)
    return np.repeat(median(padded.T), near)[: len(step)]


def least_at(
    cost: Callable[[float], float],
    grid: NDArray[np.float64],
    fine: float,
    low: float = -np.inf,
    high: float = np.inf,
) -> tuple[float, float]:
    """Where a cost is least, and what it is there.

    Parameters
    ----------
    cost
        Asked on the grid, and then half a step to either side of the least, again and again.
    grid
        Even steps, shape (n,), at least two.
    fine
        The last step is no longer than this.
    low, high
        Nothing is asked beyond.

    Examples
    --------
    >>> at, least = least_at(lambda x: (x - 1.3) ** 2, np.linspace(0.0, 2.0, 5), 0.01)
    >>> round(at, 2), round(least, 3)
    (1.3, 0.0)
    """
    tried = {each: cost(each) for each in grid.tolist()}
    step = float(grid[-1] - grid[0]) / (len(grid) - 1)
    while step > fine:
        step /= 2.0
        best = min(tried, key=lambda each: tried[each])
        around = (max(best - step, low), min(best + step, high))
        tried |= {each: cost(each) for each in around if each not in tried}
    best = min(tried, key=lambda each: tried[each])
    return float(best), tried[best]
