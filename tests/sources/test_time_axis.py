"""One time axis from three clocks: the vehicle's, the recorder's and the order of the records."""

from __future__ import annotations

import numpy as np
import pytest
from effort import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from tlog_writer import SECOND, START_US, Sender, log, record

from magcomp.errors import ChooseVehicleError
from magcomp.model import Recording, Series
from magcomp.sources.assemble import recording_from_bytes


def read(data: bytes) -> Recording:
    recording = recording_from_bytes(data, "test.tlog")
    for series in every_series(recording):
        assert (np.diff(series.time) >= 0).all()
        assert np.isfinite(series.time).all()
        assert len(series.time) == len(series.value)
    return recording


def every_series(recording: Recording) -> list[Series]:
    r = recording
    found = (r.attitude, r.gyro, r.accel, r.throttle, r.current, r.voltage, r.outputs, r.armed)
    return [series for series in (*found, r.position, *r.field.values()) if series is not None]


def attitude(recording: Recording) -> Series:
    assert recording.attitude is not None
    return recording.attitude


def test_stamped_messages_stand_where_the_vehicle_says() -> None:
    sender = Sender()
    frames = [sender.heartbeat(), *(sender.attitude(5000 + 100 * n) for n in range(50))]
    scattered = np.random.default_rng(1).integers(0, 900_000, len(frames)).cumsum()
    recording = read(log(frames, lambda n: int(scattered[n])))
    assert np.diff(attitude(recording).time) == pytest.approx(0.1)


def test_time_zero_is_the_first_used_message_and_the_end_is_the_last() -> None:
    sender = Sender()
    frames = [sender.attitude(7000), sender.attitude(9500), sender.heartbeat()]
    recording = read(log(frames, lambda n: n * 2_500_000))
    assert attitude(recording).time.tolist() == [0.0, 2.5]
    assert recording.duration_s == pytest.approx(5.0)
    assert recording.start_unix_s == START_US / SECOND


def test_a_message_without_a_time_is_put_between_its_neighbours_not_where_it_arrived() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    for n in range(20):
        # The throttle is sent between two messages of the same millisecond.
        frames += [
            sender.attitude(5000 + 500 * n),
            sender.throttle(n),
            sender.scaled_imu(5000 + 500 * n),
        ]
    # The radio spreads each burst over half a second and delivers a second late at the end.
    recording = read(log(frames, lambda n: n * 160_000 + (1_000_000 if n > 40 else 0)))
    assert recording.throttle is not None
    assert recording.throttle.time == pytest.approx(attitude(recording).time)


def test_a_burst_that_arrives_at_one_instant_is_spread_by_place() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    frames += [sender.attitude(5000), sender.throttle(1), sender.throttle(2), sender.attitude(5300)]
    recording = read(log(frames, lambda _: 0))
    assert recording.throttle is not None
    after = recording.throttle.time - attitude(recording).time[0]
    assert 0.05 < after[0] < 0.15 < after[1] < 0.25


def test_a_recording_written_faster_than_real_time_keeps_the_vehicles_pace() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    for n in range(100):
        frames += [sender.attitude(5000 + 100 * n), sender.throttle(n % 100)]
    recording = read(log(frames, lambda n: n * 50))
    assert np.diff(attitude(recording).time) == pytest.approx(0.1)
    assert recording.throttle is not None
    assert recording.throttle.time[-2] - recording.throttle.time[0] == pytest.approx(9.8, abs=0.05)


@pytest.mark.parametrize("jump_s", [-3600, 3600, 10_000_000])
def test_setting_the_recorders_clock_does_not_tear_the_series(jump_s: int) -> None:
    sender = Sender()
    frames = [sender.heartbeat(), *(sender.attitude(5000 + 100 * n) for n in range(100))]
    recording = read(log(frames, lambda n: n * 100_000 + (jump_s * SECOND if n > 50 else 0)))
    assert np.diff(attitude(recording).time) == pytest.approx(0.1)


def test_a_reboot_begins_a_new_stretch_after_the_gap_the_recorder_saw() -> None:
    sender = Sender()
    frames = [sender.attitude(60_000 + 100 * n, roll=0.0) for n in range(50)]
    frames += [sender.attitude(3_000 + 100 * n, roll=1.0) for n in range(50)]
    frames.append(sender.heartbeat())
    recording = read(log(frames, lambda n: n * 100_000 + (20 * SECOND if n >= 50 else 0)))
    series = attitude(recording)
    assert series.value[:, 0].tolist() == [0.0] * 50 + [1.0] * 50
    assert series.time[50] - series.time[49] == pytest.approx(20.1)
    assert np.delete(np.diff(series.time), 49) == pytest.approx(0.1)


def test_a_leap_of_the_vehicles_clock_takes_no_longer_than_the_recorder_waited() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    for n in range(60):
        ms = 60_000 + 100 * n + (3_600_000 if n >= 30 else 0)
        frames += [sender.attitude(ms), sender.raw_imu(ms * 1000)]
    recording = read(log(frames, lambda n: n * 50_000))
    assert np.diff(attitude(recording).time) == pytest.approx(0.1)
    assert recording.field[1].time == pytest.approx(attitude(recording).time, abs=0.1)


def test_two_vehicles_that_speak_with_one_number_are_named() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    for n in range(200):
        frames += [sender.attitude(5_000 + 100 * n), sender.attitude(82_000 + 100 * n)]
    with pytest.raises(ChooseVehicleError, match="two vehicles speak with the same one"):
        read(log(frames, lambda n: n * 50_000))


def test_an_hour_without_a_link_stays_an_hour() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    frames += [sender.attitude(100 * n + (3_600_000 if n >= 30 else 0)) for n in range(1, 60)]
    recording = read(log(frames, lambda n: n * 100_000 + (3600 * SECOND if n >= 30 else 0)))
    assert np.diff(attitude(recording).time).max() == pytest.approx(3600.1)


def test_frames_that_took_a_longer_way_are_no_reboot() -> None:
    sender = Sender()
    stamps = [5000 + 100 * n for n in range(100)]
    late = stamps[40:43]
    order = stamps[:40] + stamps[43:63] + late + stamps[63:]
    frames = [sender.heartbeat(), *(sender.attitude(t, roll=t / 1e6) for t in order)]
    series = attitude(read(log(frames, lambda n: n * 100_000)))
    assert np.diff(series.time) == pytest.approx(0.1)
    assert series.value[:, 0] == pytest.approx(np.array(stamps) / 1e6)


def test_microseconds_follow_their_vehicle_over_a_reboot() -> None:
    sender = Sender()
    frames = []
    for start, roll in ((60_000, 0.0), (3_000, 1.0)):
        for n in range(30):
            ms = start + 100 * n
            frames += [sender.attitude(ms, roll=roll), sender.raw_imu(ms * 1000 + 40_000)]
    frames.append(sender.heartbeat())
    recording = read(log(frames, lambda n: n * 50_000 + (9 * SECOND if n >= 60 else 0)))
    assert recording.field[1].time - attitude(recording).time == pytest.approx(0.04)


def test_wrapping_clocks_run_on() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    for n in range(40):
        ms = 2**32 - 2000 + 100 * n
        frames += [
            sender.attitude(ms % 2**32),
            sender.servos(ms * 1000 % 2**32, 1100 + n),
            sender.raw_imu(ms * 1000 % 2**32),
        ]
    recording = read(log(frames, lambda n: n * 33_333))
    assert recording.outputs is not None
    for series in (attitude(recording), recording.outputs, recording.field[1]):
        assert np.diff(series.time) == pytest.approx(0.1)


def test_microseconds_alone_are_a_clock_that_wraps_after_71_minutes() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    frames += [sender.raw_imu((2**32 - 2 * SECOND + 100_000 * n) % 2**32) for n in range(40)]
    recording = read(log(frames, lambda n: n * 90_000))
    assert np.diff(recording.field[1].time) == pytest.approx(0.1)


def test_microseconds_of_another_clock_are_not_believed() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    for n in range(100):
        frames += [sender.attitude(5000 + 100 * n), sender.raw_imu(START_US + 777 * n**3)]
    recording = read(log(frames, lambda n: n * 50_000))
    assert recording.field[1].time[:-1] - attitude(recording).time[:-1] == pytest.approx(0.05)


@pytest.mark.parametrize("stamp", [0, 1234])
def test_where_the_vehicles_clock_stands_still_the_recorders_is_used(stamp: int) -> None:
    sender = Sender()
    frames = [sender.heartbeat(), *(sender.attitude(stamp, roll=n / 100) for n in range(50))]
    recording = read(log(frames, lambda n: n * 200_000))
    assert attitude(recording).time == pytest.approx(0.2 * np.arange(1, 51))


def test_a_message_whose_clock_is_not_set_does_not_look_like_reboots() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    for n in range(50):
        frames += [sender.scaled_imu(5000 + 100 * n), sender.attitude(0)]
    recording = read(log(frames, lambda n: n * 70_000))
    assert np.diff(recording.field[2].time) == pytest.approx(0.1)
    assert recording.duration_s == pytest.approx(5.0, abs=0.1)


def test_a_time_beyond_all_clocks_is_not_believed() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    for n in range(50):
        frames += [sender.attitude(5000 + 100 * n), sender.raw_imu(2**64 - 1 - n)]
    recording = read(log(frames, lambda n: n * 50_000))
    assert recording.duration_s == pytest.approx(5.0, abs=0.1)
    assert np.diff(recording.field[1].time) == pytest.approx(0.1)


def test_the_recorders_clock_alone_stops_where_it_goes_back() -> None:
    sender = Sender()
    frames = [sender.heartbeat(), *(sender.throttle(n) for n in range(10))]
    arrival = [0, 1, 2, 3, 4, 2, 3, 4, 5, 6, 7]
    recording = read(log(frames, lambda n: arrival[n] * SECOND))
    assert recording.throttle is not None
    assert recording.throttle.value == pytest.approx(np.arange(10) / 100)
    assert recording.duration_s == pytest.approx(9.0)


def test_a_duplicated_block_is_dropped_and_counted() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    for n in range(300):
        frames += [sender.attitude(5000 + 100 * n), sender.throttle(n % 3)]
    records = [record(START_US + n * 50_000, f) for n, f in enumerate(frames)]
    once = read(b"".join(records))
    twice = read(b"".join(records[:200] + records[100:200] + records[200:]))
    assert (once.report.duplicates, twice.report.duplicates) == (0, 100)
    assert_same_numbers(twice, once)


def test_a_block_sent_again_under_a_new_recorders_time_is_dropped_with_what_lies_in_it() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    for n in range(100):
        frames += [sender.attitude(5000 + 100 * n), sender.throttle(n % 3)]
    once = read(log(frames, lambda n: n * 50_000))
    block = frames[51:101]
    again = read(log(frames[:101] + block + frames[101:], lambda n: n * 50_000))
    assert again.report.duplicates == len(block)
    assert again.throttle is not None
    assert once.throttle is not None
    assert len(again.throttle) == len(once.throttle)


def test_heartbeats_that_repeat_every_256_frames_are_no_duplicates() -> None:
    sender = Sender()
    frames = []
    for n in range(4):
        sender.link.seq = 0
        frames += [sender.heartbeat(), sender.attitude(5000 + 1000 * n)]
    recording = read(log(frames, lambda n: n * 500_000))
    assert recording.report.duplicates == 0
    assert recording.armed is not None
    assert len(recording.armed) == 4


def test_an_old_position_does_not_draw_its_neighbours_back() -> None:
    sender = Sender()
    frames = [sender.heartbeat()]
    for n in range(50):
        ms = 5000 + 500 * n
        frames += [
            sender.attitude(ms),
            sender.system_status(100),
            sender.position(ms - 200, 473977418, 85455939),
            sender.scaled_imu(ms),
        ]
    recording = read(log(frames, lambda n: n * 100_000))
    assert recording.current is not None
    assert recording.position is not None
    assert recording.current.time == pytest.approx(attitude(recording).time)
    assert recording.position.time == pytest.approx(attitude(recording).time - 0.2)


@settings(max_examples=examples(70), deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["attitude", "raw", "servos", "throttle", "heartbeat"]),
            st.integers(0, 2**32 - 1) | st.integers(0, 2**64 - 1),
            st.integers(-(2**40), 2**40),
        ),
        max_size=30,
    )
)
def test_whatever_the_clocks_say_the_series_are_in_order(
    events: list[tuple[str, int, int]],
) -> None:
    sender = Sender()
    send = {
        "attitude": lambda t: sender.attitude(t % 2**32),
        "raw": sender.raw_imu,
        "servos": lambda t: sender.servos(t % 2**32),
        "throttle": lambda t: sender.throttle(t % 101),
        "heartbeat": lambda _: sender.heartbeat(),
    }
    frames = [sender.heartbeat(), *(send[kind](stamp) for kind, stamp, _ in events)]
    recording = read(log(frames, lambda n: events[n - 1][2] if n else 0))
    assert recording.duration_s >= 0
    assert sum(len(s) for s in every_series(recording)) > 0


def assert_same_numbers(one: Recording, other: Recording) -> None:
    for a, b in zip(every_series(one), every_series(other), strict=True):
        np.testing.assert_array_equal(a.time, b.time)
        np.testing.assert_array_equal(a.value, b.value)
