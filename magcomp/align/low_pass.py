"""A first-order low pass, as autopilots and sensors have them."""

from __future__ import annotations

import numpy as np

from magcomp.model import FloatArray

_MOST_GROWTH = 1e8
"""How far weights may grow within a block: half the digits of a float64 stay."""


def low_pass(values: FloatArray, share: float, start: FloatArray | float = 0.0) -> FloatArray:
    """Follow values: each step goes a share of the way from the last result to the new value.

    Parameters
    ----------
    values
        At even steps, shape (n, k).
    share
        Of the way at each step, 0 < share ≤ 1.
    start
        Result before the first step, shape (k,).

    Returns
    -------
    ndarray
        Shape (n, k).

    Notes
    -----
    y_n = r · y_(n−1) + share · x_n with r = 1 − share, so y_n / rⁿ is a running sum. It is taken in
    blocks, within which 1 / rⁿ stays small enough for the sum to keep its digits.

    Examples
    --------
    >>> low_pass(np.array([[1.0], [1.0], [1.0]]), 0.5).ravel().tolist()
    [0.5, 0.75, 0.875]
    """
    rest = 1.0 - share
    if rest <= 0.0 or not len(values):
        return np.array(values, dtype=np.float64)
    size, columns = values.shape
    length = max(min(int(np.log(_MOST_GROWTH) / -np.log(rest)), size), 1)
    count = -(-size // length)
    # Times as the last axis: a running sum is fastest along the memory.
    padded = np.zeros((columns, count * length))
    padded[:, :size] = values.T
    power = rest ** np.arange(1, length + 1)
    total = np.cumsum(padded.reshape(columns, count, length) * (share / power), axis=2)
    before = np.empty((columns, count))
    now = np.broadcast_to(start, columns).astype(np.float64)
    for index in range(count):
        before[:, index] = now
        now = power[-1] * (now + total[:, index, -1])
    total += before[:, :, np.newaxis]
    total *= power
    return np.asarray(total.reshape(columns, -1)[:, :size].T)
