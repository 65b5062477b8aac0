"""``magcomp check``: what the calibration in force is worth; nothing is fitted."""

from __future__ import annotations

import itertools
import json
import re
from pathlib import Path
from typing import Any

import pytest
from logs_made_of_logs import FIXTURES, FLIGHT, SWEEP, frames
from pymavlink.dialects.v20 import ardupilotmega as dialect
from synthetic import Flown

from magcomp.cli.app import run
from magcomp.model import Coverage, FieldResidual, Grade, HeadingError, Verdict
from magcomp.report import as_json
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


def checked(grade: Grade, *errors: tuple[float, float, float], hover: float) -> dict[str, Any]:
    """The document of a check: load, error in force, at most."""
    rows = tuple(HeadingError(u, before, before, p95) for u, before, p95 in errors)
    covered = Coverage(0.3, 1.0, 20.0, 10.0, 40.0, 90.0, u_median=hover)
    verdict = Verdict(grade, ("why",), rows, FieldResidual(9.0, 9.0, 9.0, 9.0), covered)
    return as_json.check_object(Flown().recording(), {1: verdict}, "current")


def test_the_first_line_tells_the_estimate_from_the_bound() -> None:
    document = checked(Grade.GOOD, (20.0, 0.4, 1.8), (30.0, 0.2, 2.6), hover=25.0)
    assert check_line(document) == (
        "Your compass is right: at 25 A, the usual load, wrong by 0.3°, at most by 2.2°. "
        "Leave it as it is."
    )


def test_what_is_wrong_is_told_of_the_load_in_use_half_of_the_time() -> None:
    document = checked(Grade.REJECTED, (10.0, 4.0, 5.0), (40.0, 16.0, 18.0), hover=25.0)
    assert check_line(document).startswith("At 25 A, the usual load, your compass is up to 10°")
    assert document["compasses"][0]["quoted"] == {
        "u": 25.0,
        "in_force": 10.0,
        "p95": 11.5,
        "hover": True,
    }


def test_where_the_usual_load_shows_nothing_the_worst_says_why_it_is_rejected() -> None:
    document = checked(Grade.REJECTED, (10.0, 0.1, 1.0), (40.0, 9.0, 10.0), hover=10.0)
    assert check_line(document).startswith("At 40 A your compass is up to 9.0° wrong.")


def test_the_row_that_is_quoted_stands_in_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    run(["check", str(FLIGHT), "--compass", "1"])
    first, table = capsys.readouterr().out.split("heading error")
    said = r"At (\d+ A), the usual load, your compass is up to ([\d.]+)° wrong"
    load, wrong = re.findall(said, " ".join(first.split()))[0]
    shown = dict(re.findall(r"(\d+ A) +([\d.]+)°", table))
    assert round(float(shown[load])) == round(float(wrong))
