"""Levelling, heading and rotations against each other: docs/method.md, Equations 1 to 11."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magcomp.geometry import (
    angles_of,
    body_from_earth,
    gravity_direction,
    heading,
    heading_shift,
    level_matrix,
    wrap_angle,
)

# Away from straight up and down, where heading has no meaning.
rolls = st.floats(-np.pi, np.pi)
pitches = st.floats(-1.4, 1.4)
yaws = st.floats(-10.0, 10.0)
dips = st.floats(-1.3, 1.3)
declinations = st.floats(-np.pi, np.pi)
vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)


def earth(dip: float, declination: float = 0.0, strength: float = 500.0) -> np.ndarray:
    """A field in north-east-down axes from its dip and declination."""
    horizontal = strength * np.cos(dip)
    return np.array(
        [
            horizontal * np.cos(declination),
            horizontal * np.sin(declination),
            strength * np.sin(dip),
        ]
    )


def angle_between(a: float, b: float) -> float:
    return float(abs(wrap_angle(a - b)))


@given(rolls, pitches)
def test_equation_1_is_the_matrix_the_paper_prints(roll, pitch):
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    printed = [[cp, sr * sp, cr * sp], [0, cr, -sr], [-sp, sr * cp, cr * cp]]
    assert np.allclose(level_matrix(roll, pitch), printed, atol=1e-15)


@given(rolls, st.floats(-np.pi, np.pi), yaws)
def test_levelling_and_turning_are_rotations(roll, pitch, yaw):
    for rotation in (level_matrix(roll, pitch), body_from_earth(roll, pitch, yaw)):
        assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)


@given(rolls, pitches)
def test_gravity_in_body_axes_levels_to_straight_down(roll, pitch):
    level = level_matrix(roll, pitch) @ gravity_direction(roll, pitch)
    assert np.allclose(level, [0.0, 0.0, 1.0], atol=1e-12)


def test_body_axes_turn_the_way_aviation_says():
    north, east, down = np.eye(3)
    assert np.allclose(body_from_earth(0, 0, np.pi / 2) @ east, [1, 0, 0])  # facing east
    assert np.allclose(body_from_earth(0, np.pi / 2, 0) @ -down, [1, 0, 0])  # nose up
    assert np.allclose(body_from_earth(np.pi / 2, 0, 0) @ down, [0, 1, 0])  # right side down
    assert np.allclose(body_from_earth(0, 0, 0) @ north, [1, 0, 0])


@given(rolls, pitches, yaws, dips, declinations)
def test_the_heading_of_the_earths_field_is_the_yaw_at_every_attitude(
    roll, pitch, yaw, dip, declination
):
    field = body_from_earth(roll, pitch, yaw) @ earth(dip, declination)
    assert angle_between(heading(field, roll, pitch, declination), yaw) < 1e-9


@given(pitches, rolls, yaws, dips)
def test_equation_2_is_printed_in_level_components(pitch, roll, yaw, dip):
    x, y, z = field = body_from_earth(roll, pitch, yaw) @ earth(dip)
    x_level = (
        x * np.cos(pitch) + y * np.sin(roll) * np.sin(pitch) + z * np.cos(roll) * np.sin(pitch)
    )
    y_level = y * np.cos(roll) - z * np.sin(roll)
    assert angle_between(heading(field, roll, pitch), np.arctan2(-y_level, x_level)) < 1e-9


@given(st.lists(st.tuples(rolls, pitches, yaws), min_size=1, max_size=5))
def test_many_attitudes_at_once_give_what_each_gives_alone(attitudes):
    roll, pitch, yaw = np.array(attitudes).T
    fields = body_from_earth(roll, pitch, yaw) @ earth(1.0)
    together = heading(fields, roll, pitch)
    alone = [heading(f, r, p) for f, r, p in zip(fields, roll, pitch, strict=True)]
    assert np.array_equal(together, np.array(alone))


@given(rolls, pitches, yaws, dips, vectors)
def test_equation_7_is_the_derivative_of_equation_2(roll, pitch, yaw, dip, direction):
    field = body_from_earth(roll, pitch, yaw) @ earth(dip)
    step = 1e-3
    there, back = (heading(field + s * step * direction, roll, pitch) for s in (1, -1))
    difference = float(wrap_angle(there - back)) / (2 * step)
    shift = float(heading_shift(direction, field, roll, pitch))
    assert shift == pytest.approx(difference, abs=1e-8)


@given(rolls, pitches, yaws, dips)
def test_equation_8_level_components_follow_dip_and_heading(roll, pitch, yaw, dip):
    x, y, _ = level_matrix(roll, pitch) @ body_from_earth(roll, pitch, yaw) @ earth(dip)
    horizontal = 500.0 * np.cos(dip)
    assert x**2 + y**2 == pytest.approx(horizontal**2)
    assert x == pytest.approx(horizontal * np.cos(yaw), abs=1e-9)
    assert y == pytest.approx(-horizontal * np.sin(yaw), abs=1e-9)


@given(rolls, pitches, yaws, dips, vectors)
def test_equation_9_says_the_same_as_equation_7(roll, pitch, yaw, dip, disturbance):
    field = body_from_earth(roll, pitch, yaw) @ earth(dip)
    moved = level_matrix(roll, pitch) @ disturbance
    expected = -(np.cos(yaw) * moved[1] + np.sin(yaw) * moved[0]) / (500.0 * np.cos(dip))
    assert float(heading_shift(disturbance, field, roll, pitch)) == pytest.approx(
        expected, abs=1e-12
    )


@given(rolls, pitches, yaws, dips, st.floats(0.0, 100.0), rolls, pitches)
def test_equations_10_and_11_the_shift_grows_with_the_size_of_the_disturbance(
    roll, pitch, yaw, dip, size, azimuth, elevation
):
    field = body_from_earth(roll, pitch, yaw) @ earth(dip)
    direction = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    one = float(heading_shift(direction, field, roll, pitch))
    assert float(heading_shift(size * direction, field, roll, pitch)) == pytest.approx(
        size * one, abs=1e-12
    )


@given(rolls, pitches, yaws, dips, st.floats(0.1, 10.0))
def test_heading_and_its_shift_do_not_depend_on_the_unit(roll, pitch, yaw, dip, unit):
    field = body_from_earth(roll, pitch, yaw) @ earth(dip)
    disturbance = np.array([3.0, -2.0, 5.0])
    assert angle_between(heading(unit * field, roll, pitch), heading(field, roll, pitch)) < 1e-9
    assert np.allclose(
        heading_shift(unit * disturbance, unit * field, roll, pitch),
        heading_shift(disturbance, field, roll, pitch),
    )


@given(st.floats(-1e4, 1e4))
def test_wrapped_angles_are_the_same_angles_within_half_a_turn(angle):
    wrapped = float(wrap_angle(angle))
    assert -np.pi <= wrapped < np.pi
    assert np.sin(wrapped) == pytest.approx(np.sin(angle), abs=1e-9)
    assert np.cos(wrapped) == pytest.approx(np.cos(angle), abs=1e-9)


def times(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The product of two quaternions, w first."""
    w, v = one[0], one[1:]
    return np.array(
        [w * other[0] - v @ other[1:], *(w * other[1:] + other[0] * v + np.cross(v, other[1:]))]
    )


@given(roll=rolls, pitch=pitches, yaw=st.floats(-3.1, 3.1))
def test_the_angles_of_a_quaternion_are_those_it_was_turned_by(roll, pitch, yaw):
    x, y, z = (
        np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.eye(3)[axis])])
        for axis, angle in enumerate((roll, pitch, yaw))
    )
    found = angles_of([times(times(z, y), x)])[0]
    assert wrap_angle(found - [roll, pitch, yaw]) == pytest.approx(np.zeros(3), abs=1e-6)


def test_where_no_field_is_horizontal_a_shift_is_a_number_too() -> None:
    fields = np.array([[0.0, 0.0, 400.0], [0.0, 0.0, 0.0]])
    assert np.isfinite(heading_shift(np.ones((2, 3)), fields, np.zeros(2), np.zeros(2))).all()
