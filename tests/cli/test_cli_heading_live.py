"""``magcomp heading ADDRESS``: a live vehicle's headings against the simulator's truth."""

import json
import signal
import subprocess
import sys
from bisect import bisect_left

import numpy as np
import pytest
from json_schema import must_be
from live_vehicle import alive, free_port
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.cli.app import run
from magcomp.errors import ExitCode
from magcomp.geometry import wrap_angle
from magcomp.live.session import LiveSession
from magcomp.model import ParameterSet
from magcomp.simulate import Vehicle, scenario
from magcomp.writing.files import write_parameter_file


class Watched:
    """A vehicle whose true yaw is noted with every attitude it sends."""

    def __init__(self, vehicle):
        self.vehicle = vehicle
        self.codec = mavlink.MAVLink(None)
        self.time, self.yaw = [], []

    def receive(self, frame, time):
        self.vehicle.receive(frame, time)

    def advance(self, time):
        sent = self.vehicle.advance(time)
        for frame in sent:
            message = self.codec.decode(bytearray(frame.data))
            if message.get_type() == "ATTITUDE":
                self.time.append(message.time_boot_ms * 1e-3)
                self.yaw.append(message.yaw - self.vehicle.heading_error)
        return sent

    def error_deg(self, rows, name):
        """Of a heading at each row that has one, degrees."""
        known = [row for row in rows if row[name] is not None]
        yaw = [self.yaw[min(bisect_left(self.time, r["time_s"]), len(self.yaw) - 1)] for r in known]
        return np.abs(np.degrees(wrap_angle(np.radians([r[name] for r in known]) - yaw)))


@pytest.mark.slow
def test_a_live_vehicle_s_fused_heading_is_its_true_one(tmp_path, capsys, monkeypatch):
    vehicle = Vehicle(scenario("flight", 4), wait_for_ground=True)
    # However slow the computer is, thirty seconds are the vehicle's.
    monkeypatch.setattr(LiveSession, "elapsed_s", property(lambda _: vehicle.time))
    exact = tmp_path / "exact.param"
    cured = Vehicle(scenario("flight", 4, compensation="exact")).parameters
    kinds = ("_MOT", "_OFS", "_DIA", "_ODI")
    values = {n: v for n, v in cured.items() if n.startswith("COMPASS") and n[7:11] in kinds}
    write_parameter_file(exact, ParameterSet(values))
    watched = Watched(vehicle)
    with alive(vehicle=vehicle, wrap=lambda _: watched) as flown:
        arguments = (flown.address, "--parameters", str(exact), "--seconds", "30", "--json")
        assert run(["heading", *arguments]) == ExitCode.GOOD
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    for row in rows:
        must_be("heading_now", row)
    seconds = [int(row["time_s"]) for row in rows]
    assert len(seconds) == len(set(seconds)) > 10
    raw, fused = watched.error_deg(rows, "raw_deg"), watched.error_deg(rows, "fused_deg")
    assert len(fused) > 10
    assert fused.max() < 3.0
    assert np.sqrt(np.mean(fused**2)) < 0.2 * np.sqrt(np.mean(raw**2))


def test_ctrl_c_ends_it_after_whole_lines():
    with alive() as flown:
        command = (sys.executable, "-m", "magcomp", "heading", flown.address)
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            header = process.stdout.readline()
            first = process.stdout.readline()
            process.send_signal(signal.SIGINT)
            rest = process.stdout.read()
        assert process.returncode == ExitCode.INTERRUPTED
    assert header.split() == ["time,", "s", "raw", "corrected", "fused"]
    assert all(len(line.split()) == 4 for line in (first, *rest.splitlines()))


def test_a_vehicle_that_is_not_there_is_waited_for_no_longer_than_asked(capsys):
    address = f"udp:127.0.0.1:{free_port()}"
    assert run(["heading", address, "--timeout", "0.2"]) == ExitCode.TIMEOUT
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("option", [("--plot",), ("--start", "3"), ("--end", "3")])
def test_what_only_a_log_can_give_is_refused(option, capsys):
    assert run(["heading", "udp:127.0.0.1:14550", *option]) == ExitCode.USAGE
    assert "must come with a log" in capsys.readouterr().err
