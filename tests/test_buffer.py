"""The buffer is the log of a live vehicle: same numbers, bounded memory, coverage kept."""

from __future__ import annotations

import math
import time
import tracemalloc
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_vehicle import UNIX_US, FakeVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.buffer import BANDS, LEVELS, SECTORS, Buffer, sphere_cell
from magcomp.errors import LogError
from magcomp.link import Recorder, connect
from magcomp.link.address import Replay
from magcomp.link.state import LinkState
from magcomp.mavlink.records import records
from magcomp.model import Recording, Series
from magcomp.sources import read_tlog

FIXTURES = Path(__file__).parents[1] / "sitl_fixtures"
FIXTURE = FIXTURES / "flight.tlog"
SERIES = [f.name for f in fields(Recording) if str(f.type) == "Series | None"]
EVERYTHING = 1 << 30


def filled(path, **options):
    buffer = Buffer(path.name, **options)
    for unix_us, frame in records(path.read_bytes()):
        buffer.add(unix_us, frame)
    return buffer


def assert_same_series(first: Series | None, second: Series | None):
    assert (first is None) == (second is None)
    if first is not None and second is not None:
        np.testing.assert_array_equal(first.time, second.time)
        np.testing.assert_array_equal(first.value, second.value)


def assert_same(first: Recording, second: Recording):
    for one, other in (
        (first.field, second.field),
        (first.other_currents, second.other_currents),
    ):
        assert one.keys() == other.keys()
        for number in one:
            assert_same_series(one[number], other[number])
    for name in SERIES:
        assert_same_series(getattr(first, name), getattr(second, name))
    assert first.parameters == second.parameters
    assert first.vehicle == second.vehicle
    assert first.duration_s == second.duration_s
    assert first.start_unix_s == second.start_unix_s


class TestTheSameNumbers:
    def test_what_came_over_a_link_is_what_its_own_tlog_holds(self, tmp_path):
        path = tmp_path / "live.tlog"
        buffer = Buffer("live")
        with (
            Recorder(path) as recorder,
            connect(Replay(FIXTURE, math.inf), sinks=[recorder, buffer]) as link,
        ):
            while not link.ended:
                link.receive(0.5)
        recording = read_tlog(path)
        assert len(recording.field[1]) > 2000
        assert_same(buffer.snapshot(), recording)

    @pytest.mark.parametrize("name", ["turntable_five_levels", "sweep_throttle_only"])
    def test_every_kind_of_recording_comes_out_as_it_went_in(self, name):
        path = FIXTURES / f"{name}.tlog"
        assert_same(filled(path).snapshot(), read_tlog(path))

    def test_a_snapshot_grows_with_what_arrives(self):
        buffer, frames = Buffer("x"), list(records(FIXTURE.read_bytes()))
        for unix_us, frame in frames[:8000]:
            buffer.add(unix_us, frame)
        early = buffer.snapshot()
        for unix_us, frame in frames[8000:]:
            buffer.add(unix_us, frame)
        late = buffer.snapshot()
        count = len(early.field[1])
        assert 0 < count < len(late.field[1])
        np.testing.assert_array_equal(early.field[1].value, late.field[1].value[:count])

    def test_before_the_first_heartbeat_there_is_no_recording(self):
        with pytest.raises(LogError):
            Buffer("udp:0.0.0.0:14550").snapshot()

    def test_another_system_is_left_out_when_one_is_chosen(self):
        buffer = Buffer("x")
        for system in (1, 2):
            vehicle = FakeVehicle(system=system)
            for index in range(20):
                for _, frame in records(
                    b"".join((UNIX_US).to_bytes(8) + raw for raw in (vehicle.heartbeat(),))
                ):
                    buffer.add(UNIX_US + index * 100_000, frame)
                buffer.add(UNIX_US + index * 100_000, vehicle.attitude(index * 0.1, yaw=system))
        recording = buffer.snapshot(system=2)
        assert recording.vehicle.system == 2
        assert set(recording.attitude.value[:, 2]) == {2.0}


class Flight:
    """Hours of a vehicle's telemetry, made as fast as can be."""

    def __init__(self, buffer):
        self.vehicle, self.buffer = FakeVehicle(), buffer
        self.step = 0

    def say(self, message, at_s):
        raw = message if isinstance(message, bytes) else self.vehicle.pack(message)
        self.buffer.add(UNIX_US + round(at_s * 1e6), raw)

    def parameter(self, name, value, at_s):
        self.say(mavlink.MAVLink_param_value_message(name.encode(), value, 9, 1, 0), at_s)

    def fly(self, seconds, hz=50):
        for _ in range(round(seconds * hz)):
            at = self.step / hz
            reading = self.step * 10 // hz % 400  # the compass is read at 10 Hz
            if self.step % hz == 0:
                self.say(self.vehicle.heartbeat(), at)
            self.say(self.vehicle.attitude(at), at)
            imu = (round(at * 1e6), 0, 0, -1000, 0, 0, 0, reading + 1, 100, 300)
            self.say(mavlink.MAVLink_raw_imu_message(*imu), at)
            self.step += 1


class TestBoundedMemory:
    LIMIT = 200_000

    def test_memory_stays_under_the_bound_for_as_long_as_it_takes(self):
        buffer = Buffer("x", limit=self.LIMIT)
        flight = Flight(buffer)
        for _ in range(4):
            flight.fly(100)
            assert buffer.size <= self.LIMIT
            assert len(buffer.data()) <= buffer.size
        assert buffer.snapshot().duration_s > 100

    def test_fast_streams_are_halved_before_anything_is_dropped(self):
        buffer = Buffer("x", limit=self.LIMIT)
        flight = Flight(buffer)
        flight.fly(60)
        whole, flight.buffer = buffer.snapshot(), Buffer("x", limit=EVERYTHING)
        flight = Flight(flight.buffer)
        flight.fly(60)
        everything = flight.buffer.snapshot()
        assert len(whole.attitude) < len(everything.attitude)
        assert whole.duration_s == pytest.approx(everything.duration_s, abs=1.0)
        assert len(whole.armed) == len(everything.armed)
        seen = {tuple(row) for row in whole.field[1].value.tolist()}
        assert seen == {tuple(row) for row in everything.field[1].value.tolist()}

    def test_what_is_slower_than_twenty_hertz_is_never_thinned(self):
        buffer = Buffer("x", limit=30_000)
        flight = Flight(buffer)
        flight.fly(120, hz=10)
        recording = buffer.snapshot()
        np.testing.assert_allclose(np.diff(recording.attitude.time), 0.1, atol=1e-3)

    def test_parameters_and_identity_outlive_the_rest(self):
        buffer = Buffer("x", limit=self.LIMIT)
        flight = Flight(buffer)
        flight.parameter("COMPASS_DEV_ID", 97539.0, 0.0)
        flight.parameter("COMPASS_MOT_X", 1.5, 0.0)
        flight.say(mavlink.MAVLink_statustext_message(6, b"ArduCopter V4.6.3 (3fc7011a)"), 0.0)
        flight.fly(150)
        flight.parameter("COMPASS_MOT_X", 2.5, 150.0)
        flight.fly(250)
        recording = buffer.snapshot()
        assert recording.vehicle.device_ids == (97539,)
        assert recording.vehicle.firmware == "4.6.3"
        assert [c.value for c in recording.parameters.of("COMPASS_MOT_X")] == [1.5, 2.5]

    def test_parameters_read_over_and_over_take_no_more_memory(self):
        buffer = Buffer("x", limit=self.LIMIT)
        flight = Flight(buffer)
        for index in range(15):
            for number in range(20):
                flight.parameter(f"COMPASS_P{number}", float(number), index * 20.0)
            flight.step = index * 1000
            flight.fly(20)
        assert buffer.size <= self.LIMIT + 20 * 600  # what Python needs for each counts as well
        assert len(buffer.snapshot().parameters.names) == 20

    def test_a_flood_of_parameters_and_texts_stays_under_the_bound_too(self):
        buffer = Buffer("x", limit=self.LIMIT)
        flight = Flight(buffer)
        for index in range(8):
            for number in range(200):
                flight.parameter(f"P{index}_{number}", float(number), index * 20.0)
                flight.parameter("SAME", float(number), index * 20.0)
                line = f"text {index} {number}".encode()
                flight.say(mavlink.MAVLink_statustext_message(6, line), index * 20.0)
            flight.step = index * 1000
            flight.fly(20)
            assert buffer.size <= self.LIMIT * 5 // 4
            assert len(buffer.data()) <= buffer.size
        assert buffer.snapshot().parameters.last("P7_199", 0.0) == 199.0

    def test_the_memory_held_is_what_was_asked_for_however_much_is_said_in_words(self):
        tracemalloc.start()
        try:
            buffer = Buffer("x", limit=self.LIMIT)
            flight = Flight(buffer)
            for number in range(3000):
                text = mavlink.MAVLink_statustext_message(6, f"text {number}".encode())
                flight.say(text, number * 0.05)
            held, _ = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert held < 2 * self.LIMIT

    def test_a_flood_of_texts_crowds_no_parameter_out(self):
        buffer = Buffer("x", limit=self.LIMIT)
        flight = Flight(buffer)
        flight.fly(1)
        flight.parameter("COMPASS_MOT_X", 1.5, 0.0)
        for number in range(9000):
            text = mavlink.MAVLink_statustext_message(6, f"text {number}".encode())
            flight.say(text, number * 0.05)
        flight.say(flight.vehicle.heartbeat(), 450.0)
        assert buffer.snapshot().parameters.last("COMPASS_MOT_X", 0.0) == 1.5

    def test_a_clock_that_jumps_with_each_frame_makes_no_block_of_each(self):
        buffer, vehicle = Buffer("x", limit=self.LIMIT), FakeVehicle()
        for index in range(8000):
            jump = (index * 7_919) % 1_000 * 60_000_000
            buffer.add(UNIX_US + jump, vehicle.attitude(index * 0.02))
        assert self.LIMIT // 2 < buffer.size <= self.LIMIT
        assert len(buffer._blocks) <= 2 * 2048

    def test_a_clock_set_back_does_not_break_the_bound(self):
        buffer = Buffer("x", limit=self.LIMIT)
        flight = Flight(buffer)
        flight.fly(100)
        flight.step = 0
        flight.fly(100)
        assert buffer.size <= self.LIMIT

    def test_what_no_fit_needs_is_not_kept(self):
        buffer = Buffer("x")
        vehicle = FakeVehicle()
        buffer.add(UNIX_US, vehicle.pack(mavlink.MAVLink_simstate_message(*(0,) * 11)))
        assert buffer.size == 0


class TestCoverage:
    def turned(self, throttle, attitudes):
        buffer, vehicle = Buffer("x"), FakeVehicle()
        hud = mavlink.MAVLink_vfr_hud_message(0, 0, 0, throttle, 0, 0)
        buffer.add(UNIX_US, vehicle.pack(hud))
        for roll, pitch, yaw in attitudes:
            message = mavlink.MAVLink_attitude_message(0, roll, pitch, yaw, 0, 0, 0)
            buffer.add(UNIX_US, vehicle.pack(message))
        return buffer.coverage()

    def test_nothing_is_covered_at_first(self):
        coverage = Buffer("x").coverage()
        assert coverage.counts.shape == (LEVELS, BANDS * SECTORS)
        assert not coverage.fraction.any()
        assert not coverage.share.any()

    def test_attitudes_count_at_the_throttle_they_were_at(self):
        coverage = self.turned(35, [(0, 0, 0)] * 7)
        assert coverage.share.argmax() == 3
        assert coverage.counts.sum() == coverage.counts[3].max() == 7

    @pytest.mark.parametrize(("throttle", "level"), [(0, 0), (9, 0), (10, 1), (99, 9), (100, 9)])
    def test_levels_are_tenths_of_full_throttle(self, throttle, level):
        assert self.turned(throttle, [(0, 0, 0)]).share[level] == 1.0

    def test_a_level_turn_covers_one_band_all_round(self):
        turn = [(0, 0, yaw) for yaw in np.linspace(0, math.tau, 360)]
        counts = self.turned(0, turn).counts[0].reshape(BANDS, SECTORS)
        assert (counts > 0).all(axis=1).sum() == 1
        assert (counts > 0).sum() == SECTORS

    def test_tumbling_covers_the_sphere(self):
        chance = np.random.default_rng(3)
        tumble = chance.uniform((-math.pi, -1.57, 0), (math.pi, 1.57, math.tau), (4000, 3))
        assert self.turned(50, tumble).fraction[5] > 0.95

    def test_cells_have_equal_area(self):
        points = np.random.default_rng(1).normal(size=(72_000, 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        counts = np.bincount([sphere_cell(*p) for p in points], minlength=BANDS * SECTORS)
        assert counts.min() > 850
        assert counts.max() < 1150

    @given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1))
    def test_every_vector_has_a_cell(self, x, y, z):
        assert 0 <= sphere_cell(x, y, z) < BANDS * SECTORS

    def test_attitudes_that_are_no_numbers_count_nowhere(self):
        assert self.turned(0, [(math.nan, 0, 0), (0, math.inf, 0)]).counts.sum() == 0

    def test_only_the_chosen_vehicle_counts(self):
        buffer = Buffer("x")
        ours, other = FakeVehicle(system=1), FakeVehicle(system=2)
        for index in range(40):
            buffer.add(UNIX_US + index * 100_000, ours.attitude(index * 0.1, yaw=0.0))
            buffer.add(UNIX_US + index * 100_000, other.attitude(index * 0.1, yaw=index * 0.1))
        assert buffer.coverage(1, 1).counts.sum() == buffer.coverage(1, 1).counts.max() == 40
        assert (buffer.coverage(2).counts > 0).sum() > 5
        assert buffer.coverage().counts.sum() == 80

    def test_many_senders_cost_no_memory_and_crowd_nobody_out(self):
        buffer = Buffer("x")
        for index in range(50):
            buffer.add(UNIX_US + index * 100_000, FakeVehicle().attitude(index * 0.1, yaw=0.0))
        for system in range(2, 200):
            buffer.add(UNIX_US, FakeVehicle(system=system).attitude(1.0, yaw=0.0))
        assert buffer.coverage(1).counts.sum() == 50
        assert len(buffer._counts) <= 32

    def test_a_coverage_does_not_change_with_the_buffer(self):
        buffer = filled(FIXTURES / "sweep_current.tlog")
        coverage = buffer.coverage()
        before = coverage.counts.copy()
        buffer.add(UNIX_US, FakeVehicle().attitude())
        np.testing.assert_array_equal(coverage.counts, before)
        with pytest.raises(ValueError, match="read-only"):
            coverage.counts[0, 0] = 1

    def test_thinning_does_not_change_what_was_covered(self):
        thinned, whole = filled(FIXTURE, limit=200_000), filled(FIXTURE)
        assert thinned.size < whole.size
        np.testing.assert_array_equal(thinned.coverage().counts, whole.coverage().counts)


def test_three_compasses_at_fifty_hertz_cost_a_tenth_of_a_core_at_most(tmp_path):
    vehicle, state, buffer = FakeVehicle(), LinkState(system=1), Buffer("x")
    imu, seconds = (1, 2, -1000, 3, 4, 5, 100, 200, 300), 20
    spent = 0.0
    with Recorder(tmp_path / "a.tlog") as recorder:
        for step in range(seconds * 50):
            now = step * 0.02
            stamp_us, boot_ms = UNIX_US + round(now * 1e6), round(now * 1e3)
            raw = vehicle.heartbeat() if step % 50 == 0 else b""
            raw += vehicle.attitude(now)
            raw += vehicle.pack(mavlink.MAVLink_raw_imu_message(boot_ms * 1000, *imu))
            raw += vehicle.pack(mavlink.MAVLink_scaled_imu2_message(boot_ms, *imu))
            raw += vehicle.pack(mavlink.MAVLink_scaled_imu3_message(boot_ms, *imu))
            began = time.process_time()
            for received in state.receive(raw, now):
                recorder.add(stamp_us, received.frame.raw)
                buffer.add(stamp_us, received.frame.raw)
            state.due(now)
            if step % 50 == 49:
                buffer.snapshot()
            spent += time.process_time() - began
    assert recorder.frames == seconds * 201
    assert len(buffer.snapshot().field[3]) == seconds * 50
    assert spent / seconds < 0.1
