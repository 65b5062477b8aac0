"""Questions under way: a few at a time, each asked again until answered or given up.

Rules
-----
1. At most ``window`` questions wait for an answer at any time: ArduPilot holds
   20 read requests and drops the rest.
2. A question without answer is asked again after ``retry_after`` seconds, at
   most ``attempts`` times. At 30 % loss each way an exchange succeeds every
   second time, so 25 attempts fail once in 10⁷.
3. An answer that is not the wanted one may be older than the question: it does
   not close the question, but is counted once an asking.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

_MISTAKEN = 1e-8

Key = TypeVar("Key", str, int)


@dataclass(frozen=True)
class Timing:
    """Patience of the parameter protocol, in seconds and counts.

    Attributes
    ----------
    retry_after
        Time to wait for an answer; longer than a slow radio's round trip.
    window
        Questions under way at once.
    attempts
        Times a question is asked before silence is the answer.
    quiet
        Longest time a message may spend on its way. After this long without
        sending, nothing sent earlier can still take effect.
    storing
        Time in which an autopilot has stored a write for good, where it writes in the background.
    silence
        Time without any message after which the link is lost.
    heartbeat_gap
        Time without heartbeat after which the vehicle may have been another,
        or rebooted: nothing known before counts.
    restarts
        Times everything may be verified anew before it counts as failure.
    limit
        Longest time of a whole write, and again of its roll-back.
    """

    retry_after: float = 0.7
    window: int = 12
    attempts: int = 25
    quiet: float = 2.0
    storing: float = 1.0
    silence: float = 10.0
    heartbeat_gap: float = 5.0
    restarts: int = 8
    limit: float = 120.0


@dataclass
class _Question:
    attempts: int = 0
    due: float = 0.0
    differing: int = 0
    last_differing: int = 0


class Exchange(Generic[Key]):
    """Questions by key; see the rules at the top of the file.

    Parameters
    ----------
    keys
        What is asked, in the order of asking.
    timing
        Patience.
    """

    def __init__(self, keys: Iterable[Key], timing: Timing) -> None:
        self._open: dict[Key, _Question] = {key: _Question() for key in keys}
        self._timing = timing
        self.total = len(self._open)
        self._askings_of_answered = 0

    @property
    def open(self) -> tuple[Key, ...]:
        """Questions without an answer so far."""
        return tuple(self._open)

    @property
    def answered(self) -> int:
        """Number of questions answered."""
        return self.total - len(self._open)

    @property
    def telling_attempts(self) -> int:
        """Askings after which silence means that there is no answer.

        From how often the other questions had to be asked: a question that
        has an answer stays silent so often once in 10⁸ times.
        """
        failures = self._askings_of_answered - self.answered
        failure_rate = (failures + 1) / (self._askings_of_answered + 2)
        needed = math.ceil(math.log(_MISTAKEN) / math.log(failure_rate))
        return min(needed, self._timing.attempts)

    def attempts(self, key: Key) -> int:
        """How often an open question has been asked."""
        return self._open[key].attempts

    def ask(self, now: float) -> list[tuple[Key, int]]:
        """Questions to be sent now, each with how often it has been asked, this time included."""
        room = self._timing.window - sum(self._waiting(q, now) for q in self._open.values())
        asked: list[tuple[Key, int]] = []
        for key, question in self._open.items():
            if len(asked) >= room:
                break
            if self._waiting(question, now) or question.attempts >= self._timing.attempts:
                continue
            question.attempts += 1
            question.due = now + self._timing.retry_after
            asked.append((key, question.attempts))
        return asked

    def answer(self, key: Key) -> bool:
        """Take the wanted answer; tells whether the question had been asked and was open."""
        question = self._open.get(key)
        if question is None or question.attempts == 0:
            return False
        del self._open[key]
        self._askings_of_answered += question.attempts
        return True

    def differ(self, key: Key) -> int:
        """Take an answer that is not the wanted one; tells how many askings got such."""
        question = self._open.get(key)
        if question is None or question.attempts == 0:
            return 0
        if question.last_differing != question.attempts:
            question.last_differing = question.attempts
            question.differing += 1
        return question.differing

    def unanswered(self, now: float, attempts: int | None = None) -> tuple[Key, ...]:
        """Questions that stayed without answer each time they were asked.

        Parameters
        ----------
        now
            The time, seconds.
        attempts
            So many times; as often as anything is asked at all unless given.
        """
        limit = self._timing.attempts if attempts is None else attempts
        return tuple(
            key
            for key, question in self._open.items()
            # One asked again meanwhile stayed without answer before: it need not wait for the rest.
            if question.attempts > limit
            or (question.attempts == limit and not self._waiting(question, now))
        )

    def wake(self, now: float) -> float:
        """When there is something to ask, or to give up, if no answer comes before."""
        waiting = [q.due for q in self._open.values() if self._waiting(q, now)]
        askable = any(
            not self._waiting(q, now) and q.attempts < self._timing.attempts
            for q in self._open.values()
        )
        if askable and len(waiting) < self._timing.window:
            return now
        return min(waiting, default=now)

    @staticmethod
    def _waiting(question: _Question, now: float) -> bool:
        return question.attempts > 0 and now < question.due
