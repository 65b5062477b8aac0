"""Folds and blocks count what was recorded, not what the clock said meanwhile."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from magcomp.fit.folds import FOLDS, folds
from magcomp.fit.robust import recorded_time, time_blocks


def test_a_steady_clock_is_recorded_time() -> None:
    time = 7.0 + np.arange(1000) * 0.1
    assert np.allclose(recorded_time(time), time - 7.0)


def test_a_clock_that_jumps_by_an_hour_moves_no_fold() -> None:
    time = np.arange(2000) * 0.1
    jumped = np.where(np.arange(2000) < 1000, time, time + 3600.0)
    shares = np.bincount(folds(jumped), minlength=FOLDS) / len(time)
    assert shares.min() > 0.15
    assert np.mean(folds(jumped) == folds(time)) > 0.7
    assert time_blocks(jumped, 5.0)[-1] <= time_blocks(time, 5.0)[-1] + 1


def test_slow_telemetry_is_no_row_of_gaps() -> None:
    time = np.arange(200) * 3.0
    assert np.allclose(recorded_time(time), time)


def test_telemetry_that_comes_more_often_later_on_was_no_row_of_gaps_before() -> None:
    time = np.concatenate([np.arange(100) * 3.0, 300.0 + np.arange(3000) * 0.1])
    assert np.allclose(recorded_time(time), time)


@given(st.lists(st.floats(0.0, 1e9), min_size=1, max_size=60))
def test_blocks_ascend_and_begin_at_zero(moments: list[float]) -> None:
    block = time_blocks(np.sort(np.array(moments)), 5.0)
    assert block[0] == 0
    assert (np.diff(block) >= 0).all()
