"""Proof that nothing sent before can still arrive. No I/O, no clock.

An answer of the parameter protocol does not say which question it answers, so an old one looks
like a new one. A TIMESYNC does: it comes back with the number it was sent with, and a link keeps
what it carries in order. Once it is back, all questions asked before it have reached the vehicle,
and all answers given before it have reached us.

A vehicle that answers no TIMESYNC leaves only time: ``quiet`` seconds, or as long as an answer
has ever taken since its question was first asked.
"""

from __future__ import annotations

from collections import deque

from magcomp.writing.exchange import Timing
from magcomp.writing.messages import Ping, Pong

_OVERTAKEN_S = 0.1  # ArduPilot answers a read from a queue, which a TIMESYNC passes by
_REMEMBERED = 8
_MARGIN = 2.0
_TOKENS = 64


class Fence:
    """Asks until it is known that nothing sent before is still under way.

    Parameters
    ----------
    now
        The time, in seconds from anywhere.
    timing
        Patience.
    """

    def __init__(self, now: float, timing: Timing) -> None:
        self._timing = timing
        self._raised_at = now
        self._tokens: dict[int, float] = {}
        self._round_trips: deque[float] = deque(maxlen=_REMEMBERED)
        self._slowest_answer = 0.0
        self._answers = False
        self._due = now
        self._back_at: float | None = None
        self._asked = 0

    def up(self, now: float) -> None:
        """Begin: only what is sent from now on proves anything."""
        self._raised_at = self._due = now
        self._back_at = None
        self._asked = 0

    def ask(self, now: float) -> list[Ping]:
        """What to send now."""
        if now < self._due or self._back_at is not None:
            return []
        self._due = now + self._timing.retry_after
        self._asked += 1
        # Nanoseconds, as everybody's; a clock that stands must not give one twice.
        token = max(max(self._tokens, default=0) + 1, round(now * 1e9))
        self._tokens[token] = now
        while len(self._tokens) > _TOKENS:
            del self._tokens[next(iter(self._tokens))]
        return [Ping(token)]

    def hear(self, pong: Pong, now: float) -> None:
        """Take an answer; those to other programs' questions are passed over."""
        sent = self._tokens.pop(pong.token, None)
        if sent is None:
            return
        self._answers = True
        self._round_trips.append(now - sent)
        if sent >= self._raised_at and self._back_at is None:
            self._back_at = now

    def answered(self, seconds: float) -> None:
        """An answer came so long after its question was first asked."""
        self._slowest_answer = max(self._slowest_answer, seconds)

    def passed(self, now: float, *, doubtful: bool) -> bool:
        """Whether nothing sent before it was raised is under way.

        Parameters
        ----------
        doubtful
            Something was asked more than once, so there may be answers that nobody waits for.
        """
        if self._answers:
            guard = _OVERTAKEN_S if doubtful else 0.0
            return self._back_at is not None and now >= self._back_at + guard
        return not doubtful or now >= self._raised_at + self.quiet

    def exhausted(self) -> bool:
        """Whether a vehicle that has answered before answers no more."""
        return self._answers and self._back_at is None and self._asked > self._timing.attempts

    @property
    def round_trip(self) -> float:
        """The longest of late, seconds; 0 before the first."""
        return max(self._round_trips, default=0.0)

    @property
    def quiet(self) -> float:
        """Seconds after which nothing sent earlier can arrive, as far as time can tell."""
        if self._round_trips:
            return max(self._timing.quiet, _MARGIN * self.round_trip)
        return max(self._timing.quiet, self._slowest_answer)

    def wake(self, now: float) -> float:
        """When to ask or look again, if nothing arrives before."""
        if self._back_at is not None:
            return max(now, self._back_at + _OVERTAKEN_S)
        return self._due if self._answers else min(self._due, self._raised_at + self.quiet)
