"""The simulated vehicle's number, manners and company, and what a reboot brings back."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.mavlink.version import unique_id
from magcomp.simulate import CAMERA, COMPUTER, GIMBAL, Faults, FaultyLink, Habits, Vehicle, scenario
from magcomp.simulate.ground import Asker


class Ground:
    """Sends to a machine and keeps what comes back."""

    def __init__(self, machine, system=255):
        self._machine, self._now = machine, 1.0
        self._codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=190)
        self._parser = mavlink.MAVLink(None)
        self.wait(0.0)

    def send(self, message):
        self._machine.receive(bytes(message.pack(self._codec)), self._now)
        self._codec.seq = (self._codec.seq + 1) % 256

    def wait(self, seconds):
        self._now += seconds
        frames = self._machine.advance(self._now)
        return [self._parser.decode(bytearray(frame.data)) for frame in frames]

    def set(self, name, value):
        self.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, 9))
        return [m for m in self.wait(0.1) if m.get_type() == "PARAM_VALUE" and m.param_id == name]


def vehicle(**habits):
    return Vehicle(scenario("parked", 1), habits=Habits(**habits))


def number_of(vehicle):
    ground = Ground(vehicle)
    ground.send(mavlink.MAVLink_command_long_message(1, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0))
    (said,) = [m for m in ground.wait(0.1) if m.get_type() == "AUTOPILOT_VERSION"]
    return unique_id(bytes(said.uid2), said.uid)


def test_twins_differ_in_nothing_but_their_number():
    one, same, other = (number_of(Vehicle(scenario("parked", seed))) for seed in (1, 1, 2))
    assert one == same != other
    assert number_of(vehicle(uid=b"\x0a\x0b")) == "0a0b"
    assert number_of(vehicle(uid=b"")) == ""


def test_everybody_in_the_system_sends_heartbeats():
    heard = {
        (m.get_srcComponent(), m.type, m.autopilot)
        for m in Ground(vehicle(companions=(GIMBAL, CAMERA, COMPUTER))).wait(2.0)
        if m.get_type() == "HEARTBEAT"
    }
    assert heard == {(1, 2, 3), (154, 26, 3), (100, 30, 8), (191, 2, 3)}


def test_a_value_is_clamped_without_a_word():
    ground = Ground(vehicle(clamped={"COMPASS_OFS_X": (-50.0, 50.0)}))
    (echo,) = ground.set("COMPASS_OFS_X", 80.0)
    assert echo.param_value == 50.0


def test_a_name_takes_no_write_and_says_nothing():
    flying = vehicle(ignored=frozenset({"COMPASS_OFS_X"}))
    before = flying.parameters["COMPASS_OFS_X"]
    assert Ground(flying).set("COMPASS_OFS_X", before + 1.0) == []
    assert flying.parameters["COMPASS_OFS_X"] == before


def test_a_name_is_denied_in_words():
    flying = vehicle(denied=frozenset({"COMPASS_OFS_X"}))
    ground = Ground(flying)
    before = flying.parameters["COMPASS_OFS_X"]
    (echo,) = ground.set("COMPASS_OFS_X", before + 1.0)
    assert echo.param_value == pytest.approx(before)


def test_a_name_is_reported_as_nan():
    (echo,) = Ground(vehicle(not_numbers=frozenset({"COMPASS_OFS_X"}))).set("COMPASS_OFS_X", 1.0)
    assert math.isnan(echo.param_value)


@pytest.mark.parametrize(("storage_s", "kept"), [(0.0, True), (1e9, False)])
def test_a_reboot_brings_back_what_was_stored(storage_s, kept):
    flying = vehicle(storage_s=storage_s)
    before = flying.parameters["COMPASS_OFS_X"]
    Ground(flying).set("COMPASS_OFS_X", before + 1.0)
    assert flying.parameters["COMPASS_OFS_X"] == pytest.approx(before + 1.0)
    flying.reboot()
    assert flying.parameters["COMPASS_OFS_X"] == pytest.approx(before + (1.0 if kept else 0.0))


def test_the_newest_writes_are_stored_in_any_order():
    flying = vehicle(storage_s=2.0)
    ground = Ground(flying)
    names = [f"COMPASS_{kind}_{axis}" for kind in ("OFS", "MOT", "ODI") for axis in "XYZ"]
    before = [flying.parameters[name] for name in names]
    for name, value in zip(names, before, strict=True):
        ground.set(name, value + 1.0)
    flying.reboot()
    kept = [flying.parameters[n] != b for n, b in zip(names, before, strict=True)]
    assert any(kept)
    assert not all(kept)


@pytest.mark.parametrize(("enforced", "system", "heard"), [(1, 255, 1), (1, 254, 0), (0, 254, 1)])
def test_sysid_enforce_listens_to_one_ground_station_only(enforced, system, heard):
    flying = Vehicle(scenario("parked", 1), parameters={"SYSID_ENFORCE": enforced})
    assert len(Ground(flying, system).set("COMPASS_OFS_X", 1.0)) == heard


def test_a_stranger_confirms_what_the_vehicle_never_got():
    link = FaultyLink(vehicle(), Faults(loss=1.0, stranger=(1, 2)))
    link.receive(Asker().heartbeat(), 1.0)
    (echo,) = Ground(link).set("COMPASS_OFS_X", 7.0)
    assert (echo.get_srcSystem(), echo.get_srcComponent(), echo.param_value) == (1, 2, 7.0)


def test_somebody_arms_at_the_chosen_message():
    flying = vehicle()
    ground = Ground(FaultyLink(flying, Faults(arm_at=3)))
    ground.set("COMPASS_OFS_X", 1.0)
    assert flying.armed
