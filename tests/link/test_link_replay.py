"""A log played back gives the bytes it holds, at the pace they came."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_vehicle import UNIX_US, FakeVehicle

from magcomp.errors import ExitCode, LogError
from magcomp.link.address import Replay
from magcomp.link.opening import open_transport
from magcomp.link.replay import ReplayTransport, records
from magcomp.link.transport import ReplayEndedError

FIXTURE = Path(__file__).parents[2] / "sitl_fixtures" / "flight.tlog"


class StillClock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        return self.now

    def unix_us(self) -> int:
        return 0


def log_of(times_s):
    vehicle = FakeVehicle()
    return b"".join(
        (UNIX_US + round(time * 1e6)).to_bytes(8) + vehicle.heartbeat() for time in times_s
    )


def replay(path, clock, speed=1.0):
    return open_transport(Replay(path, speed), clock)


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "a.tlog"

    def write(times_s):
        path.write_bytes(log_of(times_s))
        return path

    return write


class TestPace:
    def test_a_frame_comes_when_its_time_has_come(self, log):
        clock = StillClock()
        transport = replay(log([0.0, 1.0, 1.5]), clock)
        assert transport.read(0.0) != b""
        assert transport.read(0.0) == b""
        clock.now = 0.999
        assert transport.read(0.0) == b""
        clock.now = 1.001
        assert transport.read(0.0) != b""
        assert transport.read(0.0) == b""
        clock.now = 1.501
        assert transport.read(0.0) != b""

    def test_ten_times_faster_is_ten_times_sooner(self, log):
        clock = StillClock()
        transport = replay(log([0.0, 1.0]), clock, speed=10.0)
        transport.read(0.0)
        clock.now = 0.099
        assert transport.read(0.0) == b""
        clock.now = 0.101
        assert transport.read(0.0) != b""

    def test_an_hours_pause_is_cut_to_seconds(self, log):
        clock = StillClock()
        transport = replay(log([0.0, 3600.0]), clock)
        transport.read(0.0)
        clock.now = 5.001
        assert transport.read(0.0) != b""

    def test_a_log_whose_clock_goes_back_goes_on(self, log):
        clock = StillClock()
        transport = replay(log([100.0, 0.0, 1.0]), clock)
        assert transport.read(0.0) != b""
        assert transport.read(0.0) != b""

    def test_its_clock_shows_the_logs_time(self, log):
        clock = StillClock()
        transport = replay(log([0.0, 1.0]), clock, speed=math.inf)
        transport.read(0.0)
        assert transport.clock.unix_us() == UNIX_US
        transport.read(0.0)
        assert transport.clock.unix_us() == UNIX_US + 1_000_000
        assert transport.clock.monotonic() == 1.0

    def test_waiting_ends_when_it_is_closed(self, log):
        transport = replay(log([0.0, 4.0]), StillClock())
        transport.read(0.0)
        transport.close()
        with pytest.raises(ReplayEndedError):
            transport.read(60.0)


class TestContent:
    def test_every_byte_of_every_frame_is_given(self):
        transport = ReplayTransport(Replay(FIXTURE, math.inf), StillClock())
        frames = [frame for _, frame in records(FIXTURE.read_bytes())]
        assert len(frames) > 20_000
        assert [transport.read(0.0) for _ in frames] == frames
        with pytest.raises(ReplayEndedError):
            transport.read(0.0)

    def test_a_log_takes_no_answer(self, log):
        transport = replay(log([0.0]), StillClock())
        transport.write(b"ignored")
        assert len(transport.read(0.0)) > len(b"ignored")

    @given(st.binary(max_size=100), st.integers(0, 60))
    def test_garbage_and_a_cut_end_cost_only_themselves(self, garbage, cut):
        good = log_of([0.0, 1.0, 2.0])
        found = [frame for _, frame in records(good + garbage)]
        whole = [frame for _, frame in records(good)]
        assert found[:3] == whole
        kept = [frame for _, frame in records(good[: len(good) - cut])]
        assert kept == whole[: len(kept)]
        assert len(kept) >= 3 - math.ceil(cut / 29)

    @pytest.mark.parametrize("content", [b"", b"not a log at all, but long enough to be read"])
    def test_a_file_without_frames_is_refused(self, tmp_path, content):
        path = tmp_path / "a.tlog"
        path.write_bytes(content)
        with pytest.raises(LogError, match=r"must be a \.tlog") as refusal:
            replay(path, StillClock())
        assert refusal.value.exit_code is ExitCode.USAGE

    def test_a_missing_file_is_named(self, tmp_path):
        with pytest.raises(LogError, match=r"gone\.tlog cannot be read"):
            replay(tmp_path / "gone.tlog", StillClock())
