"""A small ArduPilot for parameters, a lossy network and a clock that only these move.

Faithful to docs/autopilots.md, ArduPilot: parameters: silence for unknown names and
non-finite values, echoes with index 65535 that bring the siblings of a vector along, read-only
names, parameters that hide, and two memories: what is in force, and what a
reboot brings back, into which writes go some time later and in any order.
"""

from __future__ import annotations

import heapq
import itertools
import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.errors import LinkError
from magcomp.model import ParameterSet, Vehicle, compasses_of

SYSTEM, COMPONENT = 1, 1
DEVICES = (97539, 131874, 263178)
UID = bytes.fromhex("270051001551353337393731")
QUAD = Vehicle(
    "ardupilot",
    "copter",
    SYSTEM,
    COMPONENT,
    "4.6.3",
    compasses_of(DEVICES),
    board="board 140",
    uid=UID.hex(),
)
INT8, INT32, REAL32 = 2, 6, 9
BOOT_TIME = 3.0  # seconds a reboot takes
STORE_TIME = 0.8  # seconds until a write has surely reached the storage


def float32(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


def calibration(seed: float, motct: int, compasses: int = 3) -> dict[str, float]:
    """OFS, DIA, ODI and MOT of some compasses, and MOTCT: 12 names a compass and one more."""
    values: dict[str, float] = {}
    for number in ("", "2", "3")[:compasses]:
        for kind, base in (("OFS", 100.0), ("DIA", 1.0), ("ODI", 0.01), ("MOT", -2.0)):
            for step, axis in enumerate("XYZ"):
                seed += 0.01
                values[f"COMPASS_{kind}{number}_{axis}"] = float32(base + seed + 0.1 * step)
    values["COMPASS_MOTCT"] = float(motct)
    return values


OLD = calibration(0.5, motct=2)
NEW = calibration(7.3, motct=1)
WANTED = ParameterSet(NEW, QUAD)


class VirtualClock:
    """Time that moves only when somebody waits."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


class FakeAutopilot:
    """Holds parameters and answers like ArduPilot 4.6."""

    def __init__(
        self, values: Mapping[str, float], read_only: frozenset[str] = frozenset()
    ) -> None:
        fixed = {
            f"COMPASS_DEV_ID{n}": float(d) for n, d in zip(("", "2", "3"), DEVICES, strict=True)
        }
        others = {f"OTHER_{n:03d}": float(n) for n in range(20)}
        scales = {"COMPASS_SCALE": 1.0, "COMPASS_SCALE2": 1.0, "COMPASS_SCALE3": 1.0}
        self.values: dict[str, float] = {
            **{"COMPASS_OFFS_MAX": 1800.0, "COMPASS_PMOT_EN": 0.0, "COMPASS_PMOT1_X": 0.0},
            **fixed,
            **scales,
            **others,
            **values,
        }
        self.read_only = read_only
        self.denies_in_words = True
        self.reports_errors = False
        self.quiet_when_unchanged = False
        self.answers_timesync = True
        self.uid = UID
        self.armed = False
        self.booted_at = 0.0
        self.stored = dict(self.values)
        self.unsaved: list[tuple[float, str, float]] = []
        self.writes: list[tuple[str, float]] = []
        self.states: list[dict[str, float]] = []

    def calibration(self) -> dict[str, float]:
        return {name: self.values[name] for name in OLD if name in self.values}

    def listed(self) -> list[str]:
        hidden = not self.values["COMPASS_PMOT_EN"]
        return [n for n in self.values if not (hidden and n.startswith("COMPASS_PMOT1"))]

    def reboot(self, now: float, stored: bool = True) -> None:
        """Start again; unless `stored`, some of the newest writes had not reached the storage."""
        luck = np.random.default_rng(round(1e6 * now))
        for written_at, name, value in self.unsaved:
            if stored or now - written_at >= STORE_TIME or luck.random() < 0.5:
                self.stored[name] = value
        self.unsaved.clear()
        self.values = dict(self.stored)
        self.states.append(self.calibration())
        self.booted_at = now + BOOT_TIME

    def heartbeat(self) -> Any:
        mode = 128 if self.armed else 0
        return mavlink.MAVLink_heartbeat_message(2, 3, mode, 0, 4, 3)

    def system_time(self, now: float) -> Any:
        return mavlink.MAVLink_system_time_message(0, int(1000 * max(0.0, now - self.booted_at)))

    def answer(self, message: Any, now: float) -> list[Any]:
        match message.get_type():
            case "PARAM_REQUEST_LIST":
                return [self._value(name, i) for i, name in enumerate(self.listed())]
            case "PARAM_REQUEST_READ" if message.param_index == -1:
                name = message.param_id
                return [self._value(name)] if name in self.values else self._error(name, 1)
            case "PARAM_REQUEST_READ":
                names = self.listed()
                index = message.param_index
                return [self._value(names[index], index)] if index < len(names) else []
            case "PARAM_SET":
                return self._set(message.param_id, float32(message.param_value), now)
            case "TIMESYNC" if message.tc1 == 0 and self.answers_timesync:
                since = int(1e9 * max(0.0, now - self.booted_at)) + 1
                return [mavlink.MAVLink_timesync_message(since, message.ts1)]
            case "COMMAND_LONG" if (message.command, message.param1) == (512, 148):
                return [self._version()]
            case _:
                return []

    def _version(self) -> Any:
        return mavlink.MAVLink_autopilot_version_message(
            0, 0, 0, 0, 140 << 16, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0, [*self.uid.ljust(18, b"\0")]
        )

    def _set(self, name: str, value: float, now: float) -> list[Any]:
        self.writes.append((name, value))
        if name not in self.values or not math.isfinite(value):
            return self._error(name, 1)
        if name in self.read_only:
            text = mavlink.MAVLink_statustext_message(4, f"Param write denied ({name})".encode())
            words = [text] if self.denies_in_words else []
            return [*words, *self._error(name, 5), self._value(name)]
        if self.quiet_when_unchanged and self.values[name] == value:
            return []
        self.unsaved.append((now, name, value))
        self.values[name] = value
        self.states.append(self.calibration())
        siblings = [name]
        if name.endswith("_X"):
            siblings += [name[:-1] + axis for axis in "YZ"]
        return [self._value(sibling) for sibling in siblings if sibling in self.values]

    def _error(self, name: str, code: int) -> list[Any]:
        if not self.reports_errors:
            return []
        return [mavlink.MAVLink_param_error_message(255, 190, name.encode(), -1, code)]

    def _value(self, name: str, index: int = 65535) -> Any:
        integer = {"COMPASS_MOTCT": INT8, "COMPASS_PMOT_EN": INT8}
        kind = INT32 if "DEV_ID" in name else integer.get(name, REAL32)
        count = len(self.listed())
        return mavlink.MAVLink_param_value_message(
            name.encode(), self.values[name], kind, count, index
        )


@dataclass
class Network:
    """What happens to a message on its way, the same for both directions.

    ``latency`` and ``jitter`` in seconds one way; more jitter than spacing reorders.
    """

    loss: float = 0.0
    duplication: float = 0.0
    latency: float = 0.0025
    jitter: float = 0.0
    seed: int = 1

    def __post_init__(self) -> None:
        self._random = np.random.default_rng(self.seed)

    def delays(self) -> list[float]:
        if self._random.random() < self.loss:
            return []
        copies = 2 if self._random.random() < self.duplication else 1
        return [self.latency + self.jitter * self._random.random() for _ in range(copies)]


class FakeLink:
    """A connection to a fake autopilot over a network, in virtual time.

    Parameters
    ----------
    before_message
        Called with the number of each message, either way, before it is handed to the network.
    """

    def __init__(
        self,
        autopilot: FakeAutopilot,
        clock: VirtualClock,
        network: Network | None = None,
        before_message: Callable[[int], None] = lambda _: None,
    ) -> None:
        self.autopilot = autopilot
        self.clock = clock
        self.network = network or Network()
        self.before_message = before_message
        self.dead = False
        self.broken = False
        self.reboots_at_the_end = False
        self.messages = 0
        self.strangers: list[Any] = []
        self._order = itertools.count()
        self._ways: list[tuple[float, int, str, Any]] = []
        self._idle = 0
        self._schedule(clock.now + 0.1, "heartbeat", None)
        self._schedule(clock.now + 0.05, "time", None)

    def send(self, message: Any) -> None:
        if self.broken:
            raise LinkError("the cable was pulled")
        self._hand_over("vehicle", message)

    def receive(self, timeout: float) -> Any | None:
        if self.broken:
            raise LinkError("the cable was pulled")
        self._idle = self._idle + 1 if timeout == 0.0 else 0
        if self._idle > 1000:
            raise RuntimeError("the machine spins without waiting")
        until = self.clock.now + timeout
        while self._ways and self._ways[0][0] <= until:
            message = self._next()
            if message is not None:
                return message
        self.clock.now = until
        return None

    def drain(self) -> None:
        """Let the vehicle get what is still under way, as after the program's death."""
        self.before_message = lambda _: None
        while any(to == "vehicle" for _, _, to, _ in self._ways):
            self._next()

    def _next(self) -> Any | None:
        due, _, to, message = heapq.heappop(self._ways)
        self.clock.now = max(self.clock.now, due)
        now = self.clock.now
        up = now >= self.autopilot.booted_at
        if to == "ground":
            return message
        if to == "vehicle" and up:
            for answer in self.autopilot.answer(message, now):
                self._from_vehicle(answer)
        elif to == "heartbeat":
            self._schedule(now + 1.0, "heartbeat", None)
            if up:
                self._from_vehicle(self.autopilot.heartbeat())
        elif to == "time":
            self._schedule(now + 1.0, "time", None)
            if up:
                self._from_vehicle(self.autopilot.system_time(now))
            for stranger in self.strangers:
                self._schedule(now, "ground", stranger)
        return None

    def _from_vehicle(self, message: Any) -> None:
        sign(message, SYSTEM, COMPONENT)
        self._hand_over("ground", message)

    def _hand_over(self, to: str, message: Any) -> None:
        self.messages += 1
        self.before_message(self.messages - 1)
        if self.dead:
            return
        for delay in self.network.delays():
            self._schedule(self.clock.now + delay, to, message)

    def _schedule(self, due: float, to: str, message: Any) -> None:
        heapq.heappush(self._ways, (due, next(self._order), to, message))


def sign(message: Any, system: int, component: int) -> Any:
    """The message as it arrives from a sender."""
    sender = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    return mavlink.MAVLink(None).decode(bytearray(message.pack(sender)))
