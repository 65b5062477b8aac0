"""What a heading error does to a mission of 50 m legs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from magcomp.report.mission import SIDE_M, mission


def test_a_right_compass_flies_the_square() -> None:
    flown = mission(np.zeros(36))
    assert flown.arrives
    assert flown.stray_m == pytest.approx(0.0, abs=1e-9)
    assert np.ptp(flown.path, axis=0) == pytest.approx([SIDE_M, SIDE_M])


@pytest.mark.parametrize("degrees", [2.0, 10.0, 25.0])
def test_a_constant_error_bends_each_leg_into_the_spiral_it_must_be(degrees: float) -> None:
    # A course that keeps an angle to where it goes is r = L·exp(−θ/tan ε): furthest from its line
    # where θ = ε, by L·sin ε·exp(−ε/tan ε).
    error = np.radians(degrees)
    expected = SIDE_M * np.sin(error) * np.exp(-error / np.tan(error))
    assert mission(np.full(36, error)).stray_m == pytest.approx(expected, rel=0.05, abs=0.05)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.5, 40.0))
def test_the_sign_of_the_error_changes_the_side_and_not_the_distance(degrees: float) -> None:
    one, other = (mission(np.full(36, sign * np.radians(degrees))) for sign in (1.0, -1.0))
    # On the first leg, to the north, a heading that reads too much flies to the left.
    count = 90
    assert one.path[:count, 0] == pytest.approx(-other.path[:count, 0])
    assert one.path[count // 2, 0] < 0.0


def test_the_error_of_the_heading_looked_to_is_what_counts() -> None:
    # Wrong only when looking north: the first leg bends, the other three are straight.
    errors = np.zeros(36)
    errors[[35, 0, 1]] = np.radians(5.0)
    path = mission(errors).path
    assert path[:, 0].min() < -0.5
    assert path[:, 1].max() == pytest.approx(SIDE_M, abs=0.3)
    assert path[:, 0].max() == pytest.approx(SIDE_M, abs=0.3)


def test_a_compass_that_points_backwards_never_finds_a_corner() -> None:
    assert not mission(np.full(36, np.radians(150.0))).arrives
