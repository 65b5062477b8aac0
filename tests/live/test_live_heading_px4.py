"""The heading of a flying PX4, whose messages carry the sensors' own fields: against the truth."""

from __future__ import annotations

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp import autopilots
from magcomp.errors import MissingDataError
from magcomp.geometry import wrap_angle
from magcomp.live.heading import Sensors, live_headings
from magcomp.model import Vehicle as Identity
from magcomp.simulate import Vehicle, scenario
from magcomp.simulate.ground import PX4_RATES, Asker

PX4 = Identity("px4", "copter", 1, 1)
SECONDS = 40.0


@pytest.fixture(scope="module")
def flown():
    """A flight with a wrong compensation in force: frames, true yaw, what would be right."""
    plain = scenario("flight", 4, compensation="wrong")
    vehicle = Vehicle(plain, autopilot="px4")
    held = dict(vehicle.parameters)
    codec, yaw, frames = mavlink.MAVLink(None), [], []
    ground = Asker()
    for number in PX4_RATES:
        vehicle.receive(ground.rate(number, 25.0), 0.0)
    for tick in range(1, int(SECONDS / 0.04) + 1):
        for frame in vehicle.advance(0.04 * tick):
            frames.append(frame.data)
            message = codec.decode(bytearray(frame.data))
            if message.get_type() == "ATTITUDE":
                yaw.append((message.time_boot_ms * 1e-3, message.yaw - vehicle.heading_error))
    cured = Vehicle(scenario("flight", 4, compensation="exact"), autopilot="px4").parameters
    return frames, np.array(yaw), held, cured, vehicle.truth


def headings(flown, compass, cure):
    frames, yaw, held, cured, _ = flown
    sensors = Sensors(compass, PX4, held)
    for frame in frames:
        sensors.add(0, frame)
    autopilot = autopilots.of(PX4)
    present = autopilot.in_force(held, compass)
    wanted = autopilot.in_force(cured if cure else held, compass)
    declination = 0.0
    made = list(live_headings(sensors, wanted, present, declination, lambda: sensors.empty))
    time = np.array([each.time for each in made])
    true = np.interp(time, yaw[:, 0], np.unwrap(yaw[:, 1]))
    late = time > 10.0
    found = {
        name: np.array([getattr(each, name) for each in made])[late]
        for name in ("raw", "corrected", "fused")
    }
    # The declination is constant: what is left varies by what the motors do.
    off = {name: wrap_angle(value - true[late]) for name, value in found.items()}
    return {
        name: float(np.degrees(np.std(wrap_angle(value - np.median(value)))))
        for name, value in off.items()
    }


@pytest.mark.parametrize("compass", [1, 3])
def test_corrected_by_the_right_numbers_it_is_the_true_one(flown, compass):
    """Compass 3 is mounted upside down and turned."""
    spread = headings(flown, compass, cure=True)
    assert spread["fused"] < 1.5
    assert spread["corrected"] < spread["raw"] / 3


def test_what_the_autopilot_makes_of_it_is_shown_as_raw(flown):
    spread = headings(flown, 1, cure=False)
    assert spread["raw"] == pytest.approx(spread["corrected"], abs=1e-9)
    assert spread["raw"] > 3.0


def test_a_compass_that_is_not_there_is_a_sentence(flown):
    with pytest.raises(MissingDataError, match="must have a compass 4; instead it sends 1, 2, 3"):
        Sensors(4, PX4, flown[2])
