"""The whole road by keys alone in a terminal of 80 by 24, as examples/whole_road.py drives it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROAD = Path(__file__).parents[2] / "examples" / "whole_road.py"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="there is no pty")
def test_from_connecting_to_what_was_promised_and_measured_by_keys_alone():
    driven = subprocess.run(
        [sys.executable, ROAD, "--speed", "6"], capture_output=True, text=True, check=False
    )
    assert driven.returncode == 0, driven.stderr
    measured = driven.stdout[driven.stdout.index("\nMeasured\n") :]
    kept = re.findall(r"promised at most ([\d.]+)°, measured ([\d.]+)° (.)", measured)
    assert len(kept) == 3
    assert all(float(found) <= float(most) and mark == "✓" for most, found, mark in kept)
    left = measured[measured.index("\nLeft, exit code 0\n") :]
    for name in ("Recording", "Parameters", "Backup"):
        assert name in left
    lines = [line for line in driven.stdout.splitlines() if line.startswith("│")]
    assert {len(line) for line in lines} == {82}
