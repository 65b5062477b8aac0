"""A link to a simulated vehicle without sockets, on a clock that only waiting moves."""

from __future__ import annotations

from collections import deque
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.simulate.faults import Machine
from magcomp.simulate.ground import Asker

_STEP_S = 0.01
_HEARTBEAT_S = 1.0


class LocalConnection:
    """Sends and receives pymavlink messages; an hour of silence takes a second.

    Parameters
    ----------
    machine
        A vehicle, or a bad link to one.
    now
        The machine's own time, seconds since power-up.
    """

    def __init__(self, machine: Machine, now: float = 0.0) -> None:
        self._machine = machine
        self._now = now
        self._asker = Asker()
        self._codec: Any = mavlink.MAVLink(None)
        self._arrived: deque[Any] = deque()
        self._next_heartbeat = now

    def clock(self) -> float:
        """Seconds since the vehicle's power-up."""
        return self._now

    def send(self, message: Any) -> None:
        """Send a message; whether it arrives is the machine's affair."""
        self._machine.receive(self._asker.pack(message), self._now)

    def receive(self, timeout: float) -> Any | None:
        """Next message, or None after ``timeout`` seconds of the virtual clock."""
        until = self._now + timeout
        while not self._arrived and self._now < until:
            self._now = min(self._now + _STEP_S, until)
            if self._now >= self._next_heartbeat:
                self._next_heartbeat = self._now + _HEARTBEAT_S
                self._machine.receive(self._asker.heartbeat(), self._now)
            for frame in self._machine.advance(self._now):
                self._decode(frame.data)
        return self._arrived.popleft() if self._arrived else None

    def _decode(self, data: bytes) -> None:
        try:
            self._arrived.append(self._codec.decode(bytearray(data)))
        except mavlink.MAVError:
            # A link that corrupts frames: what does not pass its checksum never arrived.
            return
