"""What a vehicle's clock tells of it: how far away it is, and whether it has rebooted."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.link.framing import Message

TIMESYNC_S = 2.0
_CLOCK_BACK_MS = 2000
_CLOCK_BACK_TIMES = 3
_OUTSTANDING = 16


class VehicleClock:
    """Asks the time, and watches it run.

    Attributes
    ----------
    round_trip_s
        There and back, seconds; NaN before the first answer.
    """

    def __init__(self) -> None:
        self.round_trip_s = math.nan
        self._asked_at: dict[int, float] = {}
        self._next = -math.inf
        self._boot_ms = -math.inf
        self._suspects = 0

    def due(self, now: float) -> list[Message]:
        """The question, where it is time for it."""
        if now < self._next:
            return []
        self._next = now + TIMESYNC_S
        stamp = max(1, round(now * 1e9))
        self._asked_at[stamp] = now
        while len(self._asked_at) > _OUTSTANDING:
            del self._asked_at[next(iter(self._asked_at))]
        return [mavlink.MAVLink_timesync_message(0, stamp)]

    def heard(self, message: Message, now: float) -> bool:
        """Take a message of the vehicle; tell whether it shows that it has rebooted."""
        if message.get_type() == "TIMESYNC" and message.tc1 != 0:
            asked = self._asked_at.pop(message.ts1, None)
            if asked is not None:
                self.round_trip_s = now - asked
        boot_ms = getattr(message, "time_boot_ms", None)
        return boot_ms is not None and self._ran_back(boot_ms)

    def _ran_back(self, boot_ms: float) -> bool:
        if boot_ms >= self._boot_ms - _CLOCK_BACK_MS:
            self._suspects = 0
            self._boot_ms = max(self._boot_ms, boot_ms)
            return False
        self._suspects += 1
        if self._suspects < _CLOCK_BACK_TIMES:
            return False
        self._suspects = 0
        self._boot_ms = boot_ms
        return True
