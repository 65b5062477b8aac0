"""Fits what has been recorded so far, again and again, within a bound of the processor."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from magcomp.errors import MagcompError
from magcomp.model import Analysis, CompassResult, Recording
from magcomp.session.analyse import Options, analyse

DEFAULT_SHARE = 0.06
"""Share of one core that fitting may take, on average."""

LEAST_PAUSE_S = 1.0
SAME_DEG = 0.3
"""Answers whose largest difference in heading is below this say the same."""


@dataclass(frozen=True, eq=False)
class Refit:
    """How the fitting stands.

    Attributes
    ----------
    analysis
        The newest; None before the first.
    stable
        Analyses in a row that said the same as the one before.
    trouble
        Why the last attempt gave none; empty where it did.
    count, cost_s
        Attempts so far, and processor seconds of the last.
    """

    analysis: Analysis | None = None
    stable: int = 0
    trouble: str = ""
    count: int = 0
    cost_s: float = 0.0


class Refitter:
    """Works in a thread of its own until closed.

    After a fit that cost c processor seconds it rests until c is at most ``share`` of the time.

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
        self._share = share
        self._state = Refit()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="magcomp-refit", daemon=True)
        self._thread.start()

    @property
    def state(self) -> Refit:
        """How it stands now."""
        return self._state

    def close(self) -> None:
        """End after the fit under way."""
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        pause = LEAST_PAUSE_S
        while not self._stop.wait(pause):
            # The whole process: numpy has threads of its own that work for the fit.
            begun, cpu = time.monotonic(), time.process_time()
            self._state = self._refit()
            cost = time.process_time() - cpu
            self._state = _with_cost(self._state, cost)
            pause = max(LEAST_PAUSE_S, cost / self._share - (time.monotonic() - begun))

    def _refit(self) -> Refit:
        before = self._state
        try:
            analysis = analyse(self._recording(), self._options)
        except MagcompError as error:
            return Refit(before.analysis, 0, str(error), before.count + 1)
        same = before.analysis is not None and change_deg(before.analysis, analysis) < SAME_DEG
        return Refit(analysis, before.stable + 1 if same else 0, "", before.count + 1)


def _with_cost(state: Refit, cost: float) -> Refit:
    return Refit(state.analysis, state.stable, state.trouble, state.count, cost)


def change_deg(before: Analysis, after: Analysis) -> float:
    """Largest change of heading between two answers, degrees; infinite where not comparable.

    Notes
    -----
    A change of the field across the horizontal field is a change of heading (PAPER.md 9).
    """
    old = {result.fit.compass: result for result in before.compasses}
    new = {result.fit.compass: result for result in after.compasses}
    if old.keys() != new.keys():
        return float("inf")
    return max(_change_deg(old[number], new[number]) for number in new)


def _change_deg(before: CompassResult, after: CompassResult) -> float:
    old, new = before.fit, after.fit
    if (old.regressor, before.verdict.grade) != (new.regressor, after.verdict.grade):
        return float("inf")
    horizontal = float(np.sqrt(max(new.strength**2 - new.vertical**2, 1.0)))
    moved = np.linalg.norm(new.interference - old.interference) * new.u_high
    return float(np.degrees(moved / horizontal))
