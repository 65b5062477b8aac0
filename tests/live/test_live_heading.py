"""What a live heading is made of: which control quantity a reading carries, and which compass."""

from __future__ import annotations

import pytest
from link_vehicle import DEVICE_IDS, FakeVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.compensate import Reading
from magcomp.live.heading import Sensors
from magcomp.model import CURRENT, THROTTLE, Vehicle

VEHICLE = Vehicle("ardupilot", "copter", 1, 1)


def battery(number: int, centiamps: int) -> mavlink.MAVLink_message:
    cells = [0xFFFF] * 10
    return mavlink.MAVLink_battery_status_message(number, 0, 0, 0, cells, centiamps, 0, 0, 0)


def throttle(percent: int) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_vfr_hud_message(0, 0, 0, percent, 0, 0)


def field(ms: int) -> mavlink.MAVLink_message:
    """A reading of the first compass that differs from every other."""
    return mavlink.MAVLink_raw_imu_message(1000 * ms, 0, 0, -1000, 0, 0, 0, ms, 2, 3)


def readings(regressor: str, *messages: mavlink.MAVLink_message) -> list[Reading]:
    sender, sensors = FakeVehicle(), Sensors(1, VEHICLE, DEVICE_IDS)
    sent = [mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0), *messages]
    for message in sent:
        sensors.add(0, sender.pack(message))
    left = iter(range(len(sent)))
    events = sensors.events(regressor, lambda: next(left, None) is None)
    return [event for event in events if isinstance(event, Reading)]


@pytest.mark.parametrize(
    ("regressor", "u"), [(CURRENT, (12.0, 12.0, 14.0)), (THROTTLE, (0.4, 0.5, 0.5))]
)
def test_a_reading_carries_the_newest_of_the_quantity_that_is_asked_for(regressor, u):
    found = readings(
        regressor,
        *(battery(0, 1200), throttle(40), field(10)),
        *(throttle(50), field(20)),
        *(battery(0, 1400), field(30)),
    )
    assert [reading.u for reading in found] == pytest.approx(u)


def test_a_second_battery_and_a_missing_sensor_change_nothing():
    found = readings(CURRENT, battery(0, 1200), battery(1, 9900), battery(0, -1), field(10))
    assert [reading.u for reading in found] == [12.0]


def test_a_reading_that_repeats_is_none():
    found = readings(THROTTLE, throttle(40), field(10), field(10), field(20))
    assert len(found) == 2
