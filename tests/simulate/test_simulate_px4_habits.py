"""The simulated PX4's parameters and commands, and which calibration is in force: one test a rule.

The rules: docs/autopilots.md, PX4: in force, PX4: parameters, PX4: commands and PX4: learning.
"""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.mavlink.header import payload
from magcomp.mavlink.parameters import (
    Encoding,
    as_float,
    decode_param_value,
    encode_value,
)
from magcomp.simulate import Habits, Vehicle, scenario
from magcomp.simulate.px4.sensors import DEVICE_IDS, exact

SWITCH = "CAL_MAG_COMP_TYP"
HOW = Encoding.BYTEWISE


class Px4:
    """A simulated PX4 and somebody who speaks with it."""

    def __init__(self, program="parked", **options):
        self.vehicle = Vehicle(scenario(program, 1), autopilot="px4", **options)
        self.codec = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self.parser = mavlink.MAVLink(None)
        self.now = 0.0
        self.wait(1.0)

    def wait(self, seconds):
        self.now += seconds
        frames = self.vehicle.advance(self.now)
        return [self.parser.decode(bytearray(frame.data)) for frame in frames]

    def say(self, message, seconds=0.05):
        self.vehicle.receive(bytes(message.pack(self.codec)), self.now)
        return self.wait(seconds)

    def set(self, name, value, kind=9, seconds=0.005):
        field = as_float(encode_value(value, kind, HOW))
        message = mavlink.MAVLink_param_set_message(1, 1, name.encode(), field, kind)
        return values(self.say(message, seconds))

    def read(self, name):
        return values(
            self.say(mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1), 0.005)
        )

    def command(self, number, *given):
        padded = (*given, *[0.0] * (7 - len(given)))
        heard = self.say(mavlink.MAVLink_command_long_message(1, 1, number, 0, *padded))
        return [m.result for m in heard if m.get_type() == "COMMAND_ACK"]

    @property
    def compasses(self):
        return self.vehicle.firmware.compasses

    def force(self, index=0):
        return self.compasses.in_force(DEVICE_IDS[index])


def values(heard):
    return [
        decode_param_value(payload(bytes(m.get_msgbuf())), HOW)
        for m in heard
        if m.get_type() == "PARAM_VALUE"
    ]


@pytest.fixture
def px4():
    return Px4()


def test_a_set_is_answered_once_with_its_true_index(px4):
    (answer,) = px4.set("CAL_MAG0_XCOMP", -1.5)
    assert (answer.name, answer.value, answer.type) == ("CAL_MAG0_XCOMP", -1.5, 9)
    assert answer.index == px4.read("CAL_MAG0_XCOMP")[0].index < 865


def test_integers_travel_as_their_own_bytes(px4):
    assert px4.read("CAL_MAG0_ROT")[0].value == -1.0
    assert px4.read("CAL_MAG0_ID")[0].value == DEVICE_IDS[0]
    px4.set(SWITCH, 2, 6)
    assert px4.vehicle.parameters[SWITCH] == 2.0


def test_a_number_cast_to_float_is_stored_as_what_its_bytes_are(px4):
    px4.say(mavlink.MAVLink_param_set_message(1, 1, SWITCH.encode(), 3.0, 6))
    assert px4.vehicle.parameters[SWITCH] == struct.unpack("<i", struct.pack("<f", 3.0))[0]


def test_unknown_names_and_wrong_types_get_silence(px4):
    assert px4.set("COMPASS_OFS_X", 1.0) == px4.read("COMPASS_OFS_X") == []
    assert px4.set(SWITCH, 1.0, 9) == px4.set("CAL_MAG0_XOFF", 1, 6) == []
    assert px4.vehicle.parameters[SWITCH] == 0.0


def test_newer_firmware_says_that_a_name_does_not_exist():
    px4 = Px4(answers_errors=True)
    field = mavlink.MAVLink_param_set_message(1, 1, b"NOT_THERE", 1.0, 9)
    (said,) = [m for m in px4.say(field) if m.get_type() == "PARAM_ERROR"]
    assert (said.param_id, said.error) == ("NOT_THERE", mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)


def test_a_free_slots_parameters_are_known_but_in_no_list(px4):
    (answer,) = px4.set("CAL_MAG3_XCOMP", 0.25)
    assert (answer.value, answer.index) == (0.25, 65535)
    (single,) = px4.read("CAL_MAG3_ID")
    assert single.index < 865


def test_every_change_is_told_again_while_it_is_not_saved(px4):
    px4.set("CAL_MAG0_XCOMP", -1.5, seconds=0.0)
    px4.set("CAL_MAG0_YCOMP", 0.5, seconds=0.0)
    again = values(px4.wait(0.1))
    assert {each.name for each in again} == {"CAL_MAG0_XCOMP", "CAL_MAG0_YCOMP"}
    px4.wait(2.5)
    px4.set("CAL_MAG0_ZCOMP", 0.75, seconds=0.0)
    assert {each.name for each in values(px4.wait(0.1))} == {"CAL_MAG0_ZCOMP"}


def test_the_list_begins_with_the_hash_and_again_without_it(px4):
    ask = mavlink.MAVLink_param_request_list_message(1, 1)
    assert values(px4.say(ask, 0.02))[0].name == "_HASH_CHECK"
    assert px4.set("_HASH_CHECK", 1.0) == []
    assert values(px4.wait(0.2)) == []
    px4.say(ask, 0.02)
    begun_again = values(px4.say(ask, 3.0))
    assert begun_again[0].index == 0
    assert [each.index for each in begun_again] == list(range(865 - 1 + 1))


def test_the_compasses_calibration_is_no_part_of_the_hash(px4):
    def told():
        return px4.read("_HASH_CHECK")[0].value

    before = told()
    px4.set("CAL_MAG0_XCOMP", 1.0)
    px4.wait(0.5)
    assert told() == before
    px4.set("CAL_MAG0_PRIO", 60, 6)
    px4.wait(0.5)
    assert told() != before


def test_nan_is_taken_and_what_follows_it_is_held_but_not_noticed(px4):
    px4.set(SWITCH, 2, 6)
    px4.set("CAL_MAG0_XCOMP", 100.0)
    px4.wait(2.0)
    assert px4.force().motor[0] == 100.0
    (echo,) = px4.set("CAL_MAG0_XCOMP", math.nan)
    assert math.isnan(echo.value)
    (echo,) = px4.set("CAL_MAG0_XCOMP", 0.0)
    assert echo.value == 0.0
    px4.wait(5.0)
    assert px4.force().motor[0] == 100.0
    px4.set("CAL_MAG1_XCOMP", 1.0)
    px4.wait(2.0)
    assert px4.force().motor[0] == 0.0


@pytest.mark.parametrize(
    ("kind", "short", "far"), [("OFF", 0.0049, 0.0052), ("SCALE", 0.0098, 0.0102)]
)
def test_small_changes_are_held_but_not_in_force(px4, kind, short, far):
    attribute = {"OFF": "offset", "SCALE": "scale"}[kind]
    name = f"CAL_MAG0_X{kind}"
    before, stored = getattr(px4.force(), attribute)[0], px4.vehicle.parameters[name]
    px4.set(name, stored + short)
    px4.wait(2.0)
    assert getattr(px4.force(), attribute)[0] == before
    px4.set(name, stored + far)
    px4.wait(2.0)
    assert getattr(px4.force(), attribute)[0] == pytest.approx(before + far)


def test_a_start_takes_over_from_nothing_so_that_small_offsets_are_never_in_force():
    small = {"CAL_MAG0_XOFF": 0.003, "CAL_MAG0_YOFF": 0.003, "CAL_MAG0_ZOFF": 0.002}
    assert Px4(parameters=small).force().offset.tolist() == [0.0, 0.0, 0.0]


def test_what_is_set_while_armed_acts_after_the_next_change_while_disarmed_only(px4):
    px4.vehicle.arm()
    px4.set(SWITCH, 2, 6)
    px4.set("CAL_MAG0_XCOMP", 5.0)
    px4.wait(2.0)
    assert px4.force().motor[0] == 0.0
    assert px4.force().compensation == 2, "the switch acts at once"
    px4.vehicle.disarm()
    px4.wait(10.0)
    assert px4.force().motor[0] == 0.0
    px4.set("CAL_MAG1_XCOMP", 0.5)
    px4.wait(2.0)
    assert px4.force().motor[0] == 5.0


def test_parameters_are_looked_at_once_a_second_at_most(px4):
    px4.set("CAL_MAG0_XCOMP", 1.0, seconds=0.05)
    assert px4.force().motor[0] == 1.0
    px4.set("CAL_MAG0_XCOMP", 2.0, seconds=0.5)
    assert px4.force().motor[0] == 1.0
    px4.wait(0.6)
    assert px4.force().motor[0] == 2.0


def test_a_compass_without_a_slot_is_not_corrected():
    px4 = Px4(parameters={"CAL_MAG0_ID": 0.0, SWITCH: 2.0})
    assert px4.force().offset.tolist() == px4.force().motor.tolist() == [0.0, 0.0, 0.0]
    assert px4.force(1).offset.any()


def test_a_slot_need_not_have_its_sensors_number():
    first, second = Px4().force(0), Px4().force(1)
    swapped = {"CAL_MAG0_ID": DEVICE_IDS[1], "CAL_MAG1_ID": DEVICE_IDS[0]}
    assert Px4(parameters=swapped).force(0).same_as(second)
    assert Px4(parameters=swapped).force(1).same_as(first)


def test_what_was_not_saved_is_gone_after_a_restart(px4):
    px4.set("CAL_MAG0_XCOMP", 3.0, seconds=1.0)
    px4.set("CAL_MAG0_YCOMP", 4.0, seconds=0.1)
    assert px4.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == [0]
    px4.wait(3.0)
    held = px4.vehicle.parameters
    assert (held["CAL_MAG0_XCOMP"], held["CAL_MAG0_YCOMP"]) == (3.0, 0.0)


def test_commands_are_answered_as_by_the_firmware(px4):
    interval, request = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE
    assert px4.command(interval, mavlink.MAVLINK_MSG_ID_SCALED_IMU, 20000) == [0]
    assert px4.command(interval, mavlink.MAVLINK_MSG_ID_RAW_IMU, 20000) == [4]
    assert px4.command(request, mavlink.MAVLINK_MSG_ID_RAW_IMU) == [4]
    assert px4.command(mavlink.MAV_CMD_DO_MOTOR_TEST, 1) == [3]
    px4.vehicle.arm()
    assert px4.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == [2]


def test_no_current_sensor_is_minus_one_ampere_and_is_multiplied_all_the_same():
    px4 = Px4(habits=Habits(no_current_sensor=True), parameters={SWITCH: 2.0})
    px4.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, 1e5)
    said = [m.current_battery for m in px4.wait(1.0) if m.get_type() == "BATTERY_STATUS"]
    assert set(said) == {-1}
    before = px4.compasses.corrected
    px4.set("CAL_MAG0_XCOMP", 100.0)
    px4.wait(2.0)
    moved = px4.compasses.corrected - before
    expected = -0.001 * px4.force().soft_iron @ np.array([100.0, 0.0, 0.0])
    assert moved == pytest.approx(expected, abs=0.01)


def test_a_flight_teaches_offsets_that_are_folded_in_when_it_ends():
    px4 = Px4("flight", parameters={"CAL_MAG0_XCOMP": 0.0})
    truth = px4.vehicle.truth
    before = px4.force().offset
    px4.wait(60.0)
    px4.vehicle.disarm()
    px4.wait(1.0)
    learned = px4.force().offset - before
    assert 0.005 < np.linalg.norm(learned) < 0.1
    assert px4.vehicle.parameters["CAL_MAG0_XOFF"] == pytest.approx(px4.force().offset[0])
    assert px4.force(1).offset == pytest.approx(exact(truth, 2).offset, abs=1e-6)
    # They undo the motors at hover: along the interference, which COMP opposes.
    along = float(learned @ exact(truth, 1).motor)
    assert -along > 0.9 * np.linalg.norm(learned) * np.linalg.norm(exact(truth, 1).motor)
