"""``magcomp sweep`` as it is typed: what it asks, and what a key, Ctrl-C and kill -9 do to it."""

from __future__ import annotations

import contextlib
import os
import pty
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from live_vehicle import PATIENCE_S, alive
from sweep_bench import LIMITS, Cable

from magcomp.cli.app import run
from magcomp.errors import ExitCode
from magcomp.simulate import Vehicle, scenario

MAGCOMP = (sys.executable, "-m", "magcomp")


def test_without_a_terminal_nobody_could_stop_it(capsys):
    assert run(["sweep", "udp:127.0.0.1:1"]) == ExitCode.USAGE
    assert "must be run at a terminal, where any key can stop it" in capsys.readouterr().err


class Typist:
    """A person at a terminal in which magcomp sweep runs."""

    def __init__(self, address: str, folder: Path) -> None:
        self._screen, terminal = pty.openpty()
        self.program = subprocess.Popen(
            [*MAGCOMP, "sweep", address, "--record", str(folder / "sweep.tlog")],
            stdin=terminal,
            stdout=terminal,
            stderr=terminal,
            start_new_session=True,
        )
        os.close(terminal)
        self.shown = ""
        self._changed = threading.Condition()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        with contextlib.suppress(OSError):
            while data := os.read(self._screen, 4096):
                with self._changed:
                    self.shown += data.decode("utf-8", "replace")
                    self._changed.notify_all()

    def wait_for(self, text: str) -> None:
        with self._changed:
            assert self._changed.wait_for(lambda: text in self.shown, PATIENCE_S), self.shown

    def type(self, text: str) -> None:
        os.write(self._screen, text.encode())

    def close(self) -> int:
        code = self.program.wait(PATIENCE_S)
        self._reader.join()
        os.close(self._screen)
        return code


@pytest.fixture
def at_work(tmp_path) -> Iterator[tuple[Typist, Cable]]:
    """A person, and a vehicle that is watched."""
    cables: list[Cable] = []

    def wrap(machine):
        cables.append(Cable(machine))
        return cables[0]

    vehicle = Vehicle(scenario("parked", 3), wait_for_ground=True)
    with alive(vehicle=vehicle, wrap=wrap, speed=1.0) as flown:
        typist = Typist(flown.address, tmp_path)
        try:
            yield typist, cables[0]
        finally:
            with contextlib.suppress(ProcessLookupError):
                typist.program.kill()


def wait_until(condition) -> None:
    for _ in range(int(PATIENCE_S / 0.01)):
        if condition():
            return
        threading.Event().wait(0.01)
    raise AssertionError("never came")


def watch_s(cable: Cable, seconds: float) -> None:
    """Let the vehicle's own time pass."""
    until = cable.machine.time + seconds
    wait_until(lambda: cable.machine.time > until)


@pytest.mark.slow
def test_another_name_than_the_vehicles_spins_nothing(at_work):
    typist, cable = at_work
    typist.wait_for("Type copter-1 to begin")
    typist.type("yes\n")
    assert typist.close() == ExitCode.USAGE
    assert "What is typed must be copter-1; instead received 'yes'" in typist.shown
    assert not any(motors for _, motors in cable.spun)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["key", "ctrl-c", "kill -9"])
def test_it_is_stopped_by(at_work, how):
    typist, cable = at_work
    typist.wait_for("Type copter-1 to begin")
    typist.type("copter-1\n")
    wait_until(lambda: cable.machine.spinning)
    watch_s(cable, 0.5)
    assert cable.machine.spinning == (1,)
    since = cable.machine.time
    if how == "key":
        typist.type("x")
    else:
        typist.program.send_signal(signal.SIGINT if how == "ctrl-c" else signal.SIGKILL)
    code = typist.close()
    watch_s(cable, 2.5)
    run_on = cable.last_spun_s - since
    if how == "kill -9":
        assert code == -signal.SIGKILL
        assert run_on <= LIMITS.timeout_s + 0.05
    else:
        assert code == ExitCode.INTERRUPTED
        assert "All motors were told to stand still after 0 steps" in typist.shown
        assert run_on < LIMITS.timeout_s
    assert not cable.machine.armed
