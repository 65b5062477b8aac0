"""The newest of each message: which battery, which vehicle, and how its parameters travel."""

from __future__ import annotations

import struct

import pytest
from link_vehicle import UNIX_US, FakeVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.live import latest as latest_module
from magcomp.live.latest import Latest
from magcomp.live.snapshot import slow_streams, warnings
from magcomp.model import Vehicle

VEHICLE = Vehicle("ardupilot", "copter", 1, 1)
BYTEWISE = mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE


def battery(number: int, centiamps: int) -> bytes:
    cells = [0xFFFF] * 10
    return FakeVehicle().pack(
        mavlink.MAVLink_battery_status_message(number, 0, 0, 0, cells, centiamps, 0, 0, 0)
    )


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_current_is_the_first_batterys(order: tuple[int, int]) -> None:
    latest = Latest()
    for number in order:
        latest.add(UNIX_US, battery(number, 1200 if number == 0 else 3400))
    assert latest.now(VEHICLE).current == 12.0


def test_a_second_battery_alone_is_no_current() -> None:
    latest = Latest()
    latest.add(UNIX_US, battery(1, 3400))
    assert latest.now(VEHICLE).current is None


def test_only_a_vehicle_that_says_so_has_no_current_sensor() -> None:
    """A bad link, or a vehicle that answers nothing, brings no battery either."""
    latest = Latest()
    latest.add(UNIX_US, FakeVehicle().attitude())
    assert latest.now(VEHICLE).current_sensor is None
    assert not list(warnings(latest.now(VEHICLE), VEHICLE, {}, 0.0))
    for centiamps in (-1, 1200):
        latest.add(UNIX_US, battery(0, centiamps))
        assert latest.now(VEHICLE).current_sensor is (centiamps > 0)
        told = " ".join(warnings(latest.now(VEHICLE), VEHICLE, {}, 0.0))
        assert ("no current sensor" in told) is (centiamps < 0)


@pytest.mark.parametrize(
    ("autopilot", "capabilities", "value"),
    [("px4", 0, 197_388), ("ardupilot", BYTEWISE, 197_388), ("ardupilot", 0, 0)],
)
def test_parameters_are_read_as_the_vehicle_sends_them(
    autopilot: str, capabilities: int, value: int
) -> None:
    latest = Latest()
    (as_float,) = struct.unpack("<f", struct.pack("<i", 197_388))
    message = mavlink.MAVLink_param_value_message(b"CAL_MAG0_ID", as_float, 6, 1, 0)
    latest.add(UNIX_US, FakeVehicle().pack(message))
    vehicle = Vehicle(autopilot, "copter", 1, 1, capabilities=capabilities)
    assert latest.parameters(vehicle) == {"CAL_MAG0_ID": pytest.approx(value, abs=1e-9)}
    assert latest.parameters(Vehicle(autopilot, "copter", 2, 1)) == {}


def test_a_link_that_brings_less_than_asked_for_is_told_with_what_it_costs():
    asked = {"RAW_IMU": 50.0, "ATTITUDE": 50.0, "SYS_STATUS": 2.0}
    slow = {"RAW_IMU": 8.7, "ATTITUDE": 12.0, "SYS_STATUS": 0.5}
    (told,) = slow_streams(asked, slow, 20.0)
    assert told.startswith("RAW_IMU comes 8.7 times a second, though 50 were asked for")
    assert "record longer" in told
    assert list(slow_streams(asked, slow, 2.0)) == []
    assert list(slow_streams(asked, {**slow, "RAW_IMU": 45.0, "ATTITUDE": 40.0}, 20.0)) == []


def test_the_accelerometer_is_read_in_metres_per_second_squared():
    latest = Latest()
    raw = mavlink.MAVLink_raw_imu_message(0, 100, -200, -1000, 0, 0, 0, 1, 2, 3)
    latest.add(1, bytes(raw.pack(mavlink.MAVLink(None, 1, 1))))
    assert latest.now(VEHICLE).accel == pytest.approx((0.980665, -1.96133, -9.80665))


def test_a_flood_of_names_costs_no_memory_and_forgets_no_value(monkeypatch):
    monkeypatch.setattr(latest_module, "_MOST_PARAMETERS", 5)
    latest, ours = Latest(), FakeVehicle()
    for number in range(9):
        for value in (float(number), number + 0.5):
            told = mavlink.MAVLink_param_value_message(b"P%d" % number, value, 9, 9, number)
            latest.add(UNIX_US, ours.pack(told))
    assert latest.parameters(VEHICLE) == {f"P{n}": n + 0.5 for n in range(5)}


def test_a_flood_of_senders_costs_no_memory_and_forgets_no_vehicle_that_speaks():
    latest, ours = Latest(), FakeVehicle()
    for number in range(300):
        latest.add(UNIX_US + number, ours.heartbeat())
        stranger = FakeVehicle(number % 250 + 2, number % 200 + 2)
        latest.add(UNIX_US + number, stranger.heartbeat())
    assert latest.now(VEHICLE).armed is not None
    assert len(latest._frames) <= 64
