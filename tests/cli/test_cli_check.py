"""``magcomp check``: what the calibration in force is worth; nothing is fitted."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from logs_made_of_logs import FIXTURES, FLIGHT, SWEEP, frames
from pymavlink.dialects.v20 import ardupilotmega as dialect

from magcomp.cli.app import run
from magcomp.model import Grade, HeadingError
from magcomp.report.plain import check_line


def test_a_flight_without_compensation_is_rejected(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", str(FLIGHT), "--json"]) == 1
    captured = capsys.readouterr()
    assert captured.err == ""
    found = json.loads(captured.out)
    assert [compass["compass"] for compass in found["compasses"]] == [1, 2, 3]
    for compass in found["compasses"]:
        assert compass["verdict"] == "rejected"
        assert compass["unit"] == "A"
        assert compass["heading_error_deg"]
        assert "parameters" not in compass


def test_a_flight_with_the_exact_compensation_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    log = FIXTURES / "mission_compensated.tlog"
    assert run(["check", str(log), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {compass["verdict"] for compass in found["compasses"]} <= {"good", "marginal"}


def test_the_text_says_the_verdict_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", str(FLIGHT), "--compass", "2"]) == 1
    out = capsys.readouterr().out
    assert "REJECTED  compass 2" in out
    assert "in force" in out
    assert max(map(len, out.replace(str(FLIGHT), "").splitlines())) <= 80


def test_a_compass_of_which_too_little_is_there_does_not_keep_the_others_from_being_judged(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    log = tmp_path / "one-falls-silent.tlog"
    few = itertools.count()
    kept = (
        each
        for each in frames(SWEEP)
        if each.message != dialect.MAVLINK_MSG_ID_SCALED_IMU2 or next(few) < 20
    )
    log.write_bytes(b"".join(each.packed() for each in kept))
    assert run(["check", str(log)]) == 1
    out = capsys.readouterr().out
    assert "REJECTED  compass 1" in out.replace("compasses 1 and 3", "compass 1")
    assert "Not judged: compass 2" in out
    assert run(["check", str(log), "--compass", "2"]) > 1
    assert "Compass 2 must have at least 60" in capsys.readouterr().err


def test_the_first_line_tells_the_estimate_from_the_bound() -> None:
    rows = (HeadingError(20.0, 0.4, 0.4, 1.8), HeadingError(30.0, 0.3, 0.3, 2.6))
    good = SimpleNamespace(grade=Grade.GOOD, heading_error=rows)
    assert check_line({1: good}, "current") == (
        "Your compass is right: wrong by 0.4° at 20 A, at most by 1.8°. Leave it as it is."
    )
