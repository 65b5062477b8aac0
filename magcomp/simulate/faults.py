"""A bad link between ground and vehicle: everything that goes wrong on a real one, on a switch.

:class:`FaultyLink` has the methods of a :class:`Vehicle` and stands in front of
one, so that the same faults work in a test without sockets and on the server.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.errors import UsageError
from magcomp.mavlink.header import message_id
from magcomp.simulate.vehicle import Frame, Vehicle

WRITING = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
        mavlink.MAVLINK_MSG_ID_PARAM_SET,
        mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
        mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
        mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
    }
)
"""Messages that reading and writing parameters consists of, in either direction."""

_HELD_BACK_S = 0.05


class Machine(Protocol):
    """Something that talks MAVLink when it is given time: a vehicle, or a link to one."""

    def receive(self, frame: bytes, time: float) -> None:
        """Take one frame from the ground at ``time``, seconds since power-up."""

    def advance(self, time: float) -> Sequence[Frame]:
        """Let time pass; the frames that reach the ground until then."""


@dataclass(frozen=True)
class Faults:
    """What goes wrong. Probabilities are for each frame and each direction.

    Attributes
    ----------
    loss, duplication, reordering, corruption
        Probabilities, 0 … 1. A reordered frame arrives 50 ms late.
    latency_s
        How long every frame takes, one way.
    reboot_at
        At this counted message, which is lost, the vehicle reboots; the first is number 1.
    dead_at
        From this counted message on, which is lost too, nothing passes.
    arm_at
        At this counted message somebody arms the vehicle.
    stranger
        System and component of somebody who confirms every write the ground sends, at once, lost
        or not.
    counted
        Numbers of the MAVLink messages that count, in both directions together.
    """

    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    corruption: float = 0.0
    latency_s: float = 0.0
    reboot_at: int | None = None
    dead_at: int | None = None
    arm_at: int | None = None
    stranger: tuple[int, int] | None = None
    counted: frozenset[int] = WRITING

    def __post_init__(self) -> None:
        for name in ("loss", "duplication", "reordering", "corruption"):
            probability = getattr(self, name)
            if not 0.0 <= probability <= 1.0:
                raise UsageError(
                    f"The simulated link's {name} must be a probability from 0 to 1; "
                    f"instead received {probability:g}"
                )
        if not 0.0 <= self.latency_s < np.inf:
            raise UsageError(
                "The simulated link's latency must be 0 s or more; "
                f"instead received {self.latency_s:g} s"
            )


class FaultyLink:
    """A vehicle behind a bad link.

    Parameters
    ----------
    vehicle
        The vehicle.
    faults
        What goes wrong.
    seed
        Same seed, same faults.
    """

    def __init__(self, vehicle: Vehicle, faults: Faults, seed: int = 0) -> None:
        self._vehicle = vehicle
        self._faults = faults
        rng = np.random.default_rng([seed, 4])
        self._up = _Direction(faults, rng)
        self._down = _Direction(faults, rng)
        self.counted = 0
        self.dead = False
        self._codec: Any = mavlink.MAVLink(None)
        self._injected: list[Frame] = []

    def receive(self, frame: bytes, time: float) -> None:
        """Take one frame from the ground; see :class:`Machine`."""
        self._up.send(Frame(time, frame))
        if self._faults.stranger is not None:
            self._confirm(frame, time, self._faults.stranger)

    def advance(self, time: float) -> list[Frame]:
        """Let time pass; see :class:`Machine`."""
        for frame in self._up.arrived(time):
            if self._passes(frame):
                self._vehicle.receive(frame.data, frame.time)
                self._collect(frame.time)
        self._collect(time)
        injected, self._injected = self._injected, []
        return [*injected, *self._down.arrived(time)]

    def _confirm(self, frame: bytes, time: float, stranger: tuple[int, int]) -> None:
        """Say in a stranger's name that a write was carried out."""
        if message_id(frame) != mavlink.MAVLINK_MSG_ID_PARAM_SET:
            return
        asked = self._codec.decode(bytearray(frame))
        value = mavlink.MAVLink_param_value_message(
            asked.param_id.encode(), asked.param_value, asked.param_type, 1, 65535
        )
        system, component = stranger
        codec: Any = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self._injected.append(Frame(time, bytes(value.pack(codec))))

    def _collect(self, time: float) -> None:
        """Put what the vehicle has sent on its way down."""
        for frame in self._vehicle.advance(time):
            reboots = self._faults.reboot_at
            if self._passes(frame):
                self._down.send(frame)
            elif self.counted == reboots:
                # What the vehicle had queued behind this frame is gone with it.
                return

    def _passes(self, frame: Frame) -> bool:
        """Count a frame, and do what is to be done at its number."""
        if self.dead:
            return False
        if message_id(frame.data) in self._faults.counted:
            self.counted += 1
            if self.counted == self._faults.dead_at:
                self.dead = True
                return False
            if self.counted == self._faults.reboot_at:
                self._vehicle.reboot()
                return False
            if self.counted == self._faults.arm_at:
                self._vehicle.arm()
        return True


class _Direction:
    """Frames under way."""

    def __init__(self, faults: Faults, rng: np.random.Generator) -> None:
        self._faults = faults
        self._rng = rng
        self._under_way: list[tuple[float, int, bytes]] = []
        self._sent = 0

    def send(self, frame: Frame) -> None:
        faults = self._faults
        lost, doubled, held, spoiled = self._rng.random(4) < (
            faults.loss,
            faults.duplication,
            faults.reordering,
            faults.corruption,
        )
        if lost:
            return
        data = self._spoil(frame.data) if spoiled else frame.data
        due = frame.time + faults.latency_s + (_HELD_BACK_S if held else 0.0)
        for _ in range(2 if doubled else 1):
            heapq.heappush(self._under_way, (due, self._sent, data))
            self._sent += 1

    def arrived(self, time: float) -> list[Frame]:
        frames = []
        while self._under_way and self._under_way[0][0] <= time:
            due, _, data = heapq.heappop(self._under_way)
            frames.append(Frame(due, data))
        return frames

    def _spoil(self, data: bytes) -> bytes:
        """Turn one bit over."""
        place = int(self._rng.integers(8 * len(data)))
        spoiled = bytearray(data)
        spoiled[place // 8] ^= 1 << place % 8
        return bytes(spoiled)
