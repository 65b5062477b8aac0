"""A recording survives whatever happens to the program that makes it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from link_vehicle import UNIX_US, FakeVehicle, free_port, serving

from magcomp.errors import ExitCode, OutputError
from magcomp.link.address import TcpServer
from magcomp.link.clock import SystemClock
from magcomp.link.recorder import Recorder
from magcomp.link.replay import records
from magcomp.link.tcp import TcpTransport
from magcomp.sources import read_tlog


def test_what_is_added_is_a_tlog(tmp_path):
    vehicle, path = FakeVehicle(), tmp_path / "a.tlog"
    sent = [vehicle.tick(i) for i in range(3)]
    frames = [frame for _, frame in records(b"".join(UNIX_US.to_bytes(8) + s for s in sent))]
    with Recorder(path) as recorder:
        for index, frame in enumerate(frames):
            recorder.add(UNIX_US + index, frame)
    assert list(records(path.read_bytes())) == [
        (UNIX_US + index, frame) for index, frame in enumerate(frames)
    ]


def test_each_frame_is_on_its_way_to_the_disk_before_the_next_comes(tmp_path):
    vehicle, path = FakeVehicle(), tmp_path / "a.tlog"
    with Recorder(path) as recorder:
        for count in range(1, 20):
            recorder.add(UNIX_US, vehicle.heartbeat())
            assert len(list(records(path.read_bytes()))) == count


def test_a_file_that_is_there_is_not_overwritten(tmp_path):
    path = tmp_path / "a.tlog"
    path.write_bytes(b"precious")
    with pytest.raises(OutputError, match=r"already exists.*--force") as refusal:
        Recorder(path)
    assert str(path) in str(refusal.value)
    assert refusal.value.exit_code is ExitCode.USAGE
    assert path.read_bytes() == b"precious"


def test_a_file_that_is_there_is_replaced_by_force(tmp_path):
    path = tmp_path / "a.tlog"
    path.write_bytes(b"worthless")
    frame = FakeVehicle().heartbeat()
    with Recorder(path, force=True) as recorder:
        recorder.add(UNIX_US, frame)
    assert list(records(path.read_bytes())) == [(UNIX_US, frame)]
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_is_there_stays_until_something_comes(tmp_path):
    path = tmp_path / "a.tlog"
    path.write_bytes(b"precious")
    with Recorder(path, force=True):
        assert path.read_bytes() == b"precious"
    assert path.read_bytes() == b"precious"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_appears_meanwhile_is_not_overwritten(tmp_path):
    path = tmp_path / "a.tlog"
    with Recorder(path) as recorder:
        path.write_bytes(b"precious")
        with pytest.raises(OutputError, match="already exists"):
            recorder.add(UNIX_US, FakeVehicle().heartbeat())
    assert path.read_bytes() == b"precious"


def test_where_nothing_comes_no_file_is_left(tmp_path):
    Recorder(tmp_path / "a.tlog").close()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["no-such-directory/a.tlog", ""])
def test_a_place_where_no_file_can_be_is_named(tmp_path, name):
    with pytest.raises(OutputError, match="cannot be written") as refusal:
        Recorder(tmp_path / name, force=True)
    assert str(tmp_path) in str(refusal.value)


@pytest.mark.skipif(not os.access("/sys", os.F_OK), reason="needs Linux's read-only /sys")
def test_a_read_only_disk_is_named():
    with pytest.raises(OutputError, match=r"/sys/a\.tlog cannot be written"):
        Recorder(Path("/sys/a.tlog"))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux's /dev/full")
def test_a_full_disk_is_named():
    with (
        Recorder(Path("/dev/full"), force=True) as recorder,
        pytest.raises(OutputError, match=r"/dev/full cannot be written: No space left"),
    ):
        recorder.add(UNIX_US, FakeVehicle().heartbeat())


VICTIM = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from magcomp.link import Recorder, connect
recorder = Recorder(Path(sys.argv[1]))
with recorder, connect(sys.argv[3], system=1, sinks=[recorder]) as link:
    link.wait_vehicle(10)
    while True:
        message = link.receive(5)
        if message.get_type() == "ATTITUDE":
            print(message.time_boot_ms, flush=True)
"""


def test_a_killed_program_loses_no_frame_it_had_seen(tmp_path):
    path, port = tmp_path / "killed.tlog", free_port()
    server = TcpTransport(TcpServer("127.0.0.1", port), SystemClock())
    command = [sys.executable, "-c", VICTIM, str(path), str(Path(__file__).parent)]
    with (
        serving(FakeVehicle(), server, rate=200),
        subprocess.Popen([*command, f"tcp:127.0.0.1:{port}"], stdout=subprocess.PIPE) as victim,
    ):
        seen = [int(victim.stdout.readline()) for _ in range(300)]
        victim.send_signal(signal.SIGKILL)
        seen += [int(line) for line in victim.stdout if line.endswith(b"\n")]
    assert victim.returncode == -signal.SIGKILL
    recording = read_tlog(path)
    assert len(recording.attitude) >= len(seen)
    lasted = recording.attitude.time[-1] - recording.attitude.time[0]
    assert lasted >= (seen[-1] - seen[0]) * 1e-3 - 1e-6
