"""The examples run as they stand."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from logs_made_of_logs import SWEEP

ROOT = Path(__file__).parents[2]
SHELL = shutil.which("sh")


def test_a_log_is_fitted_from_python() -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "examples" / "fit_a_log.py", SWEEP],
        capture_output=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"compass 3: marginal" in done.stdout
    assert b"COMPASS_MOTCT 2" in done.stdout


def many_logs(tmp_path: Path, *logs: Path | str) -> tuple[int, list[str], list[str]]:
    magcomp = tmp_path / "magcomp"
    if not magcomp.exists():
        magcomp.symlink_to(Path(sys.executable).parent / "magcomp")
    done = subprocess.run(
        [str(SHELL), ROOT / "examples" / "many_logs.sh", *logs],
        capture_output=True,
        check=False,
        env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"},
    )
    return done.returncode, done.stdout.decode().splitlines(), done.stderr.decode().splitlines()


needs_shell = pytest.mark.skipif(SHELL is None, reason="the system has no shell")


@needs_shell
def test_many_logs_get_a_line_each_and_those_that_fail_are_named(tmp_path: Path) -> None:
    none, text = tmp_path / "no such.tlog", tmp_path / "text.tlog"
    text.write_text("no log")
    code, said, told = many_logs(tmp_path, none, SWEEP, text)
    assert said == [f"{SWEEP} 1:marginal 2:marginal 3:marginal"]
    assert any("no such file" in line for line in told)
    assert told[-3:] == [
        "2 of 3 logs failed:",
        f"  {none}: exit code 2",
        f"  {text}: exit code 2",
    ]
    assert code == 2


@needs_shell
@pytest.mark.parametrize(("code", "ends"), [(0, 0), (1, 0), (2, 2), (5, 2), (130, 130)])
def test_how_a_fit_ends_decides_how_many_logs_end(tmp_path: Path, code: int, ends: int) -> None:
    answer = '{"source": "a", "compasses": [{"compass": 1, "verdict": "rejected"}]}'
    (tmp_path / "magcomp").write_text(f"#!/bin/sh\necho '{answer}'\nexit {code}\n")
    (tmp_path / "magcomp").chmod(0o755)
    found, said, told = many_logs(tmp_path, "a", "b")
    assert found == ends
    assert said == (["a 1:rejected"] * 2 if code < 2 else [])
    assert told == (
        ["2 of 2 logs failed:", *(f"  {n}: exit code {code}" for n in "ab")] * (ends == 2)
    )
