"""PX4 on a link: another message for the first compass, and the sensors' own fields in it."""

from __future__ import annotations

import math

import pytest
from link_vehicle import UNIX_US, FakeVehicle, play
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.link.state import LinkState
from magcomp.link.streams import DEFAULT_RATES, as_sent_by
from magcomp.live.latest import Latest
from magcomp.live.refit import Refit
from magcomp.live.snapshot import compasses_now
from magcomp.model import Vehicle

PX4 = Vehicle("px4", "copter", 1, 1)
ARDUPILOT = Vehicle("ardupilot", "copter", 1, 1)
PARAMETERS = {
    "CAL_MAG_COMP_TYP": 2.0,
    "CAL_MAG0_ID": 197388.0,
    "CAL_MAG0_ROT": 2.0,
    "CAL_MAG0_XOFF": 0.1,
    **{f"CAL_MAG0_{axis}SCALE": 1.0 for axis in "XYZ"},
}


def heard(*messages):
    latest, vehicle = Latest(), FakeVehicle(autopilot=12)
    for message in messages:
        latest.add(UNIX_US, vehicle.pack(message))
    return latest


def test_px4_is_asked_for_the_message_that_it_has():
    state, vehicle = LinkState(system=1, unix_us=UNIX_US), FakeVehicle(autopilot=12)
    play(state, [vehicle], 0.0, 5.0)
    assert state.vehicle.autopilot == "px4"
    state.request_streams(as_sent_by(state.vehicle, DEFAULT_RATES), 5.0)
    play(state, [vehicle], 5.0, 10.0)
    assert {26, 116, 129, 30} <= set(vehicle.interval_us)
    assert 27 not in vehicle.interval_us
    assert set(as_sent_by(ARDUPILOT, DEFAULT_RATES)) == set(DEFAULT_RATES)


def test_the_sensors_own_field_is_turned_and_corrected_before_a_heading_is_made_of_it():
    """Yawed by 90° in its case, with an offset of 100 mGauss along the sensor's x."""
    imu = mavlink.MAVLink_scaled_imu_message(5, 0, 0, -1000, 0, 0, 0, 100, -200, 400)
    latest = heard(imu, mavlink.MAVLink_attitude_message(5, 0.0, 0.0, 0.0, 0, 0, 0))
    now = latest.now(PX4)
    assert now.fields == {1: (100.0, -200.0, 400.0)}
    assert now.accel == pytest.approx((0.0, 0.0, -9.80665))
    (shown,) = compasses_now(now, PX4, PARAMETERS, Refit())
    assert shown.field == pytest.approx((200.0, 0.0, 400.0))
    assert shown.strength == pytest.approx(math.hypot(200.0, 400.0))
    assert shown.heading_deg == pytest.approx(0.0, abs=1e-6)


def test_before_its_parameters_came_no_compass_is_shown():
    imu = mavlink.MAVLink_scaled_imu_message(5, 0, 0, -1000, 0, 0, 0, 100, -200, 400)
    assert compasses_now(heard(imu).now(PX4), PX4, {}, Refit()) == ()
