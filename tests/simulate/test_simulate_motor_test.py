"""The simulated vehicle's motor test: docs/autopilots.md, ArduPilot: motor test."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.simulate import Vehicle, scenario
from magcomp.simulate.ground import DEFAULT_RATES
from magcomp.simulate.outputs import motor_outputs, motor_thrust

TEST = mavlink.MAV_CMD_DO_MOTOR_TEST
ACCEPTED, FAILED = 0, 4
PER_CENT, PWM = 0, 1


def ack(messages):
    [found] = [m for m in messages if m.get_type() == "COMMAND_ACK"]
    return found.result


def texts(messages):
    return [m.text for m in messages if m.get_type() == "STATUSTEXT"]


def order(place, per_cent, timeout_s, count=0):
    values = (place, PER_CENT, per_cent, timeout_s, count, 0, 0)
    return mavlink.MAVLink_command_long_message(1, 1, TEST, 0, *values)


def spun_s(ground, seconds):
    """How long each motor is driven in the coming seconds, to 10 ms."""
    spun = dict.fromkeys((1, 2, 3, 4), 0)
    for _ in range(round(seconds * 100)):
        ground.wait(0.01)
        for motor in ground.machine.spinning:
            spun[motor] += 1
    return {motor: ticks / 100 for motor, ticks in spun.items() if ticks}


@pytest.fixture
def parked(on_ground):
    return on_ground("parked", 3)


def test_a_motor_spins_for_its_time_out_and_no_longer(parked):
    parked.say(order(1, 30, 1.5))
    assert spun_s(parked, 3.0) == {1: pytest.approx(1.5, abs=0.011)}


def test_the_places_go_clockwise_from_the_front_right(parked):
    for place, motor in ((1, 1), (2, 4), (3, 2), (4, 3)):
        parked.say(order(place, 30, 0.1))
        assert list(spun_s(parked, 0.3)) == [motor]


def test_a_command_begins_the_time_anew_and_leaves_the_other_motors_spinning(parked):
    parked.say(order(1, 30, 1.0))
    parked.wait(0.8)
    parked.say(order(2, 30, 1.0))
    assert spun_s(parked, 3.0) == {
        1: pytest.approx(1.0, abs=0.011),
        4: pytest.approx(1.0, abs=0.011),
    }


def test_a_time_out_of_0_stops_all(parked):
    for place in (1, 2, 3, 4):
        parked.say(order(place, 30, 5.0))
        parked.wait(0.02)
    assert len(parked.machine.spinning) == 4
    parked.say(order(1, 0, 0.0))
    parked.wait(0.02)
    assert parked.machine.spinning == ()


def test_of_commands_that_come_together_the_last_counts(parked):
    for place in (1, 2):
        parked.say(order(place, 30, 5.0))
    parked.wait(0.5)
    assert parked.machine.spinning == (4,)


def test_a_count_goes_through_the_motors_with_pauses(parked):
    parked.say(order(1, 30, 1.0, count=2))
    assert spun_s(parked, 4.0) == {
        1: pytest.approx(1.0, abs=0.021),
        4: pytest.approx(1.0, abs=0.021),
    }


def test_it_says_armed_while_it_runs_and_disarmed_afterwards(parked):
    heard = parked.command(TEST, 1, PER_CENT, 30, 1.5)
    assert ack(heard) == ACCEPTED
    assert "starting motor test" in texts(heard)
    later = parked.wait(3.0)
    armed = [bool(m.base_mode & 128) for m in later if m.get_type() == "HEARTBEAT"]
    assert armed[0]
    assert not armed[-1]
    assert "finished motor test" in texts(later)


def test_it_is_refused_in_the_air(on_ground):
    ground = on_ground("flight", 3)
    ground.wait(60.0)
    heard = ground.command(TEST, 1, PER_CENT, 30, 1.5)
    assert ack(heard) == FAILED
    assert "Motor Test: vehicle not landed" in texts(heard)
    assert ground.machine.spinning == ()
    assert ground.machine.armed


def test_disarming_ends_it(parked):
    parked.say(order(1, 30, 5.0))
    parked.wait(0.5)
    parked.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    assert parked.machine.spinning == ()


def test_nobody_arms_during_it(parked):
    parked.say(order(1, 30, 1.0))
    parked.wait(0.5)
    parked.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    parked.wait(2.0)
    assert not parked.machine.armed


@pytest.mark.parametrize(("kind", "value"), [(PER_CENT, 150), (PWM, 500), (9, 30)])
def test_a_throttle_that_is_none_ends_it(parked, kind, value):
    parked.command(TEST, 1, kind, value, 5.0)
    assert parked.machine.spinning == ()


def test_current_outputs_and_compass_follow(parked):
    for message, hertz in DEFAULT_RATES.items():
        parked.machine.receive(parked.asker.rate(message, hertz), parked.time)
    rest = parked.wait(2.0)
    parked.say(order(1, 50, 3.0))
    parked.wait(1.0)
    spinning = parked.wait(1.5)

    def mean(messages, kind, *names):
        found = [m for m in messages if m.get_type() == kind]
        return np.mean([[getattr(m, name) for name in names] for m in found], axis=0)

    def amperes(messages):
        return mean(messages, "BATTERY_STATUS", "current_battery")[0] / 100

    assert mean(spinning, "SERVO_OUTPUT_RAW", "servo1_raw", "servo2_raw").tolist() == [1500, 1000]
    risen = amperes(spinning) - amperes(rest)
    assert risen > 3.0
    moved = [mean(m, "RAW_IMU", "xmag", "ymag", "zmag") for m in (rest, spinning)]
    truth = parked.machine.truth
    assert moved[1] - moved[0] == pytest.approx(truth.motors[0] * risen, abs=2.0)


CURVE = {**Vehicle(scenario("parked", 1)).parameters, "MOT_BAT_VOLT_MAX": 0.0}


@given(st.floats(0.0, 0.9))
def test_thrust_undoes_the_outputs(thrust):
    demand = np.full(4, thrust)
    outputs = motor_outputs(demand, armed=True, voltage=24.0, altitude_m=100.0, parameters=CURVE)
    again = motor_thrust(outputs, altitude_m=100.0, parameters=CURVE)
    assert again == pytest.approx(thrust, abs=1e-9)
