"""A sweep of the simulated PX4, whose actuator tests look disarmed and end each on their own."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sweep_bench import LIMITS, MID_STEP_S, Befallen, Bench, Once

from magcomp.simulate.px4.actuator_test import ActuatorTest
from magcomp.sweeping.events import Begun, Reason

RATES = {"ATTITUDE": 10.0, "BATTERY_STATUS": 5.0}


def bench(*arguments, **options):
    return Bench(*arguments, autopilot="px4", rates=RATES, **options)


def test_each_motor_spins_for_its_time_and_all_together():
    swept = bench()
    outcome = swept.sweep(lambda b: Reason.KEY if b.now > 26.0 else None)
    assert len(outcome.done) >= 5
    begun = [event.step.motors for _, event in swept.events if isinstance(event, Begun)]
    assert begun[:5] == [(1,), (2,), (3,), (4,), (1, 2, 3, 4)]
    assert max(len(motors) for _, motors in swept.cable.spun) == 4
    assert swept.cable.longest_s <= LIMITS.hold_s + 0.05
    assert outcome.done[4].current > 2.5 * outcome.done[0].current


def test_a_smoothed_current_of_the_step_before_does_not_count_as_rest():
    swept = bench()
    outcome = swept.sweep(lambda b: Reason.KEY if b.now > 31.0 else None)
    gentle, strong = outcome.done[0], outcome.done[5]
    assert (gentle.step.motors, strong.step.motors) == ((1,), (1,))
    assert strong.current > 1.5 * gentle.current


def test_a_key_stops_at_once():
    swept, press = bench(), Once(lambda _: Reason.KEY)
    assert swept.sweep(press).reason is Reason.KEY
    swept.hear(3.0)
    assert swept.cable.last_spun_s - press.at < 0.05


def test_a_pulled_cable_stops_by_the_time_out():
    def pull(b):
        b.cable.heard = b.cable.spoken = False

    swept, pulled = bench(), Once(pull)
    assert swept.sweep(pulled).reason is Reason.LINK_LOST
    swept.hear(3.0)
    assert swept.cable.last_spun_s - pulled.at <= LIMITS.timeout_s + 0.03


def test_a_tilt_stops_at_once():
    swept = bench(Befallen(MID_STEP_S, tilt_rad=math.radians(8.0)))
    assert swept.sweep().reason is Reason.TILTED
    assert swept.cable.last_spun_s - MID_STEP_S < 0.25


def test_arming_in_a_step_stops_at_once():
    # The firmware itself gives the motors back; from then on nothing is asked for.
    def arm(b):
        b.vehicle.arm()

    swept, armed = bench(), Once(arm)
    assert swept.sweep(armed).reason in (Reason.ARMED, Reason.REFUSED)
    swept.hear(3.0)
    assert swept.cable.last_spun_s - armed.at < 0.05
    assert swept.vehicle.armed


@given(
    st.lists(
        st.tuples(
            st.integers(1, 4),
            st.one_of(st.just(math.nan), st.floats(-1.0, 1.0)),
            st.floats(0.0, 10.0),
            st.floats(0.0, 4.0),
        ),
        max_size=20,
    )
)
def test_no_motor_outlasts_three_seconds_without_a_command(commands):
    test, now = ActuatorTest(), 0.0
    for motor, value, seconds, wait in commands:
        assert test.command(motor, value, seconds, now)
        now += wait
        test.advance(now)
        if wait >= min(seconds, 3.0) and seconds > 0.0:
            assert not test.running


@pytest.mark.parametrize(("motor", "value"), [(0, 0.5), (5, 0.5), (1, 2.0)])
def test_what_is_no_motor_is_refused(motor, value):
    assert not ActuatorTest().command(motor, value, 1.0, 0.0)
