"""What a sweep tells while it goes on, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from magcomp.sweeping.steps import Measured, Step


class Stage(Enum):
    """Where a sweep is; see the table at the top of protocol.py."""

    CONFIRM = "confirm"
    REST = "rest"
    SPIN = "spin"
    HALT = "halt"
    OVER = "over"


class Reason(Enum):
    """Why a sweep ended before it was complete."""

    KEY = "a key was pressed"
    INTERRUPTED = "it was interrupted"
    LINK_LOST = "the link was lost"
    ARMED = "the vehicle is armed"
    FLYING = "the vehicle is in the air"
    TILTED = "the vehicle tilted or turned"
    MOVED = "the vehicle moved"
    REFUSED = "the vehicle refused"
    UNANSWERED = "the vehicle did not answer"
    NO_CURRENT = "the current is not told"
    DEAF = "the screen takes no key any more"
    ERROR = "an error in the program"


@dataclass(frozen=True)
class Begun:
    """A step's motors spin from now on.

    Attributes
    ----------
    step, number
        Which, and its number from 1.
    """

    step: Step
    number: int


@dataclass(frozen=True)
class Told:
    """A step was carried out, and what it drew."""

    measured: Measured


@dataclass(frozen=True)
class Stopping:
    """Everything is being stopped."""

    reason: Reason
    why: str


@dataclass(frozen=True)
class Outcome:
    """How a sweep ended; all motors were told to stand still.

    Attributes
    ----------
    done
        The steps carried out whole.
    reason
        None where it is complete.
    why
        The reason in a clause.
    """

    done: tuple[Measured, ...]
    reason: Reason | None = None
    why: str = ""


Event = Begun | Told | Stopping | Outcome
