"""magcomp as a module of MAVProxy, with a MAVProxy of a few lines and a simulated vehicle."""

from __future__ import annotations

import contextlib
import importlib
import queue
import shlex
import sys
import threading
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from live_vehicle import COMPENSATION, PATIENCE_S, alive, held, landed
from pymavlink import mavutil

import magcomp
from magcomp.link.clock import SystemClock
from magcomp.live.guide import STEADY, Guidance
from magcomp.mavproxy.carried import CarriedTransport
from magcomp.mavproxy.commands import Commands
from magcomp.model import ParameterSet, Vehicle
from magcomp.writing.events import Outcome, Reason, Standing
from magcomp.writing.files import read_parameter_file, write_parameter_file
from magcomp.writing.plan import WritePlan

SPEED = 3.0
"""Beyond that pymavlink, which reads for MAVProxy, does not keep up on a busy machine."""


class FakeModule:
    """As much of MAVProxy's MPModule as a module may use."""

    def __init__(self, mpstate: Any, name: str, description: str) -> None:
        self.mpstate, self.name, self.description = mpstate, name, description
        self.needs_unloading = False

    def add_command(
        self, name: str, callback: Callable[[list[str]], None], description: str, words: list[str]
    ) -> None:
        self.mpstate.command_map[name] = (callback, description)
        self.mpstate.completions[name] = words


class FakeMavproxy:
    """MAVProxy's state, and its main loop in a thread: packets to the module."""

    def __init__(self, address: str) -> None:
        self.command_map: dict[str, Any] = {}
        self.completions: dict[str, list[str]] = {}
        self.settings = types.SimpleNamespace(target_system=0)
        self.modules: list[tuple[Any, Any]] = []
        self._link = mavutil.mavlink_connection(address)
        self._asked: queue.Queue[Callable[[], None]] = queue.Queue()
        self.module: Any = None

    def master(self) -> Any:
        return self._link

    def type(self, line: str) -> None:
        """Type a line, and wait for what it does."""
        name, *words = line.split()
        self.command_map[name][0](words)

    def loop(self) -> None:
        while self.modules:
            packet = self._link.recv_match(blocking=True, timeout=0.05)
            for module, _ in list(self.modules):
                if packet is not None:
                    module.mavlink_packet(packet)
                module.idle_task()
                if module.needs_unloading:
                    self._unload()
            with contextlib.suppress(queue.Empty):
                self._asked.get_nowait()()

    def unload(self) -> None:
        """Ask for what `module unload` does; see whether `modules` is empty."""
        self._asked.put(self._unload)

    def _unload(self) -> None:
        """As MAVProxy does it: nothing is read until the module has let it."""
        module = self.modules[0]
        thread = threading.Thread(target=module[0].unload)
        thread.start()
        thread.join(5.0)
        self.modules.remove(module)

    @contextlib.contextmanager
    def running(self) -> Iterator[FakeMavproxy]:
        self.module = magcomp.init(self)
        self.modules.append((self.module, magcomp))
        thread = threading.Thread(target=self.loop)
        thread.start()
        try:
            yield self
        finally:
            if self.modules:
                self.unload()
            thread.join()
            self._link.close()


@pytest.fixture(autouse=True)
def mavproxy_is_there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("MAVProxy", "MAVProxy.modules", "MAVProxy.modules.lib"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    lib = types.ModuleType("MAVProxy.modules.lib.mp_module")
    lib.MPModule = FakeModule  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, lib.__name__, lib)
    monkeypatch.setattr("platformdirs.user_data_dir", lambda *_args, **_named: str(tmp_path))


class Prompt:
    """What a pilot types, and what is said."""

    def __init__(self, mavproxy: FakeMavproxy, capsys: pytest.CaptureFixture[str]) -> None:
        self._mavproxy, self._capsys = mavproxy, capsys

    def __call__(self, line: str) -> str:
        self._mavproxy.type(line)
        for thread in threading.enumerate():
            if thread.name == "magcomp-command":
                thread.join(PATIENCE_S)
        said = self._capsys.readouterr()
        return str(said.out + said.err)

    def until(self, line: str, *words: str) -> str:
        """Type it again and again until all words are said."""
        for _ in range(int(PATIENCE_S / 0.1)):
            said = self(line)
            if all(word in said for word in words):
                return said
            threading.Event().wait(0.1)
        raise AssertionError(f"{line} never said {words}: {said}")


def test_it_is_loaded_listens_and_tells_what_it_can(capsys: pytest.CaptureFixture[str]) -> None:
    with (
        alive(vehicle=landed(), speed=SPEED) as flown,
        FakeMavproxy(flown.address).running() as mavproxy,
    ):
        prompt = Prompt(mavproxy, capsys)
        assert mavproxy.module.name == "magcomp"
        assert "status" in mavproxy.completions["magcomp"]
        assert "magcomp undo" in prompt("magcomp")
        assert "magcomp fit" in prompt("magcomp frobnicate")
        said = prompt.until("magcomp status", "ArduPilot copter", "calibration is read")
        assert "recorded" in said
        assert "A fit must come before a write" in prompt("magcomp write yes")
        assert "A backup must be given" in prompt("magcomp undo yes")
        assert "must" in prompt("magcomp fit /nowhere/x.param")
    assert "magcomp" not in mavproxy.command_map


def test_a_write_that_is_unloaded_is_put_back_first(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    vehicle = landed()
    before = held(vehicle)
    backup = tmp_path / "b.param"
    ids = {f"COMPASS_DEV_ID{n}": vehicle.parameters[f"COMPASS_DEV_ID{n}"] for n in ("", 2, 3)}
    write_parameter_file(backup, ParameterSet({**COMPENSATION, **ids}))
    with (
        alive(vehicle=vehicle, speed=SPEED) as flown,
        FakeMavproxy(flown.address).running() as mavproxy,
    ):
        Prompt(mavproxy, capsys).until("magcomp status", "calibration is read")
        mavproxy.type(f"magcomp undo {backup} yes")
        said = ""
        while "magcomp: switching the motor compensation off" not in said:
            threading.Event().wait(0.02)
            said += capsys.readouterr().err
        mavproxy.unload()
    said = capsys.readouterr().err
    assert "it was interrupted" in said
    assert "everything as before" in said
    assert held(vehicle) == before
    assert not mavproxy.modules


@pytest.mark.slow
def test_a_flight_is_fitted_written_and_undone(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with (
        alive("sweep", speed=SPEED) as flown,
        FakeMavproxy(flown.address).running() as mavproxy,
    ):
        prompt = Prompt(mavproxy, capsys)
        before = held(flown.vehicle)
        prompt.until("magcomp status", "calibration is read")
        while flown.vehicle.time < flown.vehicle.duration_s:
            threading.Event().wait(0.1)
        said = prompt(f"magcomp fit {tmp_path / 'a.parm'}")
        assert "motors add" in said
        assert "magcomp write shows" in said
        wanted = read_parameter_file(tmp_path / "a.parm").values
        assert "Nothing is written yet: magcomp write yes" in prompt("magcomp write")
        assert held(flown.vehicle) == before
        assert "To undo this: magcomp undo" in prompt("magcomp write yes")
        assert flown.vehicle.parameters["COMPASS_MOT_X"] == wanted["COMPASS_MOT_X"]
        assert "nothing is written" in prompt("magcomp write yes")
        assert "magcomp undo yes" in prompt("magcomp undo")
        assert "Written and read back" in prompt("magcomp undo yes")
        assert held(flown.vehicle) == before
        assert list(tmp_path.glob("recording-*.tlog"))


class FakeSession:
    """A session that shows what it is told to, and whose write is cut off."""

    def __init__(self, **shown: Any) -> None:
        usual = {
            "vehicle": None,
            "link_text": "connected",
            "ready": True,
            "recorded_s": 90.0,
            "recording_path": Path("flown.tlog"),
            "warnings": (),
            "armed": None,
            "armed_until_s": 0.0,
            "guidance": Guidance("turn to the right", 0.5, missing=("headings", STEADY)),
        }
        self.shown = {**usual, **shown}

    def snapshot(self) -> types.SimpleNamespace:
        return types.SimpleNamespace(**self.shown)

    def restore_plan(self, _backup: Path) -> WritePlan:
        vehicle = Vehicle("ardupilot", "copter", 1, 1, "4.6.3", ())
        return WritePlan(vehicle, {"COMPASS_MOTCT": 2.0}, {}, {"COMPASS_MOTCT": 0.0}, {})

    def wait_disarmed(self, _seconds: float) -> None:
        pass

    def restore(self, *_args: Any) -> Outcome:
        return Outcome(Standing.OFF, Reason.LINK_LOST, "the link was lost")


def told(session: FakeSession, capsys: pytest.CaptureFixture[str], *words: str) -> str:
    commands = Commands(session)  # type: ignore[arg-type]
    commands.run(words)
    assert commands.wait(PATIENCE_S)
    said = capsys.readouterr()
    return str(said.out + said.err)


ALL_FLOWN = Guidance("keep flying", 0.9, missing=(STEADY,))


@pytest.mark.parametrize(
    ("shown", "last"),
    [
        ({"armed": True}, "Turn to the right."),
        ({"armed": True, "guidance": ALL_FLOWN}, "All that a fit needs is flown: land, then"),
        ({"armed": False}, "Turn to the right."),
        ({"armed": False, "armed_until_s": 80.0}, "Magcomp fit says whether what was recorded"),
    ],
)
def test_what_to_do_next_is_true_where_nothing_is_fitted_unasked(
    shown: dict[str, Any], last: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = told(FakeSession(**shown), capsys, "status").splitlines()
    assert "1 min 30 s are recorded into flown.tlog." in said
    assert said[-1].startswith(last)


def test_what_brings_a_vehicle_back_can_be_typed_as_it_is_said(
    capsys: pytest.CaptureFixture[str],
) -> None:
    session = FakeSession()
    asked = told(session, capsys, "undo", "my backup.param")
    assert "Nothing is written yet: magcomp undo 'my backup.param' yes" in asked
    said = told(session, capsys, "undo", "my backup.param", "yes")
    command, *words = shlex.split(said.splitlines()[-1])
    assert (command, words[0], words[2:]) == ("magcomp", "restore", ["yes"])


@pytest.mark.slow
def test_a_backup_is_brought_back_by_its_path(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    vehicle = landed()
    backup = tmp_path / "b.param"
    with (
        alive(vehicle=vehicle, speed=SPEED) as flown,
        FakeMavproxy(flown.address).running() as mavproxy,
    ):
        prompt = Prompt(mavproxy, capsys)
        prompt.until("magcomp status", "calibration is read")
        ids = {f"COMPASS_DEV_ID{n}": vehicle.parameters[f"COMPASS_DEV_ID{n}"] for n in ("", 2, 3)}
        write_parameter_file(backup, ParameterSet({**COMPENSATION, **ids}))
        assert "Written and read back" in prompt(f"magcomp restore {backup} mavproxy yes")
        assert held(vehicle) == COMPENSATION


def test_importing_magcomp_imports_nothing_of_it() -> None:
    assert "MAVProxy" not in magcomp.__dict__
    importlib.reload(magcomp)
    assert callable(magcomp.init)


def test_a_carried_link_loses_what_nobody_reads_and_what_cannot_be_sent() -> None:
    def fails(_data: bytes) -> None:
        raise OSError("the port is gone")

    link = CarriedTransport(fails, SystemClock())
    link.write(b"lost")
    link.put(b"frame")
    assert (link.read(0.1), link.read(0.0)) == (b"frame", b"")
    for _ in range(30_000):
        link.put(b"x")
    assert link.read(0.0) == b"x"
