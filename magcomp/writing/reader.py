"""Reading parameters: the whole list, or some names. No I/O, no clock.

States and what leaves them
---------------------------
======== ============================ ===========================================
state    sends                        until
======== ============================ ===========================================
LISTING  PARAM_REQUEST_LIST           all indices came → DONE; the stream pauses
                                      → FILLING (something came) or asks again
FILLING  PARAM_REQUEST_READ by index  all indices came → DONE
NAMING   PARAM_REQUEST_READ by name   all names came, or stay silent → DONE
SHIFTING nothing                      ``quiet`` seconds passed → LISTING
DONE     nothing
FAILED   nothing
======== ============================ ===========================================

Rules
-----
1. In the list an index is a place, not a name: the count changes when a
   parameter such as COMPASS_PMOT_EN hides or shows others, and all places
   move. A changed count, or another name at a known place, begins anew.
2. Index 65535 is an echo of somebody's write: it renews a value already in
   the list and fills no place.
3. An unknown name is answered by silence (PARAM_ERROR on newer firmware). How
   often it must be asked before it counts as missing follows from how often
   the known ones had to be asked.
4. Without any message for ``silence`` seconds the link is lost.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

from magcomp.mavlink.parameters import NO_INDEX, ParamValue
from magcomp.writing.exchange import Exchange, Timing
from magcomp.writing.messages import (
    Incoming,
    Outgoing,
    ParamRefused,
    ReadAll,
    ReadIndex,
    ReadName,
)

_LIST_ATTEMPTS = 25
_DEAF_ATTEMPTS = 12
"""So often the first of many names are asked for before a vehicle counts as deaf."""


class ReaderState(Enum):
    """Where a reader is; see the table at the top of the file."""

    LISTING = "listing"
    FILLING = "filling"
    NAMING = "naming"
    SHIFTING = "shifting"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True)
class ReadProgress:
    """So many of so many parameters have come."""

    done: int
    total: int


class ParameterReader:
    """Reads all parameters of a vehicle, or those named.

    Parameters
    ----------
    names
        What to read; None for the whole list.
    now
        The time, in seconds from anywhere.
    timing
        Patience.

    Attributes
    ----------
    state
        See the table at the top of the file.
    failure
        Why it failed, as the end of a sentence; empty where it did not.
    """

    def __init__(
        self, names: Iterable[str] | None = None, *, now: float, timing: Timing | None = None
    ) -> None:
        self._timing = timing or Timing()
        self._values: dict[str, float] = {}
        self._missing: list[str] = []
        self._names: Exchange[str] = Exchange(names or (), self._timing)
        self._indices: Exchange[int] = Exchange((), self._timing)
        self._places: dict[int, str] = {}
        self._count: int | None = None
        self._asked = 0
        self._shifts = 0
        self._due = now
        self._heard = now
        self._reported = -1
        self.failure = ""
        self.state = ReaderState.LISTING if names is None else ReaderState.NAMING

    @property
    def finished(self) -> bool:
        """Whether nothing more will happen."""
        return self.state in {ReaderState.DONE, ReaderState.FAILED}

    @property
    def values(self) -> Mapping[str, float]:
        """What has been read so far, by name."""
        return dict(self._values)

    @property
    def answered(self) -> bool:
        """Whether the vehicle has answered anything that it was asked."""
        return bool(self._values or self._missing)

    @property
    def missing(self) -> tuple[str, ...]:
        """Names the vehicle does not know."""
        return tuple(self._missing)

    def handle(self, message: Incoming, now: float) -> None:
        """Take what the vehicle said."""
        self._heard = now
        match self.state, message:
            case ReaderState.NAMING, ParamValue(name=name, value=value):
                if self._names.answer(name):
                    self._values[name] = value
            case ReaderState.NAMING, ParamRefused(name=name):
                if self._names.answer(name):
                    self._missing.append(name)
            case ((ReaderState.LISTING | ReaderState.FILLING), ParamValue()):
                self._take_place(message, now)
            case _:
                pass

    def poll(self, now: float) -> tuple[list[ReadProgress], list[Outgoing]]:
        """Tell what is to be reported and sent now."""
        if not self.finished and now >= self._heard + self._timing.silence:
            self.abandon(f"nothing was heard for {self._timing.silence:.0f} s")
        outgoing: list[Outgoing] = []
        match self.state:
            case ReaderState.SHIFTING if now >= self._due:
                self.state, self._asked, self._count = ReaderState.LISTING, 0, None
                self._due = now
                outgoing = self._poll_listing(now)
            case ReaderState.LISTING:
                outgoing = self._poll_listing(now)
            case ReaderState.FILLING:
                outgoing = self._poll_filling(now)
            case ReaderState.NAMING:
                outgoing = self._poll_naming(now)
            case _:
                pass
        return self._progress(), outgoing

    def wake(self, now: float) -> float:
        """When to poll next, if nothing arrives before."""
        match self.state:
            case ReaderState.NAMING:
                due = self._names.wake(now)
            case ReaderState.FILLING:
                due = self._indices.wake(now)
            case _:
                due = self._due
        return min(due, self._heard + self._timing.silence)

    def stop(self, now: float) -> None:  # noqa: ARG002  the writer's machine needs the time
        """Give up because the user asks."""
        self.abandon("it was interrupted")

    def abandon(self, reason: str) -> None:
        """Give up; `reason` ends the sentence "the parameters could not be read: …"."""
        if not self.finished:
            self.state, self.failure = ReaderState.FAILED, reason

    def _take_place(self, message: ParamValue, now: float) -> None:
        if message.index == NO_INDEX or message.index >= message.count:
            if message.name in self._values:
                self._values[message.name] = message.value
            return
        if self._count is None:
            self._count = message.count
        known = self._places.setdefault(message.index, message.name)
        if message.count != self._count or known != message.name:
            self._shift(now)
            return
        self._values[message.name] = message.value
        self._indices.answer(message.index)
        self._due = now + self._timing.retry_after
        if len(self._places) == self._count:
            self.state = ReaderState.DONE

    def _shift(self, now: float) -> None:
        self._shifts += 1
        self._values.clear()
        self._places.clear()
        self._due = now + self._timing.quiet
        self.state = ReaderState.SHIFTING
        if self._shifts > self._timing.restarts:
            self.abandon("the vehicle's parameter list keeps changing")

    def _poll_listing(self, now: float) -> list[Outgoing]:
        if now < self._due:
            return []
        if self._count is not None:
            missing = sorted(set(range(self._count)) - self._places.keys())
            self._indices = Exchange(missing, self._timing)
            self.state = ReaderState.FILLING
            return self._poll_filling(now)
        if self._asked >= _LIST_ATTEMPTS:
            self.abandon("the vehicle does not send its parameter list")
            return []
        self._asked += 1
        self._due = now + self._timing.retry_after
        return [ReadAll()]

    def _poll_filling(self, now: float) -> list[Outgoing]:
        silent = self._indices.unanswered(now)
        if silent:
            self.abandon(f"the vehicle does not send parameter {silent[0]} of {self._count}")
            return []
        return [ReadIndex(index) for index, _ in self._indices.ask(now)]

    def _poll_naming(self, now: float) -> list[Outgoing]:
        if not self._names.open:
            self.state = ReaderState.DONE
            return []
        if self.answered:
            silent = self._names.unanswered(now, self._names.telling_attempts)
            # Only when nothing else is left to learn how lossy the link is.
            if len(silent) == len(self._names.open):
                self._missing.extend(silent)
                self.state = ReaderState.DONE
                return []
        elif self._is_deaf(now) or self._names.unanswered(now):
            self.abandon("the vehicle answers no parameter request")
            return []
        return [ReadName(name) for name, _ in self._names.ask(now)]

    def _is_deaf(self, now: float) -> bool:
        """Whether the vehicle speaks, but has long answered nothing."""
        speaks = now - self._heard < self._timing.quiet
        return speaks and bool(self._names.unanswered(now, _DEAF_ATTEMPTS))

    def _progress(self) -> list[ReadProgress]:
        if self.state is ReaderState.NAMING or self._names.total:
            done, total = self._names.answered, self._names.total
        else:
            done, total = len(self._places), self._count or 0
        if done == self._reported:
            return []
        self._reported = done
        return [ReadProgress(done, total)] if total else []
