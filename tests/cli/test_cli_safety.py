"""Commands that write: the right vehicle only, whoever else is on the link, and words to paste."""

from __future__ import annotations

import io
import shlex
import stat

import pytest
from live_vehicle import COMPENSATION, alive, held, landed

from magcomp.cli.app import run
from magcomp.cli.linking import LinkOptions
from magcomp.errors import ExitCode
from magcomp.model import ParameterSet
from magcomp.simulate import CAMERA, COMPUTER, GIMBAL, Habits
from magcomp.simulate.habits import own_number
from magcomp.writing.files import read_parameter_file, write_parameter_file
from magcomp.writing.journal import journal_path


@pytest.fixture(autouse=True)
def _data_directory(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))


@pytest.fixture(scope="module")
def upload(tmp_path_factory):
    """What the vehicle of seed 4 held, in a file that says whose it is; and what was said."""
    folder = tmp_path_factory.mktemp("with space")
    path, wanted = folder / "backup.param", folder / "wanted.param"
    write_parameter_file(wanted, ParameterSet(COMPENSATION))
    with alive(vehicle=landed(seed=4)) as flown, pytest.MonkeyPatch.context() as patch:
        said = io.StringIO()
        patch.setattr("sys.stderr", said)
        arguments = ["--yes", "--any-vehicle", "--backup", str(path)]
        assert run(["upload", str(wanted), flown.address, *arguments]) == ExitCode.GOOD
    return path, said.getvalue()


@pytest.fixture
def backup(upload):
    return upload[0]


def test_a_backup_belongs_to_one_flight_controller_and_its_twin_is_refused(backup, capsys):
    assert read_parameter_file(backup).vehicle.uid == own_number(4).hex()
    for name in (backup, journal_path(backup)):
        assert stat.S_IMODE(name.stat().st_mode) == 0o600
    twin = landed(seed=4, habits=Habits(uid=own_number(5)))
    before = held(twin)
    capsys.readouterr()
    with alive(vehicle=twin) as flown:
        assert run(["restore", str(backup), flown.address, "--yes"]) == ExitCode.LINK
    assert held(twin) == before
    said = capsys.readouterr().err
    assert own_number(4).hex() in said
    assert own_number(5).hex() in said


def test_the_command_that_undoes_stands_on_a_line_of_its_own_and_works(upload):
    backup, said = upload
    (line,) = [line for line in said.splitlines() if line.startswith("  magcomp restore")]
    words = shlex.split(line)
    assert words[:3] == ["magcomp", "restore", str(backup)]
    vehicle = landed(seed=4)
    with alive(vehicle=vehicle, port=int(words[3].rpartition(":")[2])):
        assert run([*words[1:], "--yes"]) == ExitCode.GOOD


def test_gimbal_camera_and_companion_are_never_the_vehicle(backup):
    vehicle = landed(seed=4, habits=Habits(companions=(GIMBAL, CAMERA, COMPUTER)))
    with alive(vehicle=vehicle) as flown:
        for choice in ([], ["--system", "1"]):
            code = run(["restore", str(backup), flown.address, "--yes", *choice])
            assert code == ExitCode.GOOD
    assert held(vehicle)["COMPASS_MOTCT"] == read_parameter_file(backup).values["COMPASS_MOTCT"]


@pytest.mark.slow
def test_a_vehicle_that_listens_to_one_ground_station_says_how_to_be_that_one(backup, capsys):
    strict = {"SYSID_ENFORCE": 1.0, "SYSID_MYGCS": 200.0}
    vehicle = landed(seed=4, parameters=strict)
    before = held(vehicle)
    with alive(vehicle=vehicle) as flown:
        assert run(["restore", str(backup), flown.address, "--yes"]) == ExitCode.TIMEOUT
        said = capsys.readouterr().err
        assert "SYSID_MYGCS: give that number with --source-system" in said
        assert held(vehicle) == before
        arguments = ["--yes", "--source-system", "200"]
        assert run(["restore", str(backup), flown.address, *arguments]) == ExitCode.GOOD


@pytest.mark.slow
@pytest.mark.parametrize("command", ["record", "calibrate"])
def test_a_vehicle_that_answers_nothing_is_not_told_to_enable_its_compass(
    command, tmp_path, capsys
):
    strict = {"SYSID_ENFORCE": 1.0, "SYSID_MYGCS": 200.0}
    file = ["-o" if command == "record" else "--record", str(tmp_path / "deaf.tlog")]
    with alive(vehicle=landed(seed=4, parameters=strict)) as flown:
        code = run([command, flown.address, "--system", "1", *file, "--seconds", "25"])
    said = capsys.readouterr().err
    assert code == (ExitCode.GOOD if command == "record" else ExitCode.TIMEOUT)
    assert said.count("give that number with --source-system") == 1 + (command == "calibrate")
    assert "COMPASS_ENABLE" not in said
    assert "no current sensor" not in said


def test_an_error_while_a_vehicle_is_written_says_what_the_vehicle_holds(
    backup, capsys, monkeypatch
):
    def fails(self, lasting, passing=""):
        if lasting == "writing":
            raise RuntimeError("the terminal is gone")

    monkeypatch.setattr("magcomp.cli.linking.StatusLine.show", fails)
    vehicle = landed(seed=4, parameters={"COMPASS_MOT_X": 3.0})
    before = held(vehicle)
    with alive(vehicle=vehicle) as flown:
        assert run(["restore", str(backup), flown.address, "--yes"]) == ExitCode.USAGE
    said = capsys.readouterr().err
    assert "the terminal is gone" in said
    assert "while the vehicle was written: the vehicle holds everything as before" in said
    assert held(vehicle) == before


def test_the_options_by_which_a_vehicle_is_reached_can_be_given_again(tmp_path):
    usual = LinkOptions(None, None, None, None, 10.0)
    assert usual.options == ()
    key = tmp_path / "my key"
    other = LinkOptions(3, 2, 57600, bytes(32), 5.0, 200, key)
    assert "key=" not in repr(other)  # what is logged of it never shows the key
    assert shlex.join(other.options) == (
        "--system 3 --component 2 --baud 57600 "
        f"--signing-key {shlex.quote(str(key))} --source-system 200"
    )


@pytest.mark.slow
def test_the_command_that_undoes_reaches_the_vehicle_as_it_was_reached(backup, capsys, tmp_path):
    """Pasted without its options it would get no answer."""
    key = tmp_path / "my key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    wanted = tmp_path / "wanted.param"
    write_parameter_file(wanted, ParameterSet(COMPENSATION))
    options = ["--system", "1", "--signing-key", str(key), "--source-system", "200"]
    strict = {"SYSID_ENFORCE": 1.0, "SYSID_MYGCS": 200.0}
    vehicle = landed(seed=4, parameters=strict, signing_key=key.read_bytes())
    before = held(vehicle)
    with alive(vehicle=vehicle) as flown:
        where = ["--backup", str(tmp_path / "b.param"), "--yes", "--any-vehicle"]
        assert run(["upload", str(wanted), flown.address, *where, *options]) == ExitCode.GOOD
        assert held(vehicle) != before
        said = capsys.readouterr().err.splitlines()
        (line,) = [line for line in said if line.startswith("  magcomp restore")]
        assert run([*shlex.split(line)[1:], "--yes"]) == ExitCode.GOOD
    assert held(vehicle) == before
