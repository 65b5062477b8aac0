"""How good the link is: losses, rates, round trip, gaps. No input or output happens here."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

WINDOW_S = 5
"""Rates and recent loss are over the last five seconds."""

_LATE = 128
_LATE_IN_A_ROW = 3


@dataclass(frozen=True)
class Gap:
    """A stretch in which nothing came from the vehicle.

    Attributes
    ----------
    start, end
        Seconds of the link's clock; ``end`` is infinite while the gap lasts.
    """

    start: float
    end: float = math.inf

    @property
    def duration(self) -> float:
        """Seconds from the last frame before to the first after."""
        return self.end - self.start


@dataclass(frozen=True)
class LinkStatistics:
    """A link as it stands now.

    Attributes
    ----------
    up
        The vehicle was heard within the last three seconds.
    bytes_received, frames, skipped
        Bytes received, frames taken, and bytes that belong to no frame.
    refused, signed
        Frames refused for want of the right signature, and frames taken that carry one.
    lost
        Frames of the vehicle that its sequence numbers say never came.
    loss
        Share of the vehicle's frames lost in the last seconds, 0 … 1.
    round_trip_s
        Latest TIMESYNC round trip in seconds; NaN until one came back.
    rates
        Message name to Hz over the last seconds.
    gaps
        Every gap so far, oldest first.
    reopened, unsent
        Times the address was opened again, and messages that found it closed.
    """

    up: bool
    bytes_received: int
    frames: int
    skipped: int
    refused: int
    signed: int
    lost: int
    loss: float
    round_trip_s: float
    rates: Mapping[str, float]
    gaps: tuple[Gap, ...]
    reopened: int = 0
    unsent: int = 0


class SequenceCounter:
    """Counts the frames one sender lost on the way, from its running numbers modulo 256."""

    def __init__(self) -> None:
        self.lost = 0
        self._last: int | None = None
        self._late = 0

    def restart(self) -> None:
        """Take the next number as it comes, because the sender or the connection is new."""
        self._last = None

    def heard(self, sequence: int) -> int:
        """Account for one frame; gives how many are newly known to be lost."""
        step = 0 if self._last is None else (sequence - self._last - 1) % 256
        if step >= _LATE:
            # Repeated or overtaken frames come singly; a run of them is a sender that started over.
            self._late += 1
            if self._late < _LATE_IN_A_ROW:
                return 0
            step = 0
        self._late = 0
        self._last = sequence
        self.lost += step
        return step


@dataclass
class _Second:
    """What came within one second of the link's clock."""

    index: int
    lost: int = 0
    names: Counter[str] = field(default_factory=Counter)


class RateMeter:
    """Rates of messages, and the share lost, over the last whole seconds."""

    def __init__(self) -> None:
        self._seconds: deque[_Second] = deque()
        self._began: float | None = None

    def heard(self, name: str, lost: int, now: float) -> None:
        """Account for one message, and for the frames lost before it."""
        if self._began is None:
            self._began = now
        second = self._current(now)
        second.names[name] += 1
        second.lost += lost

    def rates(self, now: float) -> Mapping[str, float]:
        """Message name to Hz."""
        total: Counter[str] = Counter()
        for second in self._within(now):
            total.update(second.names)
        span = self._span(now)
        return MappingProxyType({name: count / span for name, count in sorted(total.items())})

    def loss(self, now: float) -> float:
        """Share of frames lost, 0 … 1."""
        window = self._within(now)
        lost = sum(second.lost for second in window)
        came = sum(second.names.total() for second in window)
        return lost / (lost + came) if lost else 0.0

    def _current(self, now: float) -> _Second:
        index = math.floor(now)
        if not self._seconds or self._seconds[-1].index < index:
            self._seconds.append(_Second(index))
            while self._seconds[0].index < index - WINDOW_S:
                self._seconds.popleft()
        return self._seconds[-1]

    def _within(self, now: float) -> list[_Second]:
        return [second for second in self._seconds if second.index >= math.floor(now) - WINDOW_S]

    def _span(self, now: float) -> float:
        start = float(math.floor(now) - WINDOW_S)
        if self._began is not None:
            start = max(start, self._began)
        return max(now - start, 1.0)
