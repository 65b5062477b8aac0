"""The simulated autopilot's rules, one by one: docs/autopilots.md, ArduPilot: parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from effort import examples
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.mavlink.header import message_id
from magcomp.mavlink.splitter import Splitter
from magcomp.simulate import Vehicle, scenario
from magcomp.simulate.ground import DEFAULT_RATES, Asker

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
RAW_IMU = mavlink.MAVLINK_MSG_ID_RAW_IMU
FORCE = 21196


def request_list():
    return mavlink.MAVLink_param_request_list_message(1, 1)


def acknowledgement(messages):
    [ack] = [m for m in messages if m.get_type() == "COMMAND_ACK"]
    return ack.result


class TestParameters:
    def test_the_list_has_every_index_once_and_a_true_count(self, on_ground):
        values = on_ground().ask(request_list(), "PARAM_VALUE", 3.0)
        assert [v.param_index for v in values] == list(range(len(values)))
        assert {v.param_count for v in values} == {len(values)}
        assert len(values) > 300

    def test_the_list_comes_paced(self, on_ground):
        ground = on_ground()
        soon = ground.ask(request_list(), "PARAM_VALUE", 0.1)
        assert 0 < len(soon) < 100

    def test_asking_again_begins_the_list_again(self, on_ground):
        ground = on_ground()
        ground.ask(request_list(), "PARAM_VALUE", 0.1)
        values = ground.ask(request_list(), "PARAM_VALUE", 3.0)
        assert values[0].param_index == 0
        assert len(values) == values[0].param_count

    def test_reading_by_name_answers_without_an_index(self, on_ground):
        [value] = on_ground().read("COMPASS_MOTCT")
        assert (value.param_value, value.param_index) == (0.0, 65535)

    def test_reading_by_index_answers_with_it(self, on_ground):
        message = mavlink.MAVLink_param_request_read_message(1, 1, b"", 7)
        [value] = on_ground().ask(message, "PARAM_VALUE")
        assert value.param_index == 7

    def test_of_many_reads_at_once_twenty_are_answered(self, on_ground):
        ground = on_ground()
        for index in range(50):
            ground.say(mavlink.MAVLink_param_request_read_message(1, 1, b"", index))
        answers = ground.hear("PARAM_VALUE", 1.0)
        assert [answer.param_index for answer in answers] == list(range(20))

    @pytest.mark.parametrize("index", [-2, 5000, 32767])
    def test_reading_an_index_that_is_not_there_gets_no_reply(self, on_ground, index):
        message = mavlink.MAVLink_param_request_read_message(1, 1, b"", index)
        assert on_ground().ask(message, "PARAM_VALUE") == []

    def test_reading_an_unknown_name_gets_no_reply(self, on_ground):
        assert on_ground().read("NO_SUCH_NAME") == []

    def test_setting_an_unknown_name_gets_no_reply(self, on_ground):
        ground = on_ground()
        assert ground.set("NO_SUCH_NAME", 1.0) == []
        assert ground.hear("STATUSTEXT", 1.0) == []

    @pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
    def test_setting_what_is_no_number_gets_no_reply_and_changes_nothing(self, on_ground, value):
        ground = on_ground()
        assert ground.set("COMPASS_MOT_Y", value) == []
        assert ground.read("COMPASS_MOT_Y")[0].param_value == 0.0

    def test_a_set_is_echoed_as_float32_with_index_65535(self, on_ground):
        stored = float(np.float32(-1.83))
        assert on_ground().set("COMPASS_MOT_Y", -1.83) == [("COMPASS_MOT_Y", stored, 65535)]

    def test_setting_x_echoes_the_whole_vector(self, on_ground):
        ground = on_ground()
        ground.set("COMPASS_MOT2_Z", 3.0)
        echoes = ground.set("COMPASS_MOT2_X", 1.0)
        assert [(name, value) for name, value, _ in echoes] == [
            ("COMPASS_MOT2_X", 1.0),
            ("COMPASS_MOT2_Y", 0.0),
            ("COMPASS_MOT2_Z", 3.0),
        ]

    def test_setting_the_value_it_has_is_echoed_too(self, on_ground):
        assert on_ground().set("COMPASS_MOTCT", 0.0) == [("COMPASS_MOTCT", 0.0, 65535)]

    @pytest.mark.parametrize(("sent", "held"), [(1.999, 2.0), (1.5, 1.0), (-3.0, -3.0), (1e6, 127)])
    def test_whole_numbers_are_cut_and_kept_within_their_type(self, on_ground, sent, held):
        assert on_ground().set("COMPASS_LEARN", sent) == [("COMPASS_LEARN", held, 65535)]

    def test_a_read_only_name_echoes_the_old_value_and_says_so(self, on_ground):
        ground = on_ground()
        ground.say(mavlink.MAVLink_param_set_message(1, 1, b"COMPASS_DEV_ID", 5.0, 6))
        said = ground.wait(0.1)
        [value] = [m for m in said if m.get_type() == "PARAM_VALUE"]
        [text] = [m for m in said if m.get_type() == "STATUSTEXT"]
        assert value.param_value == 97539
        assert "Param write denied" in text.text

    def test_another_systems_set_is_left_alone(self, on_ground):
        ground = on_ground()
        message = mavlink.MAVLink_param_set_message(9, 1, b"COMPASS_MOT_X", 5.0, 9)
        assert ground.ask(message, "PARAM_VALUE") == []
        assert ground.machine.parameters["COMPASS_MOT_X"] == 0.0

    @pytest.mark.skipif(
        not hasattr(mavlink, "MAVLink_param_error_message"), reason="pymavlink without PARAM_ERROR"
    )
    @pytest.mark.parametrize(
        ("name", "value", "error"),
        [("NO_SUCH_NAME", 1.0, 1), ("COMPASS_MOT_X", math.nan, 2), ("COMPASS_DEV_ID", 5.0, 5)],
    )
    def test_newer_firmware_says_what_is_wrong(self, on_ground, name, value, error):
        ground = on_ground(answers_errors=True)
        message = mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, 9)
        [answer] = ground.ask(message, "PARAM_ERROR")
        assert (answer.param_id, answer.error) == (name, error)

    def test_per_motor_names_are_listed_only_when_switched_on(self, on_ground):
        ground = on_ground()
        before = {v.param_id for v in ground.ask(request_list(), "PARAM_VALUE", 2.0)}
        ground.set("COMPASS_PMOT_EN", 1)
        after = {v.param_id for v in ground.ask(request_list(), "PARAM_VALUE", 2.0)}
        hidden = {"COMPASS_PMOT_EXP"} | {f"COMPASS_PMOT{m}_{a}" for m in "1234" for a in "XYZ"}
        assert after - before == hidden

    def test_per_motor_compensation_acts_on_the_first_compass_alone(self, on_ground):
        ground = on_ground()
        ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        before = self.fields(ground)
        for name, value in (("PMOT_EXP", 1.0), ("PMOT_EN", 1.0), ("PMOT3_Z", 20.0)):
            ground.set(f"COMPASS_{name}", value)
        shift = self.fields(ground) - before
        # An armed motor without demand turns at MOT_SPIN_ARM: a tenth of the battery's 25 V.
        np.testing.assert_allclose(shift[0], [0, 0, 20.0 * 2.5], atol=6)
        np.testing.assert_allclose(shift[1:], 0.0, atol=6)

    @staticmethod
    def fields(ground):
        """Corrected fields of the three compasses, mGauss, shape (3, 3)."""
        kinds = {"RAW_IMU": 27, "SCALED_IMU2": 116, "SCALED_IMU3": 129}
        rows = []
        for kind, number in kinds.items():
            said = ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, number)
            rows += [(m.xmag, m.ymag, m.zmag) for m in said if m.get_type() == kind]
        return np.array(rows, dtype=float)

    @pytest.mark.parametrize("name", ["COMPASS_OFS_Z", "COMPASS_MOT_Z"])
    def test_a_compass_parameter_acts_at_once(self, on_ground, name):
        ground = on_ground()
        ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        ground.set("COMPASS_MOTCT", 2)
        before = self.fields(ground)
        ground.set(name, ground.machine.parameters[name] + 40.0)
        shift = (self.fields(ground) - before)[0]
        assert shift[2] > 25.0

    def test_all_three_compasses_are_complete(self, on_ground):
        names = {v.param_id for v in on_ground().ask(request_list(), "PARAM_VALUE", 2.0)}
        for suffix in ("", "2", "3"):
            for kind in ("OFS", "DIA", "ODI", "MOT"):
                assert {f"COMPASS_{kind}{suffix}_{axis}" for axis in "XYZ"} <= names
            for kind in ("SCALE", "DEV_ID", "USE", "ORIENT"):
                assert f"COMPASS_{kind}{suffix}" in names

    def test_stored_values_survive_a_reboot(self, on_ground):
        ground = on_ground()
        ground.set("COMPASS_MOT_X", 2.5)
        ground.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
        ground.wait(3.0)
        assert ground.read("COMPASS_MOT_X")[0].param_value == 2.5

    def test_a_changed_priority_moves_the_slots_at_the_next_boot(self, on_ground):
        ground = on_ground()
        second = ground.read("COMPASS_OFS2_X")[0].param_value
        ground.set("COMPASS_PRIO1_ID", 131874)
        ground.set("COMPASS_PRIO2_ID", 97539)
        assert ground.read("COMPASS_DEV_ID")[0].param_value == 97539
        ground.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
        ground.wait(3.0)
        assert ground.read("COMPASS_DEV_ID")[0].param_value == 131874
        assert ground.read("COMPASS_OFS_X")[0].param_value == second


class TestCommands:
    def test_an_unknown_command_is_unsupported(self, on_ground):
        assert acknowledgement(on_ground().command(31999)) == UNSUPPORTED

    def test_the_acknowledgement_names_who_asked(self, on_ground):
        [ack] = [m for m in on_ground().command(31999) if m.get_type() == "COMMAND_ACK"]
        assert (ack.command, ack.target_system, ack.target_component) == (31999, 255, 190)

    def test_the_version_comes_when_asked_for(self, on_ground):
        said = on_ground().command(mavlink.MAV_CMD_REQUEST_MESSAGE, 148)
        [version] = [m for m in said if m.get_type() == "AUTOPILOT_VERSION"]
        assert version.flight_sw_version >> 8 == 0x040603
        assert acknowledgement(said) == ACCEPTED

    def test_a_message_can_be_asked_for_once(self, on_ground):
        ground = on_ground()
        said = ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, RAW_IMU)
        said += ground.wait(2.0)
        assert [m.get_type() for m in said].count("RAW_IMU") == 1

    def test_asking_for_a_message_it_does_not_have_fails(self, on_ground):
        assert acknowledgement(on_ground().command(mavlink.MAV_CMD_REQUEST_MESSAGE, 9999)) == FAILED

    def test_the_banner_names_the_firmware(self):
        vehicle = Vehicle(scenario("sweep", 1))
        codec = mavlink.MAVLink(None)
        said = [codec.decode(bytearray(f.data)) for f in vehicle.advance(0.5)]
        texts = [m.text for m in said if m.get_type() == "STATUSTEXT"]
        assert texts[0].startswith("ArduCopter V4.6.3 (")

    def test_timesync_is_answered_with_its_own_stamp(self, on_ground):
        message = mavlink.MAVLink_timesync_message(tc1=0, ts1=123456789)
        [answer] = on_ground().ask(message, "TIMESYNC", 0.05)
        assert answer.ts1 == 123456789
        assert answer.tc1 == pytest.approx(1e9, rel=0.01)


class TestArming:
    def test_arming_shows_in_the_heartbeat(self, on_ground):
        ground = on_ground()
        assert acknowledgement(ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)) == ACCEPTED
        assert ground.hear("HEARTBEAT", 1.0)[0].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        assert acknowledgement(ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)) == ACCEPTED
        assert not ground.hear("HEARTBEAT", 1.0)[0].base_mode & 128

    def test_offsets_beyond_the_limit_forbid_arming_unless_forced(self, on_ground):
        ground = on_ground()
        ground.set("COMPASS_OFS_X", 5000)
        said = ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        assert acknowledgement(said) == FAILED
        assert any("offsets too high" in m.text for m in said if m.get_type() == "STATUSTEXT")
        forced = ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, FORCE)
        assert acknowledgement(forced) == ACCEPTED

    def test_in_the_air_it_does_not_disarm_unless_forced(self, on_ground):
        ground = on_ground("flight")
        ground.wait(60.0)
        assert acknowledgement(ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)) == FAILED
        assert ground.machine.armed

    def test_armed_it_does_not_reboot(self, on_ground):
        ground = on_ground()
        ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        said = ground.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
        assert acknowledgement(said) == FAILED

    def test_a_programme_arms_by_itself_and_ends_disarmed(self, on_ground):
        ground = on_ground("sweep")
        ground.wait(20.0)
        assert ground.machine.armed
        ground.wait(60.0)
        assert not ground.machine.armed
        assert ground.machine.program_over
        assert len(ground.hear("HEARTBEAT", 5.0)) == 5


class TestStreams:
    def test_nothing_is_streamed_unasked(self, on_ground):
        assert {m.get_type() for m in on_ground().wait(20.0)} <= {
            "HEARTBEAT",
            "TIMESYNC",
            "STATUSTEXT",
        }

    @pytest.mark.parametrize("hertz", [1, 4, 10, 30, 50, 100])
    def test_the_rate_asked_for_is_the_rate_that_comes(self, on_ground, hertz):
        ground = on_ground()
        said = ground.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, RAW_IMU, 1e6 / hertz)
        assert acknowledgement(said) == ACCEPTED
        heard = ground.hear("RAW_IMU", 20.0)
        # Intervals are whole milliseconds: 30 Hz comes every 33 ms.
        assert len(heard) / 20.0 == pytest.approx(hertz, rel=0.02, abs=0.06)

    def test_an_interval_can_be_asked_back(self, on_ground):
        ground = on_ground()
        ground.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, RAW_IMU, 20000)
        said = ground.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, RAW_IMU)
        [interval] = [m for m in said if m.get_type() == "MESSAGE_INTERVAL"]
        assert (interval.message_id, interval.interval_us) == (RAW_IMU, 20000)

    def test_a_message_not_streamed_has_interval_minus_one(self, on_ground):
        said = on_ground().command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, RAW_IMU)
        assert [m.interval_us for m in said if m.get_type() == "MESSAGE_INTERVAL"] == [-1]

    def test_a_stream_ends_with_interval_minus_one(self, on_ground):
        ground = on_ground()
        ground.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, RAW_IMU, 20000)
        ground.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, RAW_IMU, -1)
        assert ground.hear("RAW_IMU", 2.0) == []

    def test_an_interval_for_an_unknown_message_is_denied(self, on_ground):
        said = on_ground().command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 9999, 20000)
        assert acknowledgement(said) == DENIED

    def test_request_data_stream_starts_and_stops_a_group(self, on_ground):
        ground = on_ground()
        group = mavlink.MAV_DATA_STREAM_RAW_SENSORS
        ground.say(mavlink.MAVLink_request_data_stream_message(1, 1, group, 5, 1))
        kinds = [m.get_type() for m in ground.wait(10.0)]
        assert kinds.count("RAW_IMU") == kinds.count("SCALED_IMU3") == pytest.approx(50, abs=1)
        ground.say(mavlink.MAVLink_request_data_stream_message(1, 1, group, 0, 0))
        assert ground.hear("RAW_IMU", 2.0) == []

    def test_a_reboot_forgets_the_streams_and_restarts_the_clock(self, on_ground):
        ground = on_ground()
        ground.wait(3.0)
        ground.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, RAW_IMU, 20000)
        ground.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
        assert ground.wait(1.0) == []
        said = ground.wait(2.0)
        assert "RAW_IMU" not in {m.get_type() for m in said}
        assert any("ArduCopter" in m.text for m in said if m.get_type() == "STATUSTEXT")
        again = ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, RAW_IMU)
        [reading] = [m for m in again if m.get_type() == "RAW_IMU"]
        assert reading.time_usec < 2e6


class TestSigning:
    KEY = bytes(range(32))

    def test_every_frame_is_signed(self, on_ground):
        vehicle = on_ground(signing_key=self.KEY).machine
        frames = vehicle.advance(10.0)
        assert frames
        assert all(frame.data[2] & mavlink.MAVLINK_IFLAG_SIGNED for frame in frames)

    def test_unsigned_frames_are_not_obeyed(self, on_ground):
        ground = on_ground(signing_key=self.KEY)
        message = mavlink.MAVLink_param_set_message(1, 1, b"COMPASS_MOT_X", 3.0, 9)
        ground.machine.receive(ground.asker.pack(message), 1.0)
        assert ground.machine.parameters["COMPASS_MOT_X"] == 0.0

    @pytest.mark.parametrize(("key", "stored"), [(KEY, 3.0), (bytes(32), 0.0)])
    def test_frames_signed_with_its_key_are_obeyed_and_others_not(self, on_ground, key, stored):
        ground = on_ground(signing_key=self.KEY)
        codec = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        codec.signing.secret_key, codec.signing.sign_outgoing = key, True
        # Tens of microseconds since 2015; the simulated vehicle boots in June 2025.
        codec.signing.timestamp = (1_750_000_001 - 1_420_070_400) * 100_000
        message = mavlink.MAVLink_param_set_message(1, 1, b"COMPASS_MOT_X", 3.0, 9)
        ground.machine.receive(bytes(message.pack(codec)), 1.0)
        assert ground.machine.parameters["COMPASS_MOT_X"] == stored


class TestWhatIsNotMavlink:
    @settings(max_examples=examples(100), deadline=None)
    @given(st.binary(max_size=300))
    def test_any_bytes_are_taken_without_a_word(self, data):
        vehicle = self.vehicle()
        before = dict(vehicle.parameters)
        for frame in Splitter().push(data):
            vehicle.receive(frame, 0.0)
        assert dict(vehicle.parameters) == before

    @settings(max_examples=examples(100), deadline=None)
    @given(st.integers(0, 300), st.integers(0, 255), st.binary(max_size=3))
    def test_a_damaged_set_changes_nothing(self, place, value, junk):
        sound = Asker().pack(mavlink.MAVLink_param_set_message(1, 1, b"COMPASS_MOT_X", 7.0, 9))
        damaged = bytearray(sound)
        damaged[place % len(sound)] = value
        assume(bytes(damaged) != sound)
        vehicle = self.vehicle()
        for frame in Splitter().push(junk + bytes(damaged)):
            vehicle.receive(frame, 0.0)
        assert vehicle.parameters["COMPASS_MOT_X"] == 0.0

    @settings(max_examples=examples(70), deadline=None)
    @given(data=st.data())
    def test_no_parameter_value_brings_it_down(self, data):
        vehicle, asker = Vehicle(scenario("sweep", 1)), Asker()
        relevant = [n for n in vehicle.parameters if n.startswith(("COMPASS", "MOT_", "BATT"))]
        for name in data.draw(st.lists(st.sampled_from(relevant), min_size=1, max_size=6)):
            value = data.draw(st.floats(width=32))
            message = mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, 9)
            vehicle.receive(asker.pack(message), 0.0)
        for number in DEFAULT_RATES:
            vehicle.receive(asker.rate(number, 10.0), 0.0)
        vehicle.receive(asker.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, FORCE), 0.0)
        assert vehicle.armed
        assert len(vehicle.advance(0.5)) > 20

    @given(st.lists(st.integers(1, 40), min_size=1), st.binary(max_size=20))
    def test_frames_survive_any_cutting_of_the_stream(self, cuts, junk):
        asker = Asker()
        frames = [asker.heartbeat(), asker.parameter_list(), asker.rate(27, 10.0)] * 3
        stream = bytes(b for b in junk if b not in (0xFD, 0xFE)) + b"".join(frames)
        splitter, got = Splitter(), []
        while stream:
            size = cuts[len(got) % len(cuts)]
            got += splitter.push(stream[:size])
            stream = stream[size:]
        assert got == frames
        assert [message_id(f) for f in got[:3]] == [0, 21, 76]

    _vehicle: Vehicle | None = None

    @classmethod
    def vehicle(cls) -> Vehicle:
        """One vehicle for all examples: drawing one costs more than an example."""
        if cls._vehicle is None:
            cls._vehicle = Vehicle(scenario("sweep", 1))
        return cls._vehicle
