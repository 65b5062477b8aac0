"""What a write tells while it goes on, and how it ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum


class Stage(Enum):
    """Where a write is; see the table at the top of stages.py."""

    COMPARE = "compare"
    SETTLE = "settle"
    IDENTIFY = "identify"
    OFF = "off"
    WRITE = "write"
    VERIFY = "verify"
    ON = "on"
    CONFIRM = "confirm"
    OVER = "over"


class Reason(Enum):
    """Why a write did not do what was wanted."""

    ARMED = "armed"
    ANOTHER_VEHICLE = "another vehicle"
    CHANGED = "changed since the backup"
    REFUSED = "refused"
    MISMATCH = "mismatch"
    LINK_LOST = "link lost"
    TIMEOUT = "timeout"
    STOPPED = "stopped"
    JOURNAL = "journal cannot be written"
    ERROR = "an error in the program"


class Standing(Enum):
    """What the vehicle holds.

    UNSURE means the vehicle could not be asked any more. By the order of
    writing it holds everything as before, everything as wanted, or has its
    compensation switched off.
    """

    OLD = "everything as before"
    NEW = "everything as wanted"
    OFF = "compensation off, some values not restored"
    UNSURE = "not known"


@dataclass(frozen=True)
class Progress:
    """So many of the questions of a stage are answered."""

    stage: Stage
    name: str
    done: int
    total: int


@dataclass(frozen=True)
class Intends:
    """These values are about to be sent. Journals record it before anything is."""

    stage: Stage
    values: Mapping[str, float]


@dataclass(frozen=True)
class Written:
    """The vehicle confirmed a value."""

    name: str
    value: float


@dataclass(frozen=True)
class Mismatch:
    """The vehicle keeps answering another value."""

    name: str
    wanted: float
    received: float


@dataclass(frozen=True)
class Restarted:
    """The vehicle may have rebooted: everything is verified anew."""

    why: str


@dataclass(frozen=True)
class RollingBack:
    """The write failed; the old values are being put back."""

    reason: Reason
    why: str


@dataclass(frozen=True)
class Outcome:
    """How a write ended.

    Attributes
    ----------
    standing
        What the vehicle holds now.
    reason
        None where everything was written and verified.
    why
        The reason in a clause.
    """

    standing: Standing
    reason: Reason | None = None
    why: str = ""

    @property
    def good(self) -> bool:
        """Whether the vehicle holds what was wanted."""
        return self.reason is None


Event = Progress | Intends | Written | Mismatch | Restarted | RollingBack | Outcome
