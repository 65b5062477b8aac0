"""``magcomp demo``: the whole job, judged by the simulated truth that no fit has seen."""

from __future__ import annotations

import re

import pytest

from magcomp.cli.app import run


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_the_demo_leaves_the_heading_right_by_the_truth_and_in_flight(
    capsys, monkeypatch, autopilot
):
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["demo", "--seed", "6", "--speed", "30", "--autopilot", autopilot]) == 0
    out = capsys.readouterr().out
    assert re.search(r"\d+ parameters written while disarmed, each read back", out)
    truth = out[out.index("the truth ─") :]
    rows = re.findall(r"(\d+) A +([\d.]+)° +\S+ +([\d.]+)°", truth)
    assert [row[0] for row in rows] == ["0", "10", "20", "30", "40", "50"]
    before, after = (max(float(row[column]) for row in rows) for column in (1, 2))
    assert after < 0.4 < before
    flown = re.findall(r"compass (\d) +([\d.]+)° +\S+ +([\d.]+)°", out)
    assert [row[0] for row in flown] == ["1", "2", "3"]
    assert all(float(row[2]) < 0.5 * float(row[1]) for row in flown)
    assert all(len(line) <= 80 for line in out.splitlines())
