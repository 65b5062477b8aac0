"""The low pass is what its recursion says, whatever its time constant."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magcomp.align.low_pass import low_pass


@given(st.integers(0, 3000), st.floats(1e-6, 1.0), st.integers(0, 99))
def test_every_step_goes_a_share_of_the_way(n: int, share: float, seed: int) -> None:
    values = np.random.default_rng(seed).normal(30.0, 10.0, (n, 2))
    start = np.array([5.0, -5.0])
    expected, now = np.empty_like(values), start
    for index, value in enumerate(values):
        now = now + share * (value - now)
        expected[index] = now
    np.testing.assert_allclose(low_pass(values, share, start), expected, atol=1e-6)


@pytest.mark.parametrize("share", [0.01, 0.5, 0.999, 1.0])
def test_a_constant_stays(share: float) -> None:
    values = np.full((5000, 1), 12.5)
    np.testing.assert_allclose(low_pass(values, share, 12.5), values, rtol=1e-7)
