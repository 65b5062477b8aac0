"""The live commands as a user types them: what they print, leave behind, and end with."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from functools import partial

import pytest
from live_vehicle import COMPENSATION, PATIENCE_S, RATES, alive, free_port, held, landed
from logs_made_of_logs import SWEEP

from magcomp.cli.app import run
from magcomp.errors import ExitCode
from magcomp.live.session import LiveSession
from magcomp.model import ParameterSet
from magcomp.sources.tlog import read_tlog
from magcomp.writing.files import read_parameter_file, write_parameter_file

MAGCOMP = (sys.executable, "-m", "magcomp")


@pytest.fixture(autouse=True)
def data_directory(tmp_path, monkeypatch):
    """Backups and recordings of these tests go nowhere else."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return tmp_path / "data" / "magcomp"


@pytest.fixture
def wanted(tmp_path):
    path = tmp_path / "wanted.param"
    write_parameter_file(path, ParameterSet(COMPENSATION))
    return path


def magcomp(*arguments):
    return run([str(argument) for argument in arguments])


def wait_until(condition):
    for _ in range(int(PATIENCE_S / 0.05)):
        if condition():
            return
        threading.Event().wait(0.05)
    raise AssertionError("never came")


# ---------------------------------------------------------------- upload and restore


def test_upload_shows_the_difference_writes_it_and_says_how_to_undo_it(
    wanted, data_directory, capsys
):
    with alive(vehicle=landed()) as flown:
        old = held(flown.vehicle)
        options = ("--yes", "--any-vehicle", "--system", 1)
        assert magcomp("upload", wanted, flown.address, *options) == ExitCode.GOOD
        assert held(flown.vehicle) == COMPENSATION
        out, err = capsys.readouterr()
        assert "COMPASS_MOTCT" in out
        assert "0 → 2" in out
        assert "Written and read back: 37 parameters" in err
        assert "The vehicle holds: motor compensation by current for compasses 1, 2 and 3." in err
        (backup,) = data_directory.glob("backup-ardupilot-1-*.param")
        assert f"magcomp restore {backup} {flown.address}" in err
        assert magcomp("restore", backup, flown.address, "--yes", "--system", 1) == ExitCode.GOOD
        assert held(flown.vehicle) == old
        out, err = capsys.readouterr()
        assert "2 → 0" in out
        assert "the vehicle held everything that was written" in err
        assert "The vehicle holds: motor compensation off." in err
        assert magcomp("restore", backup, flown.address, "--yes", "--system", 1) == ExitCode.GOOD
        assert "nothing is written" in capsys.readouterr().err


def test_a_dry_run_shows_and_writes_nothing(wanted, data_directory, capsys):
    with alive(vehicle=landed()) as flown:
        old = held(flown.vehicle)
        code = magcomp("upload", wanted, flown.address, "--dry-run", "--any-vehicle")
        assert code == ExitCode.GOOD
        assert held(flown.vehicle) == old
    assert "0 → 2" in capsys.readouterr().out
    assert not data_directory.exists()


def test_without_a_terminal_yes_is_needed(wanted, capsys):
    assert magcomp("upload", wanted, "udp:127.0.0.1:1") == ExitCode.USAGE
    assert "--yes" in capsys.readouterr().err


def test_an_armed_vehicle_is_refused(wanted, capsys):
    with alive("flight", speed=5.0, wait_for_ground=False) as flown:
        wait_until(lambda: flown.vehicle.armed)
        old = held(flown.vehicle)
        code = magcomp("upload", wanted, flown.address, "--yes", "--any-vehicle", "--system", 1)
        assert code == ExitCode.LINK
        assert held(flown.vehicle) == old
    assert "must be disarmed" in capsys.readouterr().err


def test_another_vehicle_is_refused_and_unknown_parameters_are_named(tmp_path, capsys):
    theirs, unknown = tmp_path / "theirs.param", tmp_path / "unknown.param"
    write_parameter_file(theirs, ParameterSet({**COMPENSATION, "COMPASS_DEV_ID": 7.0}))
    write_parameter_file(unknown, ParameterSet({"CAL_MAG0_XOFF": 1.0}))
    with alive(vehicle=landed()) as flown:
        common = (flown.address, "--yes", "--system", 1)
        assert magcomp("upload", theirs, *common) == ExitCode.LINK
        assert "with compasses 97539, 131874, 263178" in capsys.readouterr().err
        assert magcomp("upload", unknown, *common, "--any-vehicle") == ExitCode.WRITE
        assert "CAL_MAG0_XOFF" in capsys.readouterr().err


@pytest.mark.slow
def test_of_a_full_file_the_calibration_is_written_and_on_request_the_rest(tmp_path, capsys):
    full = tmp_path / "full.param"
    with alive(vehicle=landed()) as flown:
        rest = {"COMPASS_PRIMARY": 0.0, "BATT_MONITOR": 3.0, "COMPASS_DEV_ID": 97539.0}
        before = flown.vehicle.parameters["BATT_MONITOR"]
        write_parameter_file(full, ParameterSet({**COMPENSATION, **rest}))
        common = (full, flown.address, "--yes", "--any-vehicle", "--system", 1)
        assert magcomp("upload", *common) == ExitCode.GOOD
        assert "--all writes the rest too" in capsys.readouterr().err
        assert held(flown.vehicle) == COMPENSATION
        assert flown.vehicle.parameters["BATT_MONITOR"] == before
        backup = tmp_path / "b.param"
        assert magcomp("upload", *common, "--all", "--backup", backup) == ExitCode.GOOD
        assert "COMPASS_PRIMARY, COMPASS_DEV_ID are unknown" in capsys.readouterr().err
        assert flown.vehicle.parameters["BATT_MONITOR"] == 3.0
        assert magcomp("restore", backup, flown.address, "--yes", "--system", 1) == ExitCode.GOOD
        assert flown.vehicle.parameters["BATT_MONITOR"] == before


def test_a_backup_that_cannot_be_made_leaves_the_vehicle_untouched(wanted, tmp_path, capsys):
    with alive(vehicle=landed()) as flown:
        old = held(flown.vehicle)
        backup = tmp_path / "missing" / "backup.param"
        code = magcomp(
            "upload", wanted, flown.address, "--yes", "--any-vehicle", "--backup", backup
        )
        assert code == ExitCode.USAGE
        assert held(flown.vehicle) == old
    assert "missing" in capsys.readouterr().err


# ---------------------------------------------------------------- addresses and links


@pytest.mark.parametrize(
    ("address", "code", "says"),
    [
        ("nonsense", ExitCode.USAGE, "must look like"),
        ("udp:127.0.0.1:99999", ExitCode.USAGE, "65535"),
        ("tcp:127.0.0.1:1", ExitCode.LINK, "127.0.0.1:1"),
        ("/dev/ttyNOWHERE", ExitCode.LINK, "/dev/ttyNOWHERE"),
    ],
)
@pytest.mark.parametrize("command", ["calibrate", "record", "upload"])
def test_a_wrong_address_is_one_clear_sentence(
    command, address, code, says, wanted, tmp_path, capsys
):
    arguments = {
        "calibrate": ("calibrate", address),
        "record": ("record", address, "-o", tmp_path / "a.tlog"),
        "upload": ("upload", wanted, address, "--yes"),
    }[command]
    assert magcomp(*arguments) == code
    err = capsys.readouterr().err
    assert says in err
    assert "Traceback" not in err
    assert not list(tmp_path.rglob("*.tlog"))


def test_a_port_in_use_is_named(tmp_path, capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"udp:127.0.0.1:{taken.getsockname()[1]}"
        assert magcomp("record", address, "-o", tmp_path / "a.tlog") == ExitCode.LINK
    assert "in use" in capsys.readouterr().err


def test_no_heartbeat_says_what_arrived_instead(tmp_path, capsys):
    port, stop = free_port(), threading.Event()

    def babble():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            while not stop.wait(0.02):
                sender.sendto(b"GET / HTTP/1.1\r\n\r\n", ("127.0.0.1", port))

    thread = threading.Thread(target=babble)
    thread.start()
    try:
        path = tmp_path / "a.tlog"
        code = magcomp("record", f"udp:127.0.0.1:{port}", "-o", path, "--timeout", 0.5)
    finally:
        stop.set()
        thread.join()
    assert code == ExitCode.TIMEOUT
    assert "bytes arrived but no MAVLink frames" in capsys.readouterr().err


def test_a_read_only_directory_is_said_before_anything_is_opened(tmp_path, capsys):
    locked = tmp_path / "locked"
    locked.mkdir()
    locked.chmod(0o500)
    if os.access(locked, os.W_OK):
        pytest.skip("this user may write everywhere")
    assert magcomp("record", "udp:127.0.0.1:1", "-o", locked / "a.tlog") == ExitCode.USAGE
    assert "read-only" in capsys.readouterr().err


# ---------------------------------------------------------------- record


def test_record_leaves_a_log_that_can_be_read(tmp_path, capsys):
    path = tmp_path / "a.tlog"
    with alive("sweep") as flown:
        code = magcomp("record", flown.address, "-o", path, "--seconds", 2, "--system", 1)
    assert code == ExitCode.GOOD
    assert len(read_tlog(path).field) == 3
    assert str(path) in capsys.readouterr().out
    assert magcomp("record", "udp:127.0.0.1:1", "-o", path) == ExitCode.USAGE
    assert "--force" in capsys.readouterr().err


# ---------------------------------------------------------------- calibrate


def test_calibrate_guides_ends_when_the_pilot_disarms_fits_and_writes(
    tmp_path, data_directory, capsys, monkeypatch
):
    # Without refits there is never enough: it is the pilot who ends it, on any computer.
    unfitted = partial(LiveSession.open, rates=RATES, refit_share=0.0)
    monkeypatch.setattr(LiveSession, "open", unfitted)
    answer, log = tmp_path / "a.param", tmp_path / "a.tlog"
    with alive("sweep", speed=20.0) as flown:
        options = ("-o", answer, "--record", log, "--system", 1, "--regressor", "current")
        options = (*options, "--upload", "--yes")
        assert magcomp("calibrate", flown.address, *options) == ExitCode.GOOD
        found = read_parameter_file(answer).values
        assert all(flown.vehicle.parameters[name] == value for name, value in found.items())
        truth = flown.vehicle.truth.interference
    assert [-found[f"COMPASS_MOT_{axis}"] for axis in "XYZ"] == pytest.approx(truth, abs=0.03)
    out, err = capsys.readouterr()
    assert "the vehicle is disarmed" in err
    assert "0 → 2" in out
    assert "Written and read back" in err
    assert magcomp("fit", log, "--compass", 1) == ExitCode.GOOD


def test_calibrate_prints_the_object_of_fit_and_nothing_else(tmp_path, capsys):
    log = tmp_path / "a.tlog"
    assert magcomp("calibrate", f"{SWEEP},100x", "--record", log, "--json") == ExitCode.GOOD
    live = json.loads(capsys.readouterr().out)
    assert magcomp("fit", log, "--json") == ExitCode.GOOD
    assert json.loads(capsys.readouterr().out) == live


def test_too_short_a_recording_is_said_and_kept(tmp_path, capsys):
    log = tmp_path / "a.tlog"
    with alive("flight", speed=1.0) as flown:
        options = ("--record", log, "--system", 1, "--seconds", 1)
        assert magcomp("calibrate", flown.address, *options) in (ExitCode.USAGE, ExitCode.REJECTED)
    assert log.stat().st_size > 0
    assert str(log) in capsys.readouterr().err


def test_a_log_is_calibrated_as_if_it_were_flown_now(tmp_path, capsys):
    address = f"{SWEEP},100x"
    options = ("--record", tmp_path / "b.tlog", "--regressor", "current")
    assert magcomp("calibrate", address, *options) == ExitCode.GOOD
    assert "COMPASS_MOT" in capsys.readouterr().out
    code = magcomp("calibrate", address, "--record", tmp_path / "c.tlog", "--upload", "--yes")
    assert code == ExitCode.USAGE


def test_ctrl_c_keeps_what_was_recorded_and_goes_on_to_the_fit(tmp_path):
    log = tmp_path / "a.tlog"
    with alive("sweep", speed=16.0) as flown:
        # For a flight this is never enough, so that it goes on until it is interrupted.
        options = ("--system", "1", "--record", str(log), "--manoeuvre", "flight", "--json")
        child = subprocess.Popen(
            [*MAGCOMP, "calibrate", flown.address, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        wait_until(lambda: flown.vehicle.armed)
        half_way = flown.vehicle.time + 45.0
        wait_until(lambda: flown.vehicle.time > half_way)
        child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=PATIENCE_S)
    assert child.returncode == ExitCode.GOOD, err
    assert b"Interrupted" in err
    assert json.loads(out)["compasses"]
    assert read_tlog(log).duration_s > 20.0


# ---------------------------------------------------------------- simulate


def test_a_simulated_vehicle_says_where_it_is_and_writes_its_truth(tmp_path):
    truth, port = tmp_path / "truth.json", free_port()
    options = ("--seed", "3", "--program", "sweep", "--speed", "8", "--truth", str(truth))
    child = subprocess.Popen(
        [*MAGCOMP, "simulate", f"udp:127.0.0.1:{port}", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    try:
        address = child.stdout.readline().decode().strip()
        assert address == f"udpout:127.0.0.1:{port}"
        log = tmp_path / "a.tlog"
        assert magcomp("record", address, "-o", log, "--seconds", 3) == ExitCode.GOOD
        assert json.loads(truth.read_text())["seed"] == 3
    finally:
        child.send_signal(signal.SIGINT)
        child.stdout.close()
        assert child.wait(PATIENCE_S) == ExitCode.GOOD


@pytest.mark.parametrize(
    "options",
    [("--speed", "0"), ("--loss", "2"), ("--program", "dance"), ("--truth", "/nowhere/t.json")],
)
def test_impossible_vehicles_are_refused(options, capsys):
    assert magcomp("simulate", f"udp:127.0.0.1:{free_port()}", *options) == ExitCode.USAGE
    assert "Traceback" not in capsys.readouterr().err


def test_what_a_short_address_means_is_said(tmp_path, capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        short = f":{taken.getsockname()[1]}"
        assert magcomp("record", short, "-o", tmp_path / "a.tlog") == ExitCode.LINK
        said = capsys.readouterr().err
        assert f"{short} means udp:127.0.0.1{short}: listen for UDP from this computer only" in said
        assert magcomp("record", f"udp:127.0.0.1{short}", "-o", tmp_path / "a.tlog")
        assert "means" not in capsys.readouterr().err
