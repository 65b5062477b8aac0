"""The two clocks a link needs, so that tests and replays can bring their own."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Time that only grows, for timers, and the calendar's, for stamps in a log."""

    def monotonic(self) -> float:
        """Seconds from an arbitrary instant, never decreasing."""
        ...

    def unix_us(self) -> int:
        """Microseconds since 1970."""
        ...


class SystemClock:
    """The computer's clocks."""

    def monotonic(self) -> float:
        """Seconds of the system's monotonic clock."""
        return time.monotonic()

    def unix_us(self) -> int:
        """Microseconds since 1970 by the system's calendar clock."""
        return time.time_ns() // 1000
