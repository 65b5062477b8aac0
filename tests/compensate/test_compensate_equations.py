"""docs/method.md, Equations 8 to 11 against finite differences of the heading itself."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magcomp.compensate import disturbance, level_components, level_heading_shift, shift_per_size
from magcomp.geometry import body_from_earth, heading, heading_shift, level_matrix, wrap_angle

STRENGTH = 520.0
STEP = 1e-4

angles = st.floats(-np.pi, np.pi)
tilts = st.floats(-0.7, 0.7)
dips = st.floats(-1.2, 1.2)


def body_field(dip, roll, pitch, yaw):
    earth = STRENGTH * np.array([np.cos(dip), 0.0, np.sin(dip)])
    return body_from_earth(roll, pitch, yaw) @ earth


@given(dips, angles)
def test_8_level_components_are_those_of_the_levelled_field(dip, yaw):
    levelled = level_matrix(0.3, -0.2) @ body_field(dip, 0.3, -0.2, yaw)
    assert level_components(STRENGTH, dip, yaw) == pytest.approx(levelled[:2], abs=1e-9)


@given(dips, angles)
def test_8_level_components_have_the_horizontal_strength(dip, yaw):
    forward, right = level_components(STRENGTH, dip, yaw)
    assert forward**2 + right**2 == pytest.approx((STRENGTH * np.cos(dip)) ** 2)


@given(dips, angles, angles)
def test_9_is_the_slope_of_the_heading_in_level_axes(dip, yaw, direction):
    shift = STEP * np.array([np.cos(direction), np.sin(direction)])
    forward, right = level_components(STRENGTH, dip, yaw)
    moved = np.arctan2(-(right + shift[1]), forward + shift[0])
    found = level_heading_shift(*shift, STRENGTH, dip, yaw)
    assert found == pytest.approx(float(wrap_angle(moved - yaw)), rel=1e-4, abs=1e-12)


def test_10_points_where_elevation_and_azimuth_say():
    assert disturbance(7.0, 0.0, 0.0) == pytest.approx([7, 0, 0])
    assert disturbance(7.0, 0.0, np.pi / 2) == pytest.approx([0, 7, 0])
    assert disturbance(7.0, np.pi / 2, 1.0) == pytest.approx([0, 0, 7], abs=1e-12)


@given(st.floats(0.0, 500.0), angles, angles)
def test_10_has_the_size_it_is_given(size, elevation, azimuth):
    assert np.linalg.norm(disturbance(size, elevation, azimuth)) == pytest.approx(size)


def test_10_takes_arrays():
    assert disturbance([1.0, 2.0], 0.1, [[0.2], [0.3], [0.4]]).shape == (3, 2, 3)


@given(angles, angles, dips, tilts, tilts, angles)
def test_11_is_the_slope_of_the_heading_against_the_size(elevation, azimuth, dip, roll, pitch, yaw):
    field = body_field(dip, roll, pitch, yaw)
    there = heading(field + disturbance(STEP, elevation, azimuth), roll, pitch)
    back = heading(field - disturbance(STEP, elevation, azimuth), roll, pitch)
    slope = shift_per_size(elevation, azimuth, STRENGTH, dip, roll, pitch, yaw)
    assert slope == pytest.approx(float(wrap_angle(there - back)) / (2 * STEP), abs=1e-8)


@given(st.floats(0.0, 20.0), tilts, tilts, angles)
def test_11_says_that_the_shift_is_proportional_to_the_size(size, roll, pitch, yaw):
    field = body_field(1.0, roll, pitch, yaw)
    shift = heading_shift(disturbance(size, 0.4, 2.0), field, roll, pitch)
    assert shift == pytest.approx(
        size * shift_per_size(0.4, 2.0, STRENGTH, 1.0, roll, pitch, yaw), abs=1e-9
    )
