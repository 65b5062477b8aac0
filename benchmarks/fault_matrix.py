"""What stands on a vehicle after a write that went wrong: every message × every fault.

A simulated vehicle of each firmware, with two memories (what is in force; what a reboot brings
back) is written by the client that writes real ones. At each message of the write in turn, or each
STEP-th, one thing goes wrong. Counted are:

half-written
    Some instant at which compensation was on with values that are neither all old nor all new; with
    PX4, which takes values over some time after they are written, also of those in force.
false claims
    Outcome or journal said something that was not so.
not restored
    `restore` did not bring every value back.

    python benchmarks/fault_matrix.py [STEP [ardupilot|px4]]
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from magcomp.link.identity import read_heartbeat
from magcomp.mavlink.version import unique_id
from magcomp.model import ParameterSet, compasses_of
from magcomp.model import Vehicle as Identity
from magcomp.simulate import (
    Faults,
    FaultyLink,
    Frame,
    Habits,
    LocalConnection,
    Vehicle,
    parameters,
    scenario,
)
from magcomp.simulate.habits import own_number
from magcomp.simulate.px4 import Px4, sensors
from magcomp.writing import writer
from magcomp.writing.events import Outcome, Standing
from magcomp.writing.files import read_parameter_file
from magcomp.writing.journal import read_journal
from magcomp.writing.plan import plan
from magcomp.writing.rows import as_float32

SEED = 1
STORAGE_S = 0.9
TITLE = (
    f"{'fault':<32}{'cases':>6}{'half-written':>14}{'false claims':>14}{'not restored':>14}"
    f"{'old/new/off':>16}{'longest':>9}"
)


@dataclass(frozen=True)
class Firmware:
    """Whose vehicle is written.

    Attributes
    ----------
    key
        As in ``Vehicle.autopilot``.
    names
        The values that are written, without the switch.
    switch
        The parameter that switches compensation.
    identity
        Whom the client expects.
    """

    key: str
    names: tuple[str, ...]
    switch: str
    identity: Identity

    def parked(self, habits: Habits, *, answers_errors: bool = False) -> Vehicle:
        """A vehicle on the ground with a compensation in force."""
        return Vehicle(
            scenario("parked", SEED, compensation="wrong"),
            autopilot=self.key,
            habits=habits,
            answers_errors=answers_errors,
        )


def identity(key: str, firmware: str, devices: Sequence[int]) -> Identity:
    """Whom the client expects."""
    number = unique_id(own_number(SEED), 0)
    return Identity(key, "copter", 1, 1, firmware, compasses_of(devices), uid=number)


ARDUPILOT = Firmware(
    "ardupilot",
    tuple(
        f"COMPASS_{kind}{compass}_{axis}"
        for compass in ("", "2", "3")
        for kind in ("OFS", "DIA", "ODI", "MOT")
        for axis in "XYZ"
    ),
    "COMPASS_MOTCT",
    identity("ardupilot", "4.6.3", parameters.DEVICE_IDS),
)
PX4 = Firmware(
    "px4",
    tuple(
        f"CAL_MAG{slot}_{axis}{kind}"
        for slot in range(3)
        for kind in ("COMP", "OFF", "SCALE", "ODIAG")
        for axis in "XYZ"
    ),
    "CAL_MAG_COMP_TYP",
    identity("px4", "1.15.2", sensors.DEVICE_IDS),
)
FIRMWARE = {each.key: each for each in (ARDUPILOT, PX4)}

Held = dict[str, float]


class KilledError(BaseException):
    """The program ends here, as by SIGKILL."""


class CallbackError(Exception):
    """Whoever is told fails."""


class Watched:
    """A machine that looks at the vehicle behind it after each frame it gets."""

    def __init__(self, machine: Any, vehicle: Vehicle, firmware: Firmware) -> None:
        self._machine, self._vehicle, self._firmware = machine, vehicle, firmware
        self.states: list[Held] = []

    def receive(self, frame: bytes, time: float) -> None:
        """See magcomp.simulate.Machine."""
        self._machine.receive(frame, time)
        self._look()

    def advance(self, time: float) -> list[Frame]:
        """See magcomp.simulate.Machine."""
        frames: list[Frame] = self._machine.advance(time)
        self._look()
        return frames

    def _look(self) -> None:
        for now in (held(self._vehicle, self._firmware), in_force(self._vehicle, self._firmware)):
            if now not in self.states[-2:]:
                self.states.append(now)


def held(vehicle: Vehicle, firmware: Firmware) -> Held:
    """What the vehicle holds."""
    values = vehicle.parameters
    return {name: values[name] for name in (*firmware.names, firmware.switch)}


def in_force(vehicle: Vehicle, firmware: Firmware) -> Held:
    """What acts on its readings, as the values that would make it so."""
    if not isinstance(vehicle.firmware, Px4):
        return held(vehicle, firmware)
    acting = [vehicle.firmware.compasses.in_force(device) for device in sensors.DEVICE_IDS]
    vectors = [
        vector
        for each in acting
        for vector in (each.motor, each.offset, each.scale, each.off_diagonal)
    ]
    # In the order of its names, see PX4.
    found = dict(zip(firmware.names, np.concatenate(vectors).tolist(), strict=True))
    return found | {firmware.switch: float(acting[-1].compensation)}


class Case:
    """One write with one fault at one message, and what came of it."""

    def __init__(
        self,
        firmware: Firmware,
        faults: Faults,
        folder: Path,
        at: int = 0,
        kind: str = "",
        *,
        habits: Habits | None = None,
        answers_errors: bool = False,
        seed: int = 0,
    ) -> None:
        self.firmware = firmware
        self.vehicle = firmware.parked(
            habits or Habits(storage_s=STORAGE_S), answers_errors=answers_errors
        )
        self.old = self._held()
        moved = {name: as_float32(self.old[name] + 0.0625) for name in firmware.names}
        self.new = moved | {firmware.switch: 1.0}
        self.backup = folder / "backup.param"
        self.outcome: Outcome | None = None
        self.counted = 0
        calm = LocalConnection(self.vehicle)
        wanted = ParameterSet(self.new, firmware.identity)
        current = writer.read_current(calm, firmware.identity, wanted, clock=calm.clock)
        self.plan = plan(current, wanted, firmware.identity)
        link = FaultyLink(self.vehicle, faults, seed)
        self.watched = Watched(link, self.vehicle, firmware)
        connection = LocalConnection(self.watched, calm.clock())
        messages = _Counter(connection, at if kind == "killed" else 0)
        told = _Teller(at if kind == "callback" else 0)
        with contextlib.suppress(KilledError, CallbackError):
            self.outcome = writer.write(
                self.plan, messages, backup=self.backup, clock=connection.clock, on_event=told
            )
        self.counted, self.told = link.counted, told.count
        self.seconds = connection.clock() - calm.clock()
        if kind == "killed":
            self.watched.advance(connection.clock() + 0.2)
            self.vehicle.reboot()
        self._after = connection.clock() + 5.0

    def _held(self) -> Held:
        return held(self.vehicle, self.firmware)

    def verdict(self) -> tuple[bool, bool, bool, str]:
        """Half-written, false claim, not restored; and how it stands in a word."""
        whole = (self.old, self.new)
        now = self._held()
        states = [*self.watched.states, now]
        half = any(state[self.firmware.switch] and state not in whole for state in states)
        journal = read_journal(self.backup)
        false = not self._is_so(journal.standing, now)
        if self.outcome is not None:
            false = false or not self._is_so(self.outcome.standing, now)
        word = "new" if now == self.new else "old" if now == self.old else "off"
        return half, false, not self._restored(), word

    def _is_so(self, standing: Standing, now: Held) -> bool:
        return {
            Standing.OLD: now == self.old,
            Standing.NEW: now == self.new,
            Standing.OFF: now[self.firmware.switch] == 0.0,
            Standing.UNSURE: now in (self.old, self.new) or now[self.firmware.switch] == 0.0,
        }[standing]

    def _restored(self) -> bool:
        self.vehicle.advance(self._after)
        self.vehicle.disarm()
        calm = LocalConnection(self.vehicle, self._after)
        wanted, identity = read_parameter_file(self.backup), self.firmware.identity
        current = writer.read_current(calm, identity, wanted, clock=calm.clock)
        again = self.backup.with_name("again.param")
        writer.write(plan(current, wanted, identity), calm, backup=again, clock=calm.clock)
        return self._held() == self.old


class _Counter:
    """A connection that ends the program at a message."""

    def __init__(self, connection: LocalConnection, at: int) -> None:
        self._connection, self._at, self._count = connection, at, 0

    def send(self, message: Any) -> None:
        self._strike()
        self._connection.send(message)

    def receive(self, timeout: float) -> Any | None:
        message = self._connection.receive(timeout)
        if message is not None and read_heartbeat_or_none(message) is None:
            self._strike()
        return message

    def _strike(self) -> None:
        self._count += 1
        if self._count == self._at:
            raise KilledError


def read_heartbeat_or_none(message: Any) -> object:
    return read_heartbeat(message) if message.get_type() == "HEARTBEAT" else None


class _Teller:
    """Somebody who is told what happens, and fails at an event."""

    def __init__(self, at: int) -> None:
        self._at, self.count = at, 0

    def __call__(self, _: object) -> None:
        self.count += 1
        if self.count == self._at:
            raise CallbackError


KINDS: dict[str, Callable[[int], tuple[Faults, str]]] = {
    "link dies": lambda at: (Faults(dead_at=at), ""),
    "vehicle reboots": lambda at: (Faults(reboot_at=at), ""),
    "killed, then reboots": lambda _: (Faults(), "killed"),
    "exception in a callback": lambda _: (Faults(), "callback"),
    "stranger confirms, link dies": lambda at: (Faults(dead_at=at, stranger=(1, 154)), ""),
    "another arms it": lambda at: (Faults(arm_at=at), ""),
}


def main() -> None:
    step = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    chosen = sys.argv[2:] or [*FIRMWARE]
    with mock.patch("os.fsync"):  # the disk is not what is measured
        for key in chosen:
            measure(FIRMWARE[key], step)


def tell(
    kind: str, cases: int, counts: list[int], stood: Counter[str], longest: float, work: float
) -> None:
    """Print a line of the table."""
    shares = "/".join(str(stood[word]) for word in ("old", "new", "off"))
    print(
        f"{kind:<32}{cases:>6}{counts[0]:>14}{counts[1]:>14}{counts[2]:>14}"
        f"{shares:>16}{longest:>7.0f} s   ({work:.0f} s of work)",
        flush=True,
    )


def measure(firmware: Firmware, step: int) -> None:
    with tempfile.TemporaryDirectory() as name:
        clean = Case(firmware, Faults(), Path(name))
    size = f"{clean.counted} messages, {clean.told} events, {clean.seconds:.1f} s"
    print(f"{firmware.key}: {size} clean")
    print(TITLE)
    for kind, made in KINDS.items():
        begun, counts, longest = time.monotonic(), [0, 0, 0], 0.0
        stood: Counter[str] = Counter()
        last = clean.told if kind == "exception in a callback" else clean.counted
        cases = range(1, last + 1, step)
        for at in cases:
            faults, how = made(at)
            with tempfile.TemporaryDirectory() as name:
                case = Case(firmware, faults, Path(name), at, how)
                *bad, word = case.verdict()
            counts = [count + one for count, one in zip(counts, bad, strict=True)]
            stood[word] += 1
            longest = max(longest, case.seconds)
        tell(kind, len(cases), counts, stood, longest, time.monotonic() - begun)


if __name__ == "__main__":
    main()
