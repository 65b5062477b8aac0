"""``magcomp info`` and the choices of batteries and attitudes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from logs_made_of_logs import FIXTURES

from magcomp.cli.app import run

FLIGHT = FIXTURES / "flight.BIN"


def test_a_log_is_told_to_programs(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["info", str(FLIGHT), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["format"] == "dataflash"
    assert [each["device_id"] for each in found["compasses"]] == [97539, 131874, 263178]
    assert all(each["rate_hz"] == pytest.approx(10, abs=0.1) for each in found["compasses"])
    by_name = {each["name"]: each for each in found["quantities"]}
    assert by_name["battery 0"]["high"] > 40
    assert by_name["attitude ATT"]["used"]
    assert not by_name["attitude AHR2"]["used"]
    assert found["can_be_fitted"]
    assert found["missing"] == []


def test_a_log_is_told_to_people_in_a_terminals_width(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for log in (FLIGHT, FIXTURES / "sweep_throttle_only.tlog"):
        assert run(["info", str(log)]) == 0
        out = capsys.readouterr().out.replace(str(log), "LOG")
        assert "magcomp fit LOG" in out
        assert max(map(len, out.splitlines())) <= 80
    assert "A better fit with a battery current" in out


def test_what_is_no_log_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x.BIN"
    path.write_bytes(b"\xa3\x95\x80")
    assert run(["info", str(path)]) == 2
    assert str(path) in capsys.readouterr().err


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        (["--battery", "3"], "instead it holds that of 0"),
        (["--attitude", "XKF1"], "instead it holds that of ATT, AHR2"),
    ],
)
@pytest.mark.parametrize("command", ["info", "fit", "check", "heading"])
def test_a_choice_that_is_not_there_is_refused_by_what_is(
    command: str, choice: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([command, str(FLIGHT), *choice]) == 2
    assert said in capsys.readouterr().err


def test_the_attitude_asked_for_is_the_one_used(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["info", str(FLIGHT), "--attitude", "AHR2", "--json"]) == 0
    by_name = {each["name"]: each for each in json.loads(capsys.readouterr().out)["quantities"]}
    assert by_name["attitude AHR2"]["used"]
    assert not by_name["attitude ATT"]["used"]
