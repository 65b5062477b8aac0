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


@pytest.mark.skipif(SHELL is None, reason="the system has no shell")
def test_many_logs_get_a_line_each(tmp_path: Path) -> None:
    (tmp_path / "magcomp").symlink_to(Path(sys.executable).parent / "magcomp")
    done = subprocess.run(
        [str(SHELL), ROOT / "examples" / "many_logs.sh", SWEEP, tmp_path / "none.tlog", SWEEP],
        capture_output=True,
        check=False,
        env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"},
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.decode().splitlines() == [f"{SWEEP} 1:marginal 2:marginal 3:marginal"] * 2
