"""What is released: a wheel and an sdist that work in a fresh environment, elsewhere."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from magcomp import __version__
from magcomp.cli.app import COMMANDS
from magcomp.cli.version import commit

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.slow


def python(environment: Path) -> Path:
    return environment / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def fresh(path: Path, *packages: str | Path) -> Path:
    """A new environment with some packages, and all they ask for; skips where nobody has them."""
    subprocess.run([sys.executable, "-m", "venv", path], check=True)
    quiet = ("-q", "--disable-pip-version-check")
    done = subprocess.run(
        [python(path), "-m", "pip", "install", *quiet, *packages],
        capture_output=True,
        text=True,
        check=False,
    )
    if "No matching distribution" in done.stderr or "Connection" in done.stderr:
        pytest.skip("packages cannot be fetched here")
    assert done.returncode == 0, done.stderr
    return python(path)


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    (folder / "HEAD").write_text(commit(), encoding="ascii")
    builder = fresh(folder / "builder", "build")
    subprocess.run([builder, "-m", "build", "--outdir", folder, ROOT], check=True)
    return folder


@pytest.fixture(scope="module")
def installed(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The environment's python, with the wheel that was built from the sdist."""
    (wheel,) = dist.glob("*.whl")
    return fresh(tmp_path_factory.mktemp("installed") / "venv", wheel)


def magcomp(installed: Path, where: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.run(
        [installed.parent / "magcomp", *arguments],
        cwd=where,
        env=clean,
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )


def test_an_sdist_holds_what_builds_and_tests_it_and_nothing_of_the_workplace(dist: Path) -> None:
    (sdist,) = dist.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    wanted = ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE", "tests/conftest.py")
    assert {*wanted, "magcomp/COMMIT", "docs/conf.py"} <= names
    assert not [name for name in names if name.startswith((".ci", ".venv", ".git/", "build/"))]


def test_a_wheel_tells_the_commit_it_was_built_from(
    dist: Path, installed: Path, tmp_path: Path
) -> None:
    built_from = (dist / "HEAD").read_text(encoding="ascii")
    assert built_from
    done = magcomp(installed, tmp_path, "--version")
    assert done.stdout == f"magcomp {__version__} (commit {built_from})\n"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_starts_elsewhere(installed: Path, tmp_path: Path, command: str) -> None:
    done = magcomp(installed, tmp_path, command, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"Usage: magcomp {command}")


def test_a_log_takes_the_whole_road_elsewhere(installed: Path, tmp_path: Path) -> None:
    shutil.copy(ROOT / "sitl_fixtures" / "sweep_throttle_only.tlog", tmp_path / "a.tlog")
    done = magcomp(installed, tmp_path, "fit", "a.tlog", "-o", "a.param", "--report", "a.html")
    assert (done.returncode, done.stderr) == (0, "")
    assert "COMPASS_MOT_X" in (tmp_path / "a.param").read_text(encoding="utf-8")
    assert "plotly" in (tmp_path / "a.html").read_text(encoding="utf-8")
    for command in ("info", "check", "heading"):
        done = magcomp(installed, tmp_path, command, "a.tlog", "--json")
        assert done.returncode in (0, 1), done.stderr
        assert json.loads(done.stdout)
    done = magcomp(installed, tmp_path, "upload", "a.param", "tcp:127.0.0.1:1", "--yes")
    assert done.returncode == 3
    done = magcomp(installed, tmp_path, "tui")
    assert "must run in a terminal" in done.stderr
