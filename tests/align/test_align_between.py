"""What was told now and then, at the times between: a prediction that biases no slope."""

from __future__ import annotations

import numpy as np
import pytest

from magcomp.align.between import expected
from magcomp.model import Series, interpolate

STEP = 0.01


def wandering(seed, forgets, size=40_000):
    """A first-order Gauss–Markov process every 10 ms."""
    rng = np.random.default_rng(seed)
    kept = np.exp(-STEP / forgets)
    made = np.zeros(size)
    kicks = rng.normal(size=size) * np.sqrt(1.0 - kept**2)
    for row in range(1, size):
        made[row] = kept * made[row - 1] + kicks[row]
    return made


def slope(truth, found):
    """Of the truth on what was found: 1 where the error is independent of it."""
    return float((truth * (found - found.mean())).sum() / ((found - found.mean()) ** 2).sum())


@pytest.mark.parametrize("seed", [1, 2])
def test_a_slope_on_the_expected_mean_is_not_too_small_as_it_is_on_a_line(seed):
    truth, every = wandering(seed, 0.3), 40
    time = np.arange(len(truth)) * STEP
    told = Series(time[::every], truth[::every, None])
    line = interpolate(told, time)[:, 0]
    assert slope(truth, line) < 0.93
    assert slope(truth, expected(told, time)[:, 0]) == pytest.approx(1.0, abs=0.05)


def test_what_is_gone_at_once_is_left_out_where_it_does_not_last():
    slow, rng = wandering(2, 3.0), np.random.default_rng(3)
    told = slow[::20] + rng.normal(size=len(slow[::20]))
    time = np.arange(len(slow)) * STEP
    series = Series(time[::20], told[:, None])
    found = expected(series, time[::20], lasting=False)[:, 0]
    assert slope(slow[::20], found) == pytest.approx(1.0, abs=0.05)
    assert slope(slow[::20], expected(series, time[::20])[:, 0]) < 0.7


def test_slow_and_quick_columns_are_each_predicted_by_their_own_memory():
    slow, quick = wandering(4, 6.0), wandering(5, 0.1)
    mixed = np.column_stack([slow + quick, slow - quick])
    time = np.arange(len(slow)) * STEP
    found = expected(Series(time[::50], mixed[::50]), time)
    assert slope(slow, (found[:, 0] + found[:, 1]) / 2.0) == pytest.approx(1.0, abs=0.05)
    between = (np.arange(len(slow)) % 50 > 20) & (np.arange(len(slow)) % 50 < 30)
    left = (found[:, 0] - found[:, 1])[between] / 2.0
    assert np.std(left) < 0.3 * np.std(quick)


def test_few_rows_give_the_mean():
    few = Series(np.arange(5.0), np.array([[1.0], [2.0], [3.0], [4.0], [5.0]]))
    assert expected(few, np.array([2.2, 9.0])).ravel().tolist() == [3.0, 3.0]
