"""Compass and gyro fused: what a pilot may rely on, on motions whose truth is a formula."""

import math

import numpy as np
import pytest
from effort import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from magcomp.compensate import Compensator, Fusion, Motion, Reading, Tuning, fuse
from magcomp.geometry import body_from_earth, gravity_direction, wrap_angle
from magcomp.model import Correction

DECLINATION = 0.06
EARTH = np.array([230.0 * math.cos(DECLINATION), 230.0 * math.sin(DECLINATION), 420.0])
NOTHING = Correction(offset=np.zeros(3), soft_iron=np.eye(3), motor=np.zeros(3))
STILL_GYRO, LEVEL = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)


class Turning:
    """A vehicle that swings and turns; every sensor follows from three formulas."""

    def __init__(self, rate=0.8, tilt=0.3):
        self.rate, self.tilt = rate, tilt

    def angles(self, time):
        roll = self.tilt * np.sin(0.9 * time)
        pitch = self.tilt * np.sin(0.7 * time + 1.0)
        return roll, pitch, 2.5 + self.rate * time

    def gyro(self, time):
        """Body rates from the rates of the angles."""
        roll, pitch, _ = self.angles(time)
        d_roll = 0.9 * self.tilt * math.cos(0.9 * time)
        d_pitch = 0.7 * self.tilt * math.cos(0.7 * time + 1.0)
        return (
            d_roll - self.rate * math.sin(pitch),
            d_pitch * math.cos(roll) + self.rate * math.sin(roll) * math.cos(pitch),
            -d_pitch * math.sin(roll) + self.rate * math.cos(roll) * math.cos(pitch),
        )

    def motion(self, time, bias=(0.0, 0.0, 0.0)):
        roll, pitch, _ = self.angles(time)
        gyro = np.add(self.gyro(time), bias).tolist()
        return Motion(time, gyro, gravity_direction(roll, pitch).tolist())

    def reading(self, time, rng=None, noise=0.0):
        roll, pitch, yaw = self.angles(time)
        field = body_from_earth(roll, pitch, yaw) @ EARTH
        if rng is not None:
            field = field + rng.normal(scale=noise, size=3)
        return Reading(time, field.tolist(), 0.0, roll, pitch)


def fly(
    vehicle, seconds=40.0, gyro_hz=50, field_hz=10, lag=0.08, bias=(0.0, 0.0, 0.0), noise=0.0,
    silent=(math.inf, math.inf), tuning=None, rng=None,
):  # fmt: skip
    """Errors of the fused heading, radians, by time; NaN before the first reading."""
    rng = np.random.default_rng(3) if rng is None else rng
    arrivals = []
    for index in range(int(seconds * field_hz)):
        measured = index / field_hz
        if not silent[0] <= measured < silent[1]:
            reading = vehicle.reading(measured, rng, noise)
            arrivals.append((measured + lag, 1, reading))
    for index in range(int(seconds * gyro_hz)):
        arrivals.append((index / gyro_hz, 0, vehicle.motion(index / gyro_hz, bias)))
    events = [event for _, _, event in sorted(arrivals, key=lambda arrival: arrival[:2])]
    answers = list(fuse(events, Compensator(NOTHING, DECLINATION), Fusion(tuning)))
    time = np.array([answer.time for answer in answers])
    true = vehicle.angles(time)[2]
    return time, wrap_angle(np.array([answer.fused for answer in answers]) - true)


def after(time, error, seconds):
    return np.degrees(np.abs(error[time > seconds]))


def test_follows_a_swinging_turn_through_north_again_and_again():
    time, error = fly(Turning())
    assert after(time, error, 1.0).max() < 0.3


def test_a_late_field_does_not_turn_the_heading():
    """At 60°/s a tenth of a second of lag would be 6° if nobody knew of it."""
    time, error = fly(Turning(rate=math.radians(60.0)), lag=0.1)
    assert after(time, error, 1.0).max() < 0.3


def test_averages_the_compass_noise_away():
    noise = 4.0
    time, error = fly(Turning(), noise=noise)
    alone = math.degrees(noise / math.hypot(EARTH[0], EARTH[1]))
    assert np.sqrt(np.mean(after(time, error, 5.0) ** 2)) < 0.4 * alone


def test_learns_the_gyros_bias():
    bias = (0.01, -0.02, 0.03)
    time, error = fly(Turning(), seconds=180.0, bias=bias)
    assert after(time, error, 120.0).max() < 0.5
    unaware = Tuning(bias_gain=0.0)
    time, lost = fly(Turning(), seconds=180.0, bias=bias, tuning=unaware)
    assert after(time, lost, 120.0).mean() > 2.0


def test_the_bias_it_learned_can_be_read():
    vehicle, fusion, bias = Turning(rate=0.1), Fusion(), (0.01, -0.02, 0.015)
    compensator = Compensator(NOTHING, DECLINATION)
    events = []
    for index in range(9000):
        time = index / 50
        events.append(vehicle.motion(time, bias))
        if index % 5 == 0:
            events.append(vehicle.reading(time))
    for _ in fuse(events, compensator, fusion):
        pass
    assert fusion.bias == pytest.approx(bias, abs=0.002)


def test_a_gap_of_the_field_is_bridged_by_the_gyro():
    time, error = fly(Turning(), silent=(15.0, 25.0))
    assert after(time, error, 1.0).max() < 0.6


def test_a_long_gap_of_the_field_begins_anew_with_the_next_reading():
    tuning = Tuning(coast_s=20.0)
    time, error = fly(
        Turning(), seconds=60.0, bias=(0.0, 0.0, 0.02), silent=(10.0, 50.0), tuning=tuning
    )
    assert np.isnan(error[(time > 31.0) & (time < 49.9)]).all()
    assert np.degrees(np.abs(error[(time > 50.2) & (time < 51.0)])).max() < 1.0


def test_a_gap_of_the_gyro_begins_anew_because_nobody_saw_the_turn():
    vehicle = Turning()
    times = [t / 50 for t in range(2000) if not 500 <= t < 750]
    events = [event for t in times for event in (vehicle.motion(t), vehicle.reading(t))]
    answers = list(fuse(events, Compensator(NOTHING, DECLINATION), Fusion()))
    at = {round(answer.time, 2): answer.fused for answer in answers}
    assert math.isnan(at[15.0])
    assert abs(wrap_angle(at[15.1] - vehicle.angles(15.1)[2])) < math.radians(0.5)


def test_a_clock_that_goes_far_back_begins_anew():
    fusion = Fusion()
    for start in (100.0, 0.0):
        for index in range(20):
            fusion.motion(start + index / 50, STILL_GYRO, LEVEL)
            fusion.compass(start + index / 50, start / 100.0)
        assert fusion.heading == pytest.approx(start / 100.0, abs=1e-3)


def test_a_10_hz_gyro_is_enough_for_ordinary_flying():
    time, error = fly(Turning(), gyro_hz=10, field_hz=10)
    assert after(time, error, 2.0).max() < 1.0


def test_a_faster_gyro_sees_every_turn_between_two_readings():
    time, error = fly(Turning(rate=1.5), gyro_hz=200, field_hz=2)
    assert after(time, error, 2.0).max() < 0.5


def test_knows_no_heading_before_the_first_reading():
    fusion = Fusion()
    assert all(math.isnan(fusion.motion(t / 50, STILL_GYRO, LEVEL)) for t in range(10))
    fusion.compass(0.2, 1.0)
    assert fusion.motion(0.22, STILL_GYRO, LEVEL) == pytest.approx(1.0)


def test_a_reading_with_the_nose_straight_up_is_left_out():
    fusion, compensator = Fusion(), Compensator(NOTHING)
    flat = Reading(0.0, (200.0, 0.0, 400.0), 0.0, 0.0, 0.0)
    steep = Reading(1.0, (-400.0, 90.0, 200.0), 0.0, 0.0, math.pi / 2)
    motions = [Motion(t / 10, STILL_GYRO, LEVEL) for t in range(30)]
    events = [motions[0], flat, *motions[1:11], steep, *motions[11:]]
    answers = list(fuse(events, compensator, fusion))
    assert answers[-1].fused == pytest.approx(0.0, abs=1e-3)


bad = st.sampled_from([math.nan, math.inf, -math.inf])


@given(bad, st.integers(0, 5))
def test_a_sample_that_is_not_finite_changes_nothing(value, place):
    fusion = Fusion()
    fusion.motion(0.0, STILL_GYRO, LEVEL)
    fusion.compass(0.0, 0.5)
    heading = fusion.motion(0.02, STILL_GYRO, LEVEL)
    numbers = [*STILL_GYRO, *LEVEL]
    numbers[place] = value
    assert fusion.motion(0.04, numbers[:3], numbers[3:]) == heading
    fusion.compass(0.04, value)
    assert fusion.motion(0.06, STILL_GYRO, LEVEL) == pytest.approx(heading, abs=1e-6)


events_of_any_kind = st.one_of(
    st.builds(
        Motion,
        st.floats(-10, 100),
        st.tuples(*[st.floats(-40, 40)] * 3),
        st.tuples(*[st.floats(-20, 20)] * 3),
    ),
    st.builds(
        Reading,
        st.floats(-10, 100),
        st.tuples(*[st.floats(-1e4, 1e4)] * 3),
        st.floats(0, 100),
        st.floats(-math.pi, math.pi),
        st.floats(-math.pi / 2, math.pi / 2),
    ),
)


@settings(max_examples=examples(70))
@given(st.lists(events_of_any_kind, max_size=40))
def test_whatever_arrives_in_whatever_order_the_heading_is_an_angle_or_unknown(events):
    for answer in fuse(events, Compensator(NOTHING), Fusion()):
        assert math.isnan(answer.fused) or -math.pi <= answer.fused <= math.pi
