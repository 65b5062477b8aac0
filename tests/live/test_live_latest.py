"""The newest of each message: which battery, which vehicle, and how its parameters travel."""

from __future__ import annotations

import struct

import pytest
from link_vehicle import UNIX_US, FakeVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.live.latest import Latest
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
