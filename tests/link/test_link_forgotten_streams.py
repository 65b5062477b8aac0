"""A vehicle that has rebooted unnoticed sends no streams: it is asked for them anew."""

from __future__ import annotations

from link_vehicle import FakeVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.link.state import FORGOTTEN_S, LinkState

_STEP_S = 0.05
_SET = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL


def live(state, vehicle, begin, seconds, says):
    """Let link and vehicle talk; ``says`` gives what the vehicle says by itself at a time."""
    now = begin
    while now < begin + seconds:
        now += _STEP_S
        state.receive(says(now), now)
        for message in state.due(now):
            state.receive(vehicle.hear(state.pack(message, 0)), now)
    return now


def asked(vehicle):
    return sum(
        message.get_type() == "COMMAND_LONG" and message.command == _SET
        for message in vehicle.heard
    )


def test_streams_that_came_and_stopped_are_asked_for_anew():
    state, vehicle = LinkState(system=1), FakeVehicle()
    now = live(state, vehicle, 0.0, 2.0, vehicle.tick)
    state.request_streams({"ATTITUDE": 50.0}, now)
    now = live(state, vehicle, now, 2.0, vehicle.tick)
    assert asked(vehicle) == 1
    now = live(state, vehicle, now, FORGOTTEN_S + 1.0, lambda _: vehicle.heartbeat())
    assert asked(vehicle) == 2


def test_as_long_as_any_of_them_comes_nothing_is_asked():
    state, vehicle = LinkState(system=1), FakeVehicle()
    now = live(state, vehicle, 0.0, 2.0, vehicle.tick)
    state.request_streams({"ATTITUDE": 50.0, "SCALED_IMU3": 50.0}, now)
    live(state, vehicle, now, 4 * FORGOTTEN_S, vehicle.tick)
    assert asked(vehicle) == 2


def test_after_the_old_rates_are_given_back_nothing_is_asked():
    state, vehicle = LinkState(system=1), FakeVehicle()
    now = live(state, vehicle, 0.0, 2.0, vehicle.tick)
    state.request_streams({"ATTITUDE": 50.0}, now)
    now = live(state, vehicle, now, 2.0, vehicle.tick)
    state.restore_streams()
    live(state, vehicle, now, 3 * FORGOTTEN_S, lambda _: vehicle.heartbeat())
    assert asked(vehicle) == 2
