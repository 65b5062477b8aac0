"""Fits what has been recorded so far, again and again, within a bound of the processor.

Two kinds of work take turns. A *full* analysis chooses method and control quantity and
judges; it is done as often as its share of the processor allows. In between a *refresh* brings
its numbers up to date, each second where that is cheap enough.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from magcomp.analysis.analyse import Options, analyse
from magcomp.errors import MagcompError, unforeseen
from magcomp.geometry import horizontal_part
from magcomp.live.refresh import refresh
from magcomp.model import Analysis, MotorFit, Recording

DEFAULT_SHARE = 0.08
"""Share of one core that all this may take, on average."""

LEAST_PAUSE_S = 1.0
SAME_DEG = 0.3
"""Answers whose largest difference in heading is below this say the same."""

_FULL_SHARE = 0.45
"""Part of the share that goes to full analyses."""


@dataclass(frozen=True, eq=False)
class Refit:
    """How the fitting stands.

    Attributes
    ----------
    analysis
        The newest full one; None before the first.
    fresh
        Its fits by compass, brought up to date since; for the eye.
    stable
        Full analyses in a row that said the same as the one before.
    trouble
        Why the last attempt gave none; empty where it did.
    full, refreshed
        How many of each were done.
    hurried
        How many full ones were done because somebody waited for them.
    full_cost_s, refresh_cost_s
        Processor seconds of the last of each.
    """

    analysis: Analysis | None = None
    fresh: Mapping[int, MotorFit] = field(default_factory=dict)
    stable: int = 0
    trouble: str = ""
    full: int = 0
    refreshed: int = 0
    hurried: int = 0
    full_cost_s: float = 0.0
    refresh_cost_s: float = 0.0


class Refitter:
    """Works in a thread of its own until closed.

    Parameters
    ----------
    recording
        Gives what is recorded so far; may raise MagcompError.
    options
        What to fit and how.
    share
        See :data:`DEFAULT_SHARE`.
    """

    def __init__(
        self,
        recording: Callable[[], Recording],
        options: Options,
        *,
        share: float = DEFAULT_SHARE,
    ) -> None:
        self._recording = recording
        self._options = options
        self._full_share = share * _FULL_SHARE
        self._refresh_share = share * (1.0 - _FULL_SHARE)
        self._state = Refit()
        self._full_at = -math.inf
        self._stop = threading.Event()
        self._hurry = threading.Event()
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name="magcomp-refit", daemon=True)
        self._thread.start()

    @property
    def state(self) -> Refit:
        """How it stands now."""
        return self._state

    def hurry(self) -> None:
        """Make a full analysis at once, of all there is by now: somebody waits for it."""
        self._hurry.set()
        self._wake.set()

    def close(self) -> None:
        """End after the fit under way."""
        self._stop.set()
        self._wake.set()
        self._thread.join()

    def _run(self) -> None:
        pause = LEAST_PAUSE_S
        while not self._waited(pause):
            begun, cpu = time.monotonic(), time.thread_time()
            hurried = self._hurry.is_set()
            self._hurry.clear()
            full = hurried or self._state.analysis is None or self._full_is_due(begun)
            try:
                state = self._analysed() if full else self._refreshed()
            except Exception as error:
                state = replace(self._state, stable=0, trouble=unforeseen(error))
            cost = time.thread_time() - cpu
            if full:
                self._full_at = begun
                self._state = replace(state, full_cost_s=cost, hurried=state.hurried + hurried)
            else:
                self._state = replace(state, refresh_cost_s=cost)
            pause = max(LEAST_PAUSE_S, self._state.refresh_cost_s / self._refresh_share)
            if self._state.analysis is None:
                pause = max(pause, cost / self._full_share)

    def _waited(self, seconds: float) -> bool:
        """Rest, unless somebody is in a hurry; tell whether it is over."""
        self._wake.wait(seconds)
        self._wake.clear()
        return self._stop.is_set()

    def _full_is_due(self, now: float) -> bool:
        return (now - self._full_at) * self._full_share >= self._state.full_cost_s

    def _analysed(self) -> Refit:
        before = self._state
        try:
            analysis = analyse(self._recording(), self._options)
        except MagcompError as error:
            return replace(before, stable=0, trouble=str(error), full=before.full + 1)
        same = before.analysis is not None and change_deg(before.analysis, analysis) < SAME_DEG
        return replace(
            before,
            analysis=analysis,
            fresh={result.fit.compass: result.fit for result in analysis.compasses},
            stable=before.stable + 1 if same else 0,
            trouble="",
            full=before.full + 1,
        )

    def _refreshed(self) -> Refit:
        before = self._state
        if before.analysis is None:
            return before
        try:
            fresh = refresh(self._recording(), before.analysis)
        except MagcompError as error:
            return replace(before, trouble=str(error))
        return replace(
            before,
            fresh={**before.fresh, **fresh},
            trouble="",
            refreshed=before.refreshed + 1,
        )


def change_deg(before: Analysis, after: Analysis) -> float:
    """Largest change of heading between two answers, degrees; infinite where not comparable.

    Notes
    -----
    A change of the field across the horizontal field is a change of heading (docs/method.md,
    Equation 9).
    """
    old = {result.fit.compass: result for result in before.compasses}
    new = {result.fit.compass: result for result in after.compasses}
    if old.keys() != new.keys():
        return math.inf
    if any(old[number].verdict.grade is not new[number].verdict.grade for number in new):
        return math.inf
    return max(_change_deg(old[number].fit, new[number].fit) for number in new)


def _change_deg(old: MotorFit, new: MotorFit) -> float:
    if old.regressor != new.regressor:
        return math.inf
    horizontal = horizontal_part(new.strength, new.vertical)
    moved = float(np.linalg.norm(new.interference - old.interference)) * new.u_high
    return math.degrees(moved / horizontal)
