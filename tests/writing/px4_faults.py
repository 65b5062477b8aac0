"""Faults put to a write of the small PX4, and what came of each: for tests and benchmarks."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from fake_autopilot import FakeLink, VirtualClock
from fake_px4 import NEW, OLD, QUAD, SWITCH, WANTED, FakePx4

from magcomp.model import ParameterSet
from magcomp.writing.events import Outcome, Standing
from magcomp.writing.files import read_parameter_file
from magcomp.writing.journal import read_journal
from magcomp.writing.plan import plan
from magcomp.writing.writer import read_current, write


class KilledError(BaseException):
    """The program ends here, as by SIGKILL."""


class CallbackError(Exception):
    """Whoever is told fails."""


def dies(link: FakeLink) -> None:
    link.dead = True


def reboots(link: FakeLink) -> None:
    link.autopilot.reboot(link.clock.now, stored=False)


def is_killed(_: FakeLink) -> None:
    raise KilledError


def is_killed_and_the_vehicle_reboots(link: FakeLink) -> None:
    link.reboots_at_the_end = True
    raise KilledError


def is_interrupted(_: FakeLink) -> None:
    raise KeyboardInterrupt


def callback_fails(link: FakeLink) -> None:
    link.callback_fails = True


def arms(link: FakeLink) -> None:
    link.autopilot.armed = True


FAULTS: Mapping[str, Callable[[FakeLink], None]] = {
    "link dies": dies,
    "vehicle reboots": reboots,
    "killed": is_killed,
    "killed, then reboots": is_killed_and_the_vehicle_reboots,
    "Ctrl-C": is_interrupted,
    "exception in a callback": callback_fails,
    "another arms it": arms,
}


@dataclass(frozen=True)
class Struck:
    """What came of a fault: half-written, a false claim, not restored; and how it stood."""

    bad: tuple[bool, bool, bool]
    stands: str
    seconds: float


def upload(link: FakeLink, backup: Path, wanted: ParameterSet = WANTED) -> Outcome:
    current = read_current(link, QUAD, wanted, clock=link.clock)
    return write(plan(current, wanted, QUAD), link, backup=backup, clock=link.clock)


def is_so(standing: Standing, held: Mapping[str, float]) -> bool:
    """Whether what was said is true."""
    return {
        Standing.OLD: held == OLD,
        Standing.NEW: held == NEW,
        Standing.OFF: held[SWITCH] == 0,
        Standing.UNSURE: held in (OLD, NEW) or held[SWITCH] == 0,
    }[standing]


def clean_messages() -> tuple[int, float]:
    """Messages and seconds of a write without fault."""
    case = _Case(None, 0)
    with tempfile.TemporaryDirectory() as folder:
        case.write(Path(folder) / "b.param")
    return case.link.messages - case.begin, case.clock.now - case.began


class _Case:
    def __init__(self, fault: Callable[[FakeLink], None] | None, at: int) -> None:
        self.vehicle, self.clock = FakePx4(OLD), VirtualClock()
        self.link = FakeLink(self.vehicle, self.clock)
        self.link.callback_fails = False
        self.current = read_current(self.link, QUAD, WANTED, clock=self.clock)
        self.begin, self.began = self.link.messages, self.clock.now
        self._fault, self._at = fault, at
        self.link.before_message = self._strike

    def _strike(self, number: int) -> None:
        if self._fault is not None and number == self.begin + self._at:
            self._fault(self.link)

    def _told(self, _: object) -> None:
        if self.link.callback_fails:
            raise CallbackError

    def write(self, backup: Path) -> Outcome:
        todo = plan(self.current, WANTED, QUAD)
        return write(todo, self.link, backup=backup, clock=self.clock, on_event=self._told)


def strike(fault: Callable[[FakeLink], None], at: int, folder: Path) -> Struck:
    """Write with a fault just before a message; then look, and restore."""
    case, backup, outcome = _Case(fault, at), folder / "b.param", None
    try:
        outcome = case.write(backup)
    except KilledError:
        case.link.drain()
        if case.link.reboots_at_the_end:
            case.vehicle.reboot(case.clock.now, stored=False)
    except CallbackError:
        pass
    seconds = case.clock.now - case.began
    case.vehicle.armed = False
    half = any(state[SWITCH] and state not in (OLD, NEW) for state in case.vehicle.states)
    held, journal = case.vehicle.calibration(), read_journal(backup)
    said = [journal.standing] + ([] if outcome is None else [outcome.standing])
    false = not all(is_so(standing, held) for standing in said)
    stands = "new" if held == NEW else "old" if held == OLD else "off"
    case.clock.now += 10.0
    again = FakeLink(case.vehicle, case.clock)
    restored = upload(again, folder / "again.param", read_parameter_file(backup)).good
    return Struck(
        (half, false, not (restored and case.vehicle.calibration() == OLD)), stands, seconds
    )
