"""What the screens are given to draw: everything in hand at one instant, frozen."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from magcomp.analysis import Options
from magcomp.live.situation import Manoeuvre
from magcomp.live.snapshot import LiveSnapshot
from magcomp.tui.choices import Choice
from magcomp.tui.work import Work, Writing

_WORTH_FITTING_S = 10.0


@dataclass(frozen=True)
class Busy:
    """What is being done.

    Attributes
    ----------
    what
        In words.
    share
        Done, 0 … 1.
    """

    what: str
    share: float = 0.0

    @property
    def sentence(self) -> str:
        """For the next line."""
        share = f" … {100 * self.share:.0f} %" if self.share else ""
        return f"Wait: {self.what}{share}"


@dataclass(frozen=True, eq=False)
class State:
    """Everything in hand.

    Attributes
    ----------
    work, writing
        One vehicle's or log's work, and what would be written or was.
    live
        The newest snapshot of the vehicle; None for a log.
    busy
        What is being done; None while nothing is.
    choices
        What can be connected to or opened.
    asked
        Options of the fit tried last, whether or not it could be.
    manoeuvre
        What the user says that is being done with the vehicle; None where that is found out.
    """

    work: Work = field(default_factory=Work)
    writing: Writing = field(default_factory=Writing)
    live: LiveSnapshot | None = None
    busy: Busy | None = None
    choices: tuple[Choice, ...] = ()
    asked: Options = field(default_factory=Options)
    manoeuvre: Manoeuvre | None = None

    @property
    def unfitted_s(self) -> float:
        """How long the motors ran since the fit shown, seconds; 0 where it was told an end."""
        work = self.work
        if self.live is None or work.recording is None or math.isfinite(work.options.end):
            return 0.0
        return max(self.live.armed_until_s - work.recording.duration_s, 0.0)

    @property
    def is_outdated(self) -> bool:
        """So much was flown since the fit shown that it is worth another one."""
        return self.work.analysis is not None and self.unfitted_s >= _WORTH_FITTING_S

    @property
    def early(self) -> bool:
        """Too little is recorded yet for a verdict against a compass."""
        return self.live is not None and self.live.early
