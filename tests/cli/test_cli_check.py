"""``magcomp check``: what the calibration in force is worth; nothing is fitted."""

from __future__ import annotations

import json

import pytest
from logs_made_of_logs import FIXTURES, FLIGHT

from magcomp.cli.app import run


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
