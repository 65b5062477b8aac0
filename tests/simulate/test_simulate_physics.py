"""The simulated world is consistent with itself and with the paper's equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from magcomp import earth, geometry
from magcomp.autopilots import ardupilot
from magcomp.autopilots.ardupilot import Calibration, MotorCompensation
from magcomp.simulate import PROGRAMS, Vehicle, physics, scenario
from magcomp.simulate.motion import euler
from magcomp.simulate.pilot import Pilot

START = 1_750_000_000.0


def blocks(chosen, *, seconds=None, truth=None):
    """The physics of a programme, block by block, the motors obeying it."""
    truth = truth or chosen.truth
    rng = np.random.default_rng(0)
    program = chosen.begin()
    pilot = Pilot(program)
    field = earth.expected_field(*truth.home, START).ned
    state = physics.initial_state(truth, rng)
    for k in range(int((seconds or program.duration_s) / physics.BLOCK_S)):
        motion = pilot.block(physics.STEPS * k, 0.0)
        state, block = physics.advance(state, motion, True, truth, field, rng)
        yield block


def exact(truth, compass):
    """The calibration that the truth file promises."""
    return Calibration(
        offset=truth.compasses[compass].offset,
        soft_iron=truth.compasses[compass].soft_iron,
        scale=1.0,
        motor=-truth.interference,
        compensation=MotorCompensation.CURRENT,
    )


def at_the_readings_centre(block):
    """Attitude in the middle of a reading's window, which is delayed by two steps."""
    before, after = euler(block.motion.earth_from_body[2:4])
    return before + 0.5 * geometry.wrap_angle(after - before)


def quiet(truth):
    return replace(truth, noise=0.0, interference=np.zeros(3), motors=np.zeros((4, 3)))


@pytest.mark.parametrize("program", PROGRAMS)
def test_without_interference_the_field_keeps_the_earths_strength(program):
    chosen = scenario(program, 5)
    strength = earth.expected_field(*chosen.truth.home, START).strength
    for block in blocks(chosen, seconds=120.0, truth=quiet(chosen.truth)):
        np.testing.assert_allclose(np.linalg.norm(block.field, axis=1), strength, rtol=1e-12)


@pytest.mark.parametrize("program", PROGRAMS)
def test_attitudes_are_rotations(program):
    for block in blocks(scenario(program, 5), seconds=60.0):
        poses = block.motion.earth_from_body
        unit = np.broadcast_to(np.eye(3), poses.shape)
        np.testing.assert_allclose(poses @ np.swapaxes(poses, 1, 2), unit, atol=1e-12)


@pytest.mark.parametrize("compass", [0, 1, 2])
def test_the_true_calibration_undoes_a_sensor_exactly(compass):
    truth = scenario("turntable", 7).truth
    field = np.random.default_rng(1).normal(scale=400.0, size=(50, 3))
    raw = truth.compasses[compass].raw(field)
    plain = replace(exact(truth, compass), motor=np.zeros(3))
    np.testing.assert_allclose(ardupilot.correct(raw, 0.0, plain), field, atol=1e-9)


@pytest.mark.parametrize("compass", [0, 1, 2])
def test_the_true_parameters_give_the_true_heading_to_the_noise(compass):
    chosen = scenario("turntable_paper", 4)
    truth = chosen.truth
    field = earth.expected_field(*truth.home, START)
    calibration = exact(truth, compass)
    errors = []
    for block in blocks(chosen):
        roll, pitch, yaw = at_the_readings_centre(block)
        if abs(roll) > 0.02 or abs(pitch) > 0.02 or np.ptp(block.current) > 0.1:
            continue
        corrected = ardupilot.correct(block.raw[compass], block.current.mean(), calibration)
        heading = geometry.heading(corrected, roll, pitch, field.declination)
        errors.append(geometry.wrap_angle(heading - yaw))
    noise = truth.noise / field.horizontal
    assert len(errors) > 500
    assert abs(np.mean(errors)) < 0.2 * noise
    assert np.std(errors) == pytest.approx(noise, rel=0.15)


def test_uncorrected_the_interference_turns_the_heading_by_degrees():
    chosen = scenario("turntable_paper", 4)
    field = earth.expected_field(*chosen.truth.home, START)
    still = replace(exact(chosen.truth, 0), motor=np.zeros(3))
    worst = 0.0
    for block in blocks(chosen):
        roll, pitch, yaw = at_the_readings_centre(block)
        if abs(roll) < 0.02 and abs(pitch) < 0.02:
            corrected = ardupilot.correct(block.raw[0], 0.0, still)
            error = geometry.heading(corrected, roll, pitch, field.declination) - yaw
            worst = max(worst, abs(float(geometry.wrap_angle(error))))
    assert np.degrees(worst) > 5.0


def test_equal_motors_disturb_in_proportion_to_the_current():
    truth = scenario("turntable", 3).truth
    np.testing.assert_allclose(truth.motors.mean(axis=0), truth.interference, atol=1e-12)
    chosen = scenario("turntable", 3)
    for with_motors, without in zip(
        blocks(chosen, seconds=150.0),
        blocks(chosen, seconds=150.0, truth=quiet(truth)),
        strict=True,
    ):
        expected = np.multiply.outer(with_motors.current, truth.interference)
        np.testing.assert_allclose(with_motors.field - without.field, expected, atol=1e-9)


def test_in_flight_the_interference_is_nearly_but_not_exactly_proportional():
    chosen = scenario("flight", 3)
    off, size = [], []
    for with_motors, without in zip(
        blocks(chosen, seconds=120.0),
        blocks(chosen, seconds=120.0, truth=quiet(chosen.truth)),
        strict=True,
    ):
        share = np.multiply.outer(with_motors.current, chosen.truth.interference)
        off.append(with_motors.field - without.field - share)
        size.append(share)
    assert 0.05 < np.std(off) < 0.02 * np.linalg.norm(size, axis=-1).max()


def test_the_papers_control_quantities_draw_the_papers_currents():
    drawn = {0.0: [], 0.2: [], 0.3: []}
    for block in blocks(scenario("turntable_paper", 1)):
        if np.ptp(block.motion.throttle) == 0.0 and np.ptp(block.current) < 0.01:
            drawn[round(float(block.motion.throttle[0]), 3)].append(block.current.mean())
    means = [np.median(currents) for currents in drawn.values()]
    np.testing.assert_allclose(means, [0.0, 32.0, 53.0], atol=0.01)


def test_current_grows_faster_than_throttle_and_the_battery_sags():
    rows = [
        (b.motion.throttle[-1], b.current[-1], b.sensed_v)
        for b in blocks(scenario("sweep", 1))
        if np.ptp(b.motion.throttle) == 0.0 and b.motion.throttle[-1] > 0.05
    ]
    throttle, current, voltage = np.array(rows).T
    low, high = current[throttle < 0.15], current[throttle > 0.55]
    assert np.median(high) / np.median(low) > 8.0
    drop = np.median(voltage[throttle < 0.15]) - np.median(voltage[throttle > 0.55])
    assert 0.5 < drop < 2.0


def test_charge_is_the_integral_of_the_current():
    used, total = 0.0, 0.0
    for block in blocks(scenario("sweep", 1)):
        total += block.current.sum() * physics.STEP_S / 3600.0
        used = block.used_ah
    assert used == pytest.approx(total)


def test_the_current_sensor_lags_the_current():
    pairs = [(b.current[-1], b.sensed_a) for b in blocks(scenario("sweep", 1))]
    current, sensed = np.array(pairs).T
    rising = np.gradient(current) > 0.3
    assert np.mean((current - sensed)[rising]) > 0.1
    steady = np.abs(np.gradient(current)) < 1e-3
    assert abs(np.mean((current - sensed)[steady])) < 0.1


def test_body_rates_are_those_of_the_turn():
    rates = np.concatenate([b.rates for b in blocks(scenario("turntable_paper", 1), seconds=25.0)])
    # One turn about z in 18 s, its ends softened.
    assert rates[:, 2].sum() * physics.STEP_S == pytest.approx(2 * np.pi * 14 / 18, rel=0.1)
    assert rates[:, 2].max() == pytest.approx(2 * np.pi / 18 / 0.9, rel=1e-3)


@pytest.fixture(scope="module", params=["off", "exact"])
def mission(request):
    """Compensation, worst heading error in degrees, and how far a square was missed in metres."""
    vehicle = Vehicle(scenario("mission", 3, compensation=request.param))
    error, missed = 0.0, 0.0
    for tenth in range(220, 900):
        vehicle.advance(tenth / 10.0)
        error = max(error, abs(vehicle.heading_error))
        north, east, _ = vehicle.true_position
        inside = min(abs(north), abs(north - 70), abs(east), abs(east - 70))
        outside = max(-north, north - 70, -east, east - 70)
        missed = max(missed, outside if outside > 0 else inside)
    return request.param, np.degrees(error), missed


def test_a_mission_shows_the_papers_heading_error_with_and_without_the_cure(mission):
    compensation, error, _ = mission
    assert error > 10.0 if compensation == "off" else error < 1.5


def test_a_wrong_heading_bends_the_path_of_a_mission(mission):
    compensation, _, missed = mission
    assert missed > 4.5 if compensation == "off" else missed < 3.5
