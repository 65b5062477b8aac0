"""What a link knows and says, in simulated time and without a socket."""

from __future__ import annotations

import math
import random
import struct

import pytest
from link_vehicle import DEVICE_IDS, FakeVehicle, play
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.errors import UsageError
from magcomp.link.events import GapEnded, GapStarted, VehicleFound, VehicleRebooted
from magcomp.link.framing import Framer
from magcomp.link.quality import RateMeter, SequenceCounter
from magcomp.link.state import LinkState
from magcomp.link.streams import DEFAULT_RATES, How, affordable

READ_ONLY = {"HEARTBEAT", "TIMESYNC", "PARAM_REQUEST_READ", "COMMAND_LONG"}


def names(messages):
    return [message.get_type() for message in messages]


class TestBeingAGroundStation:
    def test_a_heartbeat_goes_out_each_second_even_when_nobody_is_there(self):
        state = LinkState()
        sent = [(i, m) for i in range(100) for m in state.due(i * 0.05)]
        assert [i for i, _ in sent] == [0, 20, 40, 60, 80]
        assert all(m.type == mavlink.MAV_TYPE_GCS for _, m in sent)

    def test_nothing_is_written_to_a_vehicle_by_just_listening(self):
        vehicle = FakeVehicle()
        play(LinkState(), [vehicle], 0.0, 20.0)
        assert set(vehicle.names_heard()) == READ_ONLY
        commands = {m.command for m in vehicle.heard if m.get_type() == "COMMAND_LONG"}
        assert commands == {mavlink.MAV_CMD_REQUEST_MESSAGE}


class TestFindingTheVehicle:
    def test_it_is_identified_down_to_its_compasses(self):
        state = LinkState()
        play(state, [FakeVehicle()], 0.0, 3.0)
        vehicle = state.vehicle
        assert (vehicle.autopilot, vehicle.kind) == ("ardupilot", "copter")
        assert (vehicle.system, vehicle.component) == (1, 1)
        assert vehicle.firmware == "4.6.3"
        assert vehicle.board == "board 140"
        assert vehicle.device_ids == tuple(DEVICE_IDS.values())

    def test_it_is_announced_once_when_known(self):
        state = LinkState()
        play(state, [FakeVehicle()], 0.0, 5.0)
        found = [e for e in state.take_events() if isinstance(e, VehicleFound)]
        assert [event.vehicle for event in found] == [state.vehicle]

    def test_what_a_bad_link_brings_late_is_learnt_and_announced(self):
        vehicle, state = FakeVehicle(), LinkState()
        lost = vehicle.parameters.pop("COMPASS_DEV_ID")
        play(state, [vehicle], 0.0, 5.0)
        assert state.identified(5.0)
        assert lost not in state.vehicle.device_ids
        vehicle.parameters["COMPASS_DEV_ID"] = lost
        play(state, [vehicle], 5.0, 7.0)
        assert state.vehicle.device_ids == tuple(DEVICE_IDS.values())
        found = [e.vehicle for e in state.take_events() if isinstance(e, VehicleFound)]
        assert found[-1] == state.vehicle != found[0]

    def test_a_vehicle_with_one_compass_is_identified_too(self):
        vehicle = FakeVehicle()
        vehicle.parameters = {"COMPASS_DEV_ID": 97539, "COMPASS_DEV_ID2": 0}
        state = LinkState(system=1)
        play(state, [vehicle], 0.0, 5.0)
        assert state.identified(5.0)
        assert state.vehicle.device_ids == (97539,)
        play(state, [vehicle], 5.0, 20.0)
        asked = vehicle.names_heard().count("PARAM_REQUEST_READ")
        play(state, [vehicle], 25.0, 20.0)
        assert vehicle.names_heard().count("PARAM_REQUEST_READ") == asked

    def test_a_third_of_all_frames_may_be_lost_each_way(self):
        chance = random.Random(5)
        state = LinkState()
        play(state, [FakeVehicle()], 0.0, 10.0, lost=lambda: chance.random() < 0.3)
        assert state.vehicle.device_ids == tuple(DEVICE_IDS.values())
        assert state.vehicle.firmware == "4.6.3"

    def test_the_start_banner_names_the_firmware_where_nothing_else_does(self):
        vehicle, state = FakeVehicle(), LinkState()
        banner = mavlink.MAVLink_statustext_message(6, b"ArduCopter V4.5.7 (2a3dc4b7)")
        state.receive(vehicle.heartbeat() + vehicle.pack(banner), 0.0)
        assert state.vehicle.firmware == "4.5.7"

    def test_px4_is_told_apart_and_its_integers_read_bytewise(self):
        vehicle = FakeVehicle(autopilot=mavlink.MAV_AUTOPILOT_PX4)
        (as_float,) = struct.unpack("<f", struct.pack("<i", 197388))
        vehicle.parameters = {"CAL_MAG0_ID": as_float, "CAL_MAG1_ID": 0.0, "CAL_MAG2_ID": 0.0}
        state = LinkState(system=1)
        play(state, [vehicle], 0.0, 2.0)
        assert state.vehicle.autopilot == "px4"
        assert state.vehicle.device_ids == (197388,)

    @pytest.mark.parametrize(
        "options",
        [
            {"autopilot": mavlink.MAV_AUTOPILOT_INVALID, "kind": mavlink.MAV_TYPE_GIMBAL},
            {"autopilot": mavlink.MAV_AUTOPILOT_INVALID, "kind": mavlink.MAV_TYPE_GCS},
            {"autopilot": mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, "kind": mavlink.MAV_TYPE_GCS},
        ],
        ids=["gimbal", "ground station", "ground station that claims an autopilot"],
    )
    def test_what_is_no_autopilot_is_no_vehicle(self, options):
        state = LinkState()
        play(state, [FakeVehicle(**options)], 0.0, 3.0)
        assert state.vehicle is None
        assert "HEARTBEAT" in state.foreign


class TestSeveralVehicles:
    def test_nothing_of_either_is_given_until_one_is_chosen(self):
        state = LinkState()
        first, second = FakeVehicle(system=1), FakeVehicle(system=2)
        play(state, [first, second], 0.0, 2.0)
        assert state.ambiguous()
        assert [heartbeat.system for heartbeat in state.heartbeats] == [1, 2]
        later = play(state, [first, second], 2.0, 2.0)
        assert not any(received.from_vehicle for received in later)

    def test_only_the_chosen_one_is_heard_and_asked(self):
        state = LinkState(system=2)
        first, second = FakeVehicle(system=1), FakeVehicle(system=2)
        second.parameters["COMPASS_DEV_ID"] = 11.0
        received = play(state, [first, second], 0.0, 4.0)
        assert state.vehicle.system == 2
        assert state.vehicle.device_ids[0] == 11
        assert {r.frame.source for r in received if r.from_vehicle} == {(2, 1)}
        targets = {getattr(m, "target_system", 2) for m in first.heard}
        assert targets == {2}

    def test_one_that_joins_later_is_not_mixed_in(self):
        state = LinkState()
        first, second = FakeVehicle(system=1), FakeVehicle(system=2)
        play(state, [first], 0.0, 3.0)
        received = play(state, [first, second], 3.0, 3.0)
        assert not state.ambiguous()
        assert {r.frame.source for r in received if r.from_vehicle} == {(1, 1)}

    def test_another_component_of_the_same_system_is_not_the_vehicle(self):
        state = LinkState()
        gimbal = FakeVehicle(component=154, autopilot=8, kind=mavlink.MAV_TYPE_GIMBAL)
        received = play(state, [FakeVehicle(), gimbal], 0.0, 2.0)
        assert {r.frame.source for r in received if r.from_vehicle} == {(1, 1)}


class TestQuality:
    def test_no_loss_is_no_loss(self):
        state = LinkState()
        play(state, [FakeVehicle()], 0.0, 5.0)
        assert state.statistics(5.0).lost == 0
        assert state.statistics(5.0).loss == 0.0

    def test_missing_numbers_are_counted_as_lost(self):
        vehicle, state = FakeVehicle(), LinkState()
        state.receive(vehicle.heartbeat(), 0.0)
        vehicle.skip(9)
        state.receive(vehicle.heartbeat(), 0.5)
        assert state.statistics(0.5).lost == 9
        assert state.statistics(0.5).loss == pytest.approx(9 / 11)
        assert state.statistics(20.0).loss == 0.0

    def test_a_frame_that_comes_twice_or_late_is_not_250_lost_ones(self):
        counter = SequenceCounter()
        assert [counter.heard(n) for n in (10, 11, 11, 13, 12, 14, 15)] == [0, 0, 0, 1, 0, 0, 0]

    def test_numbers_wrap_at_256(self):
        counter = SequenceCounter()
        assert [counter.heard(n % 256) for n in range(250, 520)] == [0] * 270

    def test_numbers_that_start_over_are_believed_after_three(self):
        counter = SequenceCounter()
        for number in (100, 101, 0, 1, 2, 3, 4):
            counter.heard(number)
        assert counter.lost == 0

    def test_rates_are_those_of_the_last_seconds(self):
        meter = RateMeter()
        for index in range(1000):
            meter.heard("RAW_IMU", 0, index * 0.02)
            if index % 10 == 0:
                meter.heard("VFR_HUD", 0, index * 0.02)
        rates = meter.rates(19.999)
        assert rates["RAW_IMU"] == pytest.approx(50.0, rel=0.02)
        assert rates["VFR_HUD"] == pytest.approx(5.0, rel=0.05)
        assert meter.rates(40.0) == {}

    def test_the_round_trip_is_measured(self):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        state.receive(vehicle.heartbeat(), 0.0)
        (question,) = [m for m in state.due(0.0) if m.get_type() == "TIMESYNC"]
        answer = vehicle.hear(state.pack(question, 0))
        state.receive(answer, 0.240)
        assert state.statistics(0.3).round_trip_s == pytest.approx(0.240)

    def test_an_answer_to_somebody_elses_question_is_no_round_trip(self):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        state.receive(vehicle.heartbeat(), 0.0)
        state.due(0.0)
        state.receive(vehicle.pack(mavlink.MAVLink_timesync_message(7, 123456)), 0.1)
        assert math.isnan(state.statistics(0.1).round_trip_s)


class TestGaps:
    def test_silence_is_a_gap_from_the_last_frame_to_the_next(self):
        vehicle, state = FakeVehicle(), LinkState()
        play(state, [vehicle], 0.0, 5.0)
        play(state, [], 5.0, 10.0)
        assert not state.statistics(15.0).up
        play(state, [vehicle], 15.0, 1.0)
        (gap,) = state.statistics(16.0).gaps
        assert (gap.start, gap.end) == (pytest.approx(4.95), 15.0)
        events = [type(e) for e in state.take_events()]
        assert events == [VehicleFound, GapStarted, GapEnded]
        assert state.statistics(16.0).up

    def test_frames_unheard_in_a_gap_are_not_counted_as_lost(self):
        vehicle, state = FakeVehicle(), LinkState()
        play(state, [vehicle], 0.0, 5.0)
        vehicle.skip(77)
        play(state, [], 5.0, 10.0)
        play(state, [vehicle], 15.0, 1.0)
        assert state.statistics(16.0).lost == 0

    def test_a_closed_transport_is_a_gap_at_once(self):
        vehicle, state = FakeVehicle(), LinkState()
        play(state, [vehicle], 0.0, 2.0)
        state.closed(2.0, "unplugged")
        state.reopened(4.0)
        play(state, [vehicle], 4.0, 1.0)
        (gap,) = state.statistics(5.0).gaps
        assert gap.duration == pytest.approx(2.05)
        assert GapStarted(pytest.approx(1.95), "unplugged") in state.take_events()

    def test_a_vehicle_is_not_asked_anything_in_a_gap(self):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        play(state, [vehicle], 0.0, 2.0)
        silent = [m for i in range(400) for m in state.due(10.0 + i * 0.05)]
        assert set(names(silent)) == {"HEARTBEAT"}


class TestReboots:
    def test_a_clock_that_starts_over_is_a_reboot_and_streams_are_asked_for_again(self):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        play(state, [vehicle], 0.0, 30.0)
        state.request_streams({"RAW_IMU": 50.0}, 30.0)
        play(state, [vehicle], 30.0, 5.0)
        vehicle.boot_time = 35.0
        vehicle.interval_us.clear()
        play(state, [vehicle], 35.0, 5.0)
        assert [e for e in state.take_events() if isinstance(e, VehicleRebooted)]
        assert vehicle.interval_us == {mavlink.MAVLINK_MSG_ID_RAW_IMU: 20_000}

    def test_one_late_frame_is_no_reboot(self):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        play(state, [vehicle], 0.0, 30.0)
        state.receive(vehicle.attitude(10.0), 30.0)
        play(state, [vehicle], 30.0, 5.0)
        assert not [e for e in state.take_events() if isinstance(e, VehicleRebooted)]


class TestAnotherVehicleInItsPlace:
    def swapped(self, answers=True):
        state = LinkState(system=1)
        play(state, [FakeVehicle()], 0.0, 5.0)
        state.take_events()
        state.closed(5.0, "unplugged")
        state.reopened(7.0)
        other = FakeVehicle()
        other.parameters = {"COMPASS_DEV_ID": 4711.0, "COMPASS_DEV_ID2": 0, "COMPASS_DEV_ID3": 0}
        if not answers:
            other.parameters = {}
        play(state, [other], 7.0, 5.0)
        return state

    def test_it_is_noticed_after_a_cable_was_pulled(self):
        state = self.swapped()
        found = [e.vehicle for e in state.take_events() if isinstance(e, VehicleFound)]
        assert [vehicle.device_ids for vehicle in found] == [(4711,)]
        assert state.vehicle == found[0]

    def test_no_answer_leaves_the_identity_that_was_known(self):
        state = self.swapped(answers=False)
        assert state.vehicle.device_ids == tuple(DEVICE_IDS.values())
        assert not [e for e in state.take_events() if isinstance(e, VehicleFound)]

    def test_the_same_one_is_not_announced_again(self):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        play(state, [vehicle], 0.0, 5.0)
        state.reopened(5.0)
        play(state, [vehicle], 5.0, 5.0)
        assert len([e for e in state.take_events() if isinstance(e, VehicleFound)]) == 1


WANTED = {"RAW_IMU": 50.0, "ATTITUDE": 25.0, "VFR_HUD": 10.0}
IDS = {name: getattr(mavlink, f"MAVLINK_MSG_ID_{name}") for name in WANTED}


class TestStreams:
    def test_each_message_gets_its_interval(self):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        play(state, [vehicle], 0.0, 2.0)
        state.request_streams(WANTED, 2.0)
        play(state, [vehicle], 2.0, 2.0)
        assert vehicle.interval_us == {IDS[n]: round(1e6 / hz) for n, hz in WANTED.items()}
        assert state.stream_report.complete
        assert set(state.stream_report.how.values()) == {How.INTERVAL}

    def test_the_previous_intervals_come_back(self):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        before = {IDS["RAW_IMU"]: 500_000, IDS["ATTITUDE"]: 250_000, IDS["VFR_HUD"]: -1}
        vehicle.interval_us = dict(before)
        play(state, [vehicle], 0.0, 2.0)
        state.request_streams(WANTED, 2.0)
        play(state, [vehicle], 2.0, 3.0)
        assert vehicle.interval_us != before
        state.restore_streams()
        play(state, [vehicle], 5.0, 3.0)
        assert vehicle.interval_us == before
        assert state.stream_report.complete

    def test_a_third_of_all_frames_may_be_lost_each_way(self):
        chance = random.Random(1)
        vehicle, state = FakeVehicle(), LinkState(system=1)
        play(state, [vehicle], 0.0, 2.0)
        state.request_streams(WANTED, 2.0)
        play(state, [vehicle], 2.0, 15.0, lost=lambda: chance.random() < 0.3)
        assert set(vehicle.interval_us) == set(IDS.values())
        assert state.stream_report.complete

    def test_a_vehicle_without_intervals_is_asked_for_groups(self):
        vehicle, state = FakeVehicle(intervals=False), LinkState(system=1)
        play(state, [vehicle], 0.0, 2.0)
        state.request_streams(WANTED, 2.0)
        play(state, [vehicle], 2.0, 3.0)
        assert vehicle.groups == {
            mavlink.MAV_DATA_STREAM_RAW_SENSORS: 50,
            mavlink.MAV_DATA_STREAM_EXTRA1: 25,
            mavlink.MAV_DATA_STREAM_EXTRA2: 10,
        }
        assert set(state.stream_report.how.values()) == {How.STREAM}
        assert state.stream_report.complete

    def test_groups_go_back_to_the_rates_measured_before(self):
        vehicle, state = FakeVehicle(intervals=False), LinkState(system=1)
        play(state, [vehicle], 0.0, 8.0, step=0.25)  # its attitude comes at 4 Hz
        state.request_streams(WANTED, 8.0)
        play(state, [vehicle], 8.0, 3.0)
        state.restore_streams()
        play(state, [vehicle], 11.0, 3.0)
        assert vehicle.groups == {
            mavlink.MAV_DATA_STREAM_RAW_SENSORS: 0,
            mavlink.MAV_DATA_STREAM_EXTRA1: 4,
            mavlink.MAV_DATA_STREAM_EXTRA2: 0,
        }

    def test_a_silent_vehicle_ends_in_groups_and_does_not_hang(self):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        play(state, [vehicle], 0.0, 2.0)
        state.request_streams({"RAW_IMU": 50.0}, 2.0)
        deaf = Framer()
        sent = []
        for index in range(300):
            now = 2.0 + index * 0.05
            state.receive(vehicle.attitude(now), now)
            sent += [f for m in state.due(now) for f in deaf.receive(state.pack(m, 0), now)]
        assert state.stream_report.complete
        assert state.stream_report.how == {"RAW_IMU": How.STREAM}
        assert names(f.message for f in sent).count("REQUEST_DATA_STREAM") == 2

    def test_an_acknowledgement_for_another_ground_station_is_not_ours(self):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        play(state, [vehicle], 0.0, 2.0)
        vehicle.interval_us[IDS["RAW_IMU"]] = 100_000
        state.request_streams({"RAW_IMU": 50.0}, 2.0)
        for question in state.due(2.0):
            state.receive(vehicle.hear(state.pack(question, 0)), 2.0)
        state.due(2.05)
        foreign = mavlink.MAVLink_command_ack_message(511, 0, 0, 0, 254, 190)
        state.receive(vehicle.pack(foreign), 2.1)
        assert not state.stream_report.complete

    def test_no_more_than_one_interval_is_under_way_at_once(self):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        play(state, [vehicle], 0.0, 2.0)
        state.request_streams(WANTED, 2.0)
        now, unanswered = 2.0, 0
        for _ in range(200):
            now += 0.05
            for message in state.due(now):
                setting = message.get_type() == "COMMAND_LONG" and message.command == 511
                unanswered += setting
                assert unanswered <= 1
                state.receive(vehicle.hear(state.pack(message, 0)), now)
                unanswered -= setting
        assert set(vehicle.interval_us) == set(IDS.values())

    @pytest.mark.parametrize("rates", [{"GPS_RTK": 5.0}, {"RAW_IMU": 0.0}, {"ATTITUDE": math.nan}])
    def test_a_stream_that_cannot_be_is_refused(self, rates):
        vehicle, state = FakeVehicle(), LinkState(system=1)
        play(state, [vehicle], 0.0, 2.0)
        with pytest.raises(UsageError, match=r"must be one of .*RAW_IMU.* above 0") as refusal:
            state.request_streams(rates, 2.0)
        assert next(iter(rates)) in str(refusal.value)

    def test_a_slow_line_slows_all_streams_alike(self):
        slow = affordable(DEFAULT_RATES, 5760)
        assert slow["RAW_IMU"] == slow["ATTITUDE"] < 50
        sizes = {
            m.msgname: m.unpacker.size + 12
            for m in mavlink.mavlink_map.values()
            if m.msgname in slow
        }
        assert sum(rate * sizes[name] for name, rate in slow.items()) <= 5760
        assert min(slow.values()) >= 1.0
        assert affordable(DEFAULT_RATES, 1e9) == DEFAULT_RATES
