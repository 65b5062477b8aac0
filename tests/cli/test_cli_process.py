"""``magcomp`` as a process: start-up, streams, signals."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import truth
from logs_made_of_logs import FIXTURES, SWEEP

import magcomp
from magcomp import autopilots
from magcomp.cli.app import COMMANDS, run
from magcomp.cli.truth import KnownTruth
from magcomp.sources import read

HEAVY = {"numpy", "scipy", "pymavlink", "rich", "pygeomag", "textual", "serial"}


def python(*arguments: str, env: dict[str, str] | None = None) -> tuple[int, bytes, bytes]:
    """Exit code, stdout and stderr of this interpreter as another process."""
    done = subprocess.run([sys.executable, *arguments], capture_output=True, check=False, env=env)
    return done.returncode, done.stdout, done.stderr


def imported_by(source: str) -> set[str]:
    """Top-level packages that a fresh interpreter has loaded after some code."""
    report = f"{source}\nimport sys\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    code, out, err = python("-c", report)
    assert code == 0, err
    return set(out.decode().splitlines()[-1].split())


class TestStart:
    """Nothing heavy is imported before a command runs."""

    def test_the_package_imports_nothing_heavy(self) -> None:
        assert not imported_by("import magcomp") & (HEAVY | {"click"})

    @pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["frobnicate"], []])
    def test_the_command_line_imports_nothing_heavy(self, arguments: list[str]) -> None:
        assert not imported_by(f"from magcomp.cli.app import run; run({arguments!r})") & HEAVY

    def test_json_is_made_without_what_only_text_needs(self) -> None:
        loaded = imported_by(
            f"from magcomp.cli.app import run; run(['fit', {str(SWEEP)!r}, '--json'])"
        )
        assert not loaded & {"rich", "textual", "serial"}

    def test_help_names_every_command_with_its_own_words(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert run(["--help"]) == 0
        out = capsys.readouterr().out
        for name, command in COMMANDS.items():
            assert name in out
            assert command.summary in out

    @pytest.mark.parametrize("name", COMMANDS)
    def test_every_command_of_the_table_exists(
        self, name: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert run([name, "--help"]) == 0
        assert f"magcomp {name}" in capsys.readouterr().out

    def test_the_version_is_the_package_s(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["--version"]) == 0
        assert magcomp.__version__ in capsys.readouterr().out


def test_python_m_magcomp_is_the_same_command() -> None:
    code, out, err = python("-m", "magcomp", "fit", "no.tlog")
    assert (code, out) == (2, b"")
    assert err.startswith(b"magcomp: Log no.tlog")


def test_a_reader_that_goes_away_is_no_error() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "magcomp", "fit", str(SWEEP), "--compass", "1"],
            stdout=writing,
            stderr=subprocess.PIPE,
            check=False,
        )
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
@pytest.mark.parametrize("arguments", [["fit", str(SWEEP), "--compass", "1"], ["--help"]])
def test_a_full_disk_gets_one_sentence(arguments: list[str]) -> None:
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "magcomp", *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert done.returncode == 2
    assert done.stderr.startswith(b"magcomp: ")
    assert done.stderr.count(b"\n") == 1


def test_an_encoding_without_block_characters_is_enough() -> None:
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    code, out, err = python("-m", "magcomp", "fit", str(SWEEP), "--compass", "1", env=environment)
    assert (code, err) == (0, b"")
    assert b"MARGINAL" in out
    assert out.isascii()
    assert b" deg" in out
    assert b"?" not in out


def on_a_terminal(*arguments: str) -> tuple[int, bytes, bytes]:
    """Exit code, stdout and what a terminal at stderr received."""
    terminal, child = pty.openpty()
    shown = bytearray()

    def watch() -> None:
        while True:
            try:
                some = os.read(terminal, 4096)
            except OSError:  # how Linux says that nobody holds the other end any more
                return
            if not some:
                return
            shown.extend(some)

    watcher = threading.Thread(target=watch)
    watcher.start()
    done = subprocess.run(
        [sys.executable, "-m", "magcomp", *arguments],
        stdout=subprocess.PIPE,
        stderr=child,
        stdin=subprocess.DEVNULL,
        env={**os.environ, "TERM": "xterm"},
        check=False,
    )
    os.close(child)
    watcher.join()
    os.close(terminal)
    return done.returncode, done.stdout, bytes(shown)


def test_progress_is_shown_on_a_terminal_and_kept_out_of_the_data() -> None:
    code, out, shown = on_a_terminal("fit", str(SWEEP), "--json")
    assert code == 0
    assert json.loads(out)["verdict"] == "marginal"
    assert b"fitting compass" in shown


def test_the_demo_s_truth_is_that_of_the_file() -> None:
    recording = read(FIXTURES / "flight.tlog")
    parameters = {name: recording.parameters.last(name, 0.0) for name in recording.parameters.names}
    parameters |= {"COMPASS_MOTCT": 2.0, "COMPASS_MOT_X": 0.5, "COMPASS_MOT_Y": 1.0}
    known = KnownTruth(FIXTURES / "flight.json")
    independent = truth.of_fixture("flight", recording.start_unix_s)
    in_force = autopilots.of(recording).in_force(parameters, 1).correction
    found = known.heading_error_deg(in_force, 1, 30.0, recording.start_unix_s)
    expected = truth.heading_error_deg(independent, parameters, 1, 30.0, 30.0)
    # The two look at yaws 10° and 2° apart.
    assert found == pytest.approx(expected, rel=0.02)


class TestErrors:
    """What is not foreseen is a sentence too, and a traceback only where asked for."""

    @pytest.fixture
    def broken(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def break_down(*_: object) -> None:
            raise ZeroDivisionError("the sky fell")

        monkeypatch.setattr("magcomp.cli.fit.fit_log", break_down)

    @pytest.mark.usefixtures("broken")
    def test_a_defect_asks_to_be_reported(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.delenv("MAGCOMP_DEBUG", raising=False)
        assert run(["fit", str(SWEEP)]) == 2
        err = capsys.readouterr().err
        assert "ZeroDivisionError: the sky fell" in err
        assert "report" in err
        assert "Traceback" not in err

    @pytest.mark.usefixtures("broken")
    def test_debug_shows_the_traceback(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        run(["--debug", "fit", str(SWEEP)])
        assert "Traceback" in capsys.readouterr().err
        monkeypatch.setenv("MAGCOMP_DEBUG", "1")
        run(["fit", str(SWEEP)])
        assert "Traceback" in capsys.readouterr().err

    def test_an_interruption_ends_with_130(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def interrupt(*_: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr("magcomp.cli.fit.fit_log", interrupt)
        assert run(["fit", str(SWEEP)]) == 130
        assert capsys.readouterr().err.strip() == "magcomp: interrupted."

    def test_a_signal_at_work_ends_with_130(self) -> None:
        source = (
            "import signal, time\n"
            "import magcomp.cli.fit as fit\n"
            "from magcomp.cli.app import main\n"
            "fit.fit_log = lambda *_: (signal.raise_signal(signal.SIGINT), time.sleep(60))\n"
            f"main(['fit', {str(SWEEP)!r}])\n"
        )
        code, _, err = python("-c", source)
        assert (code, err.strip()) == (130, b"magcomp: interrupted.")
