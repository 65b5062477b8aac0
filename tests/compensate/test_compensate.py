"""The correction in the air: one reading, a log at once, and without leaving anything behind."""

import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magcomp.autopilots import ardupilot
from magcomp.compensate import Compensator
from magcomp.errors import InputError
from magcomp.geometry import body_from_earth, heading, level_matrix, wrap_angle
from magcomp.model import CURRENT, THROTTLE, Correction, InForce

EARTH = np.array([250.0, 20.0, -440.0])
DECLINATION = math.atan2(20.0, 250.0)
CORRECTION = Correction(
    offset=np.array([120.0, -40.0, 33.0]),
    soft_iron=np.array([[1.05, 0.02, -0.03], [0.02, 0.94, 0.01], [-0.03, 0.01, 1.08]]),
    motor=np.array([-1.8, 0.7, 2.4]),
)
OTHER = Correction(
    offset=np.array([3.0, 5.0, -7.0]),
    soft_iron=np.diag([1.1, 1.0, 0.9]),
    motor=np.array([0.4, -0.2, 1.0]),
)

numbers = st.floats(-800.0, 800.0)
currents = st.floats(0.0, 80.0)
angles = st.floats(-1.4, 1.4)


def raw_reading(roll, pitch, yaw, u):
    """What the sensor says: the correction turned round."""
    field = body_from_earth(roll, pitch, yaw) @ EARTH
    return np.linalg.solve(CORRECTION.soft_iron, field - u * CORRECTION.vector) - CORRECTION.offset


def level_part(field, roll, pitch):
    """What a heading is made of; where it vanishes, rounding alone decides on the heading."""
    return float(np.linalg.norm((level_matrix(roll, pitch) @ field)[:2]))


@given(angles, angles, st.floats(-3.1, 3.1), currents)
def test_finds_the_true_heading_at_any_attitude_and_control_quantity(roll, pitch, yaw, u):
    compensator = Compensator(CORRECTION, DECLINATION)
    found = compensator.correct(raw_reading(roll, pitch, yaw, u).tolist(), u, roll, pitch)
    assert float(wrap_angle(found - yaw)) == pytest.approx(0.0, abs=1e-9)
    assert compensator.field == pytest.approx(body_from_earth(roll, pitch, yaw) @ EARTH)


@given(st.tuples(numbers, numbers, numbers), currents, angles, angles)
def test_one_reading_and_a_log_at_once_are_the_same(reading, u, roll, pitch):
    compensator = Compensator(CORRECTION, DECLINATION)
    fields, headings = compensator.correct_all(
        np.array([reading]), np.array([u]), np.array([roll]), np.array([pitch])
    )
    single = compensator.correct(reading, u, roll, pitch)
    assert compensator.field == pytest.approx(fields[0], abs=1e-9)
    if level_part(fields[0], roll, pitch) > 1.0:
        assert float(wrap_angle(single - headings[0])) == pytest.approx(0.0, abs=1e-9)


def test_the_log_form_is_what_a_correction_and_a_levelling_give():
    rng = np.random.default_rng(1)
    raw, u = rng.normal(scale=300, size=(50, 3)), rng.uniform(0, 60, 50)
    roll, pitch = rng.uniform(-1, 1, (2, 50))
    fields, headings = Compensator(CORRECTION).correct_all(raw, u, roll, pitch)
    assert fields == pytest.approx(CORRECTION.apply(raw, u))
    assert headings == pytest.approx(heading(CORRECTION.apply(raw, u), roll, pitch))


@given(st.tuples(numbers, numbers, numbers), currents)
def test_over_undoes_what_the_autopilot_did_first(raw, u):
    reported = OTHER.apply(np.array([raw]), np.array([u]))[0]
    over = Compensator.over(CORRECTION, InForce(OTHER, CURRENT), CURRENT)
    over.correct(reported.tolist(), u, 0.0, 0.0)
    assert over.field == pytest.approx(CORRECTION.apply(np.array([raw]), np.array([u]))[0])


def test_over_takes_an_autopilot_whose_motor_compensation_is_off():
    off = InForce(Correction(OTHER.offset, OTHER.soft_iron, np.zeros(3)), None)
    reported = off.correction.apply(np.array([[10.0, 20.0, 30.0]]), np.array([0.0]))[0]
    over = Compensator.over(CORRECTION, off, THROTTLE)
    over.correct(reported.tolist(), 0.5, 0.0, 0.0)
    expected = CORRECTION.apply(np.array([[10.0, 20.0, 30.0]]), np.array([0.5]))[0]
    assert over.field == pytest.approx(expected)


def test_over_refuses_what_one_control_quantity_cannot_undo():
    with pytest.raises(InputError, match=r"off or by current; instead it is by throttle"):
        Compensator.over(CORRECTION, InForce(OTHER, THROTTLE), CURRENT)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_what_is_not_finite_gives_no_heading(bad, place):
    values = [100.0, 200.0, -300.0, 10.0, 0.1, -0.1]
    values[place] = bad
    compensator = Compensator(CORRECTION)
    assert math.isnan(compensator.correct(values[:3], *values[3:]))
    _, headings = compensator.correct_all(
        np.array([values[:3]]), *(np.array([value]) for value in values[3:])
    )
    assert np.isnan(headings[0])


def test_a_hundred_thousand_readings_leave_nothing_behind():
    compensator = Compensator(CORRECTION, DECLINATION)
    reading = [130.0, -20.0, 410.0]
    for _ in range(1000):
        compensator.correct(reading, 12.0, 0.1, -0.2)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        for _ in range(100_000):
            compensator.correct(reading, 12.0, 0.1, -0.2)
        after, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 500
    assert peak - before < 4000


def test_in_force_is_the_autopilots_own_correction():
    values = {
        "COMPASS_MOTCT": 2.0,
        "COMPASS_SCALE2": 1.1,
        **ardupilot.correction_parameters(CORRECTION, 2, 1.1),
    }
    found = ardupilot.ArduPilot().in_force(values, 2)
    assert found.regressor == CURRENT
    raw, u = np.array([[50.0, -60.0, 70.0]]), np.array([21.0])
    expected = ardupilot.correct(raw, u, ardupilot.calibration(values, 2))
    assert found.correction.apply(raw, u) == pytest.approx(expected)
    assert found.correction.apply(raw, u) == pytest.approx(CORRECTION.apply(raw, u), abs=1e-3)


def test_in_force_knows_that_motor_compensation_is_off():
    values = ardupilot.correction_parameters(CORRECTION, 1, 1.0)
    found = ardupilot.ArduPilot().in_force({**values, "COMPASS_MOTCT": 0.0}, 1)
    assert found.regressor is None
    assert not found.correction.vector.any()
