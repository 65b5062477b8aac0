"""Every kind of bad input gets one clear sentence on stderr and exit code 2; nothing is written."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from logs_made_of_logs import (
    ATTITUDE,
    COMPASSES,
    CURRENT,
    PARAMETERS,
    SWEEP,
    THROTTLE,
    frames,
    of_autopilot,
    with_nan,
    with_second_vehicle,
    without,
)
from pymavlink.dialects.v20 import ardupilotmega as dialect

from magcomp.cli.app import run
from magcomp.cli.places import where_logs_are
from magcomp.sources import read

SINGLE = ("--compass", "1", "--regressor", "current")
"""The least work a fit can be."""


def absent(path: Path) -> None:
    path.unlink(missing_ok=True)


def directory(path: Path) -> None:
    path.mkdir()


def empty(path: Path) -> None:
    path.write_bytes(b"")


def text(path: Path) -> None:
    path.write_text("time,roll\n1,2\n" * 100)


def random(path: Path) -> None:
    path.write_bytes(np.random.default_rng(3).bytes(300_000))


def first_bytes(path: Path) -> None:
    path.write_bytes(b"\xfd" * 100_000_000)


def no_compass(path: Path) -> None:
    without(path, COMPASSES)


def no_motors(path: Path) -> None:
    without(path, CURRENT | THROTTLE)


def no_attitude(path: Path) -> None:
    without(path, ATTITUDE)


def nan_parameters(path: Path) -> None:
    with_nan(path, "COMPASS_OFS_X", "COMPASS_OFS2_X", "COMPASS_OFS3_X")


def two_vehicles(path: Path) -> None:
    with_second_vehicle(path, 7)


def px4(path: Path) -> None:
    of_autopilot(path, dialect.MAV_AUTOPILOT_PX4)


BAD: list[tuple[Callable[[Path], None], str]] = [
    (absent, "no such file"),
    (directory, "directory"),
    (empty, "empty"),
    (text, "text"),
    (random, "without one sound frame"),
    (first_bytes, "without one sound frame"),
    (no_compass, "compass"),
    (no_motors, "neither"),
    (no_attitude, "attitude"),
    (nan_parameters, "COMPASS_OFS_X must be a finite number"),
    (two_vehicles, "--system"),
    (px4, "must tell the vehicle's CAL_MAG_COMP_TYP"),
]


NO_LOG = {absent, directory, empty, text, random, first_bytes}
"""After these it is said where logs are."""


@pytest.mark.parametrize("command", ["fit", "check"])
@pytest.mark.parametrize(("make", "why"), BAD, ids=[make.__name__ for make, _ in BAD])
def test_bad_input_gets_one_sentence(
    command: str,
    make: Callable[[Path], None],
    why: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = tmp_path / "bad.tlog"
    make(log)
    code = run([command, str(log), "--json"])
    captured = capsys.readouterr()
    assert code == 2
    assert captured.out == ""
    assert captured.err.startswith("magcomp: ")
    assert captured.err.endswith((".\n", "?\n"))
    assert captured.err.count("\n") == (2 if make in NO_LOG else 1)
    assert (where_logs_are() in captured.err) == (make in NO_LOG)
    assert why in captured.err


def test_a_compass_with_a_parameter_of_nan_does_not_block_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "nan.tlog"
    with_nan(log, "COMPASS_OFS2_Y")
    assert run(["fit", str(log), "--json", "--regressor", "current"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [compass["compass"] for compass in found["compasses"]] == [1, 3]
    assert any("COMPASS_OFS2_Y must be a finite number" in note for note in found["notes"])
    assert run(["fit", str(log), "--compass", "2"]) == 2
    assert "COMPASS_OFS2_Y must be a finite number" in capsys.readouterr().err


def test_nothing_is_overwritten_by_bad_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, parameters = tmp_path / "bad.tlog", tmp_path / "compass.param"
    log.write_bytes(b"nothing")
    parameters.write_text("mine")
    assert run(["fit", str(log), "-o", str(parameters), "--force"]) == 2
    capsys.readouterr()
    assert parameters.read_text() == "mine"
    assert {path.name for path in tmp_path.iterdir()} == {"bad.tlog", "compass.param"}


def test_a_log_cut_at_any_byte_of_its_last_two_frames_is_fitted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sound = [frame.packed() for frame in frames(SWEEP)]
    # Short frames are cut in the same places as long ones, and there are fewer places.
    late = range(len(sound) * 9 // 10, len(sound))
    end = min(late, key=lambda n: len(sound[n - 1]) + len(sound[n]))
    data = b"".join(sound[: end + 1])
    log = tmp_path / "cut.tlog"
    first = len(data) - len(sound[end - 1]) - len(sound[end])
    whole = first + len(sound[end - 1])
    for size in range(first, len(data)):
        log.write_bytes(data[:size])
        recording = read(log)
        assert recording.report.frames == end - (size < whole)
        if (size - first) % 18:
            continue
        assert run(["fit", str(log), "--json", *SINGLE]) == 0, size
        captured = capsys.readouterr()
        assert captured.err == ""
        assert json.loads(captured.out)["verdict"] == "marginal"


def test_two_vehicles_are_fitted_one_at_a_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = with_second_vehicle(tmp_path / "two.tlog", 7)
    assert run(["fit", str(log), "--json", "--system", "7", *SINGLE]) == 0
    assert json.loads(capsys.readouterr().out)["vehicle"]["system"] == 7
    assert run(["fit", str(log), "--json", "--system", "9", *SINGLE]) == 2
    assert "1, 7" in capsys.readouterr().err


def test_a_log_without_parameters_is_no_ground_to_write_anything(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = without(tmp_path / "bare.tlog", PARAMETERS)
    assert run(["fit", str(log), "--json", *SINGLE]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["compasses"][0]["parameters"] == {}
    assert "COMPASS_DIA_X" in found["compasses"][0]["reasons"][0]
    assert any("no parameters" in note for note in found["notes"])


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ((), "command"),
        (("frobnicate",), "frobnicate"),
        (("chek", "x.tlog"), "Did you mean 'check'? Try 'magcomp --help'."),
        (("fit",), "LOG"),
        (("fit", "x.tlog", "--frobnicate"), "--frobnicate"),
        (("fit", "x.tlog", "--strat", "5"), "Did you mean '--start'?"),
        (("fit", "x.tlog", "--compass", "5"), "5"),
        (("fit", "x.tlog", "--method", "magic"), "magic"),
        (("fit", "x.tlog", "--start", "soon"), "soon"),
        (("fit", "x.tlog", "--start", "5", "--end", "5"), "5.0"),
        (("fit", "x.tlog", "--start", "nan"), "nan"),
    ],
)
def test_a_command_that_cannot_be_gets_one_sentence(
    arguments: tuple[str, ...], why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(list(arguments)) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("magcomp: ")
    assert captured.err.count("\n") == 1
    assert why in captured.err
