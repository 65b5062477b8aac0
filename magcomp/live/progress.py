"""What a recording has gained so far: headings with their loads, the bound, and enough."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from magcomp.live.forecast import FEWEST, seconds_until
from magcomp.live.guide import FINE_DEG, LONG_S, Guidance
from magcomp.live.situation import Situation, Vector
from magcomp.model import Analysis, Grade

HEADINGS = 24
"""Sectors of the heading ring, 15° each; the first begins at north."""

_LONGEST_STEP_RAD = math.radians(90.0)
_MOST_BOUNDS = 60
_HOVER_SHARE = 0.05
"""Loads below this share of the largest are no flight: motors that idle on the ground."""


@dataclass(frozen=True)
class Bound:
    """What the newest analysis promises at the load of the flight.

    Attributes
    ----------
    u
        Control quantity that was in use half of the time: the hover. Amperes, or 0 … 1.
    regressor
        Which.
    degrees
        Heading error of the worst compass that is not rejected, at most (95 %): one for each
        analysis so far that gave one, oldest first.
    enough_at_s
        Seconds of recording at which it is likely to be enough; None where nobody can tell.
    """

    u: float
    regressor: str
    degrees: tuple[float, ...]
    enough_at_s: float | None = None


class HeadingRing:
    """Remembers the largest throttle at which the vehicle was heading each way."""

    def __init__(self) -> None:
        self._best = [math.nan] * HEADINGS
        self._last: float | None = None

    @property
    def best(self) -> tuple[float, ...]:
        """Largest throttle by sector, 0 … 1; NaN where it was never headed."""
        return tuple(self._best)

    def look(self, armed: bool | None, attitude: Vector | None, throttle: float | None) -> None:
        """Take one look; sectors passed since the last one count as seen."""
        if not armed or attitude is None or throttle is None:
            self._last = None
            return
        yaw = attitude[2]
        turned = 0.0 if self._last is None else math.remainder(yaw - self._last, math.tau)
        steps = 1 + int(abs(turned) / (math.tau / HEADINGS))
        if abs(turned) > _LONGEST_STEP_RAD:  # too far for one look: what lay between is not known
            turned, steps = 0.0, 1
        for step in range(steps):
            sector = int(((yaw - turned * step / steps) / math.tau % 1.0) * HEADINGS) % HEADINGS
            self._best[sector] = float(np.fmax(self._best[sector], throttle))
        self._last = yaw


class HoverBound:
    """Follows the bound at the load of the flight, from analysis to analysis."""

    def __init__(self) -> None:
        self._loads: dict[str, Counter[float]] = {}
        self._analysis: Analysis | None = None
        self._bound: Bound | None = None
        self._flown_s = 0.0
        self._last_s = 0.0
        self._largest: list[tuple[float, float]] = []

    @property
    def bound(self) -> Bound | None:
        """The newest; None before the first analysis that gives one."""
        return self._bound

    def look(
        self,
        armed: bool | None,
        loads: dict[str, float | None],
        analysis: Analysis | None,
        recorded_s: float,
    ) -> None:
        """Take one look at the loads, by control quantity, and the newest analysis so far."""
        if armed:
            self._flown_s += max(recorded_s - self._last_s, 0.0)
        self._last_s = recorded_s
        for regressor, load in loads.items():
            if armed and load is not None:
                self._loads.setdefault(regressor, Counter())[round(load, 2)] += 1
        if analysis is None or analysis is self._analysis:
            return
        self._analysis = analysis
        found = hover_bound(analysis, {name: _hover(c) for name, c in self._loads.items()})
        if found is None:
            return
        before = () if self._bound is None else self._bound.degrees
        self._largest = [
            *self._largest[1 - _MOST_BOUNDS :],
            (self._flown_s, largest_bound(analysis)),
        ]
        self._bound = replace(
            found,
            degrees=(*before, *found.degrees)[-_MOST_BOUNDS:],
            enough_at_s=self._enough_at_s(recorded_s),
        )

    def _enough_at_s(self, recorded_s: float) -> float | None:
        """When the guide will be content with the bound: it is fine, or waited for long enough."""
        fine = seconds_until(FINE_DEG, self._largest)
        if len(self._largest) < FEWEST or recorded_s >= LONG_S:
            return None
        return LONG_S if fine is None else min(recorded_s + fine - self._flown_s, LONG_S)


def largest_bound(analysis: Analysis | None) -> float:
    """Largest heading error, 95 %, of the compasses not rejected, degrees; infinite without one."""
    errors = [
        error.p95
        for result in (analysis.compasses if analysis else ())
        if result.verdict.grade is not Grade.REJECTED
        for error in result.verdict.heading_error
    ]
    return max(errors, default=math.inf)


def hover_bound(analysis: Analysis, hover: dict[str, float]) -> Bound | None:
    """The bound of one analysis at the hover; None where every compass is rejected.

    Parameters
    ----------
    analysis
        Of the recording so far.
    hover
        Control quantity at the hover, by name; without one the middle of what was covered.
    """
    kept = [c for c in analysis.compasses if c.verdict.grade is not Grade.REJECTED]
    if not kept:
        return None
    first = kept[0]
    covered, regressor = first.verdict.coverage, first.fit.regressor
    u = hover.get(regressor, 0.5 * (covered.u_low + covered.u_high))
    worst = 0.0
    for result in kept:
        rows = result.verdict.heading_error
        if rows:
            worst = max(worst, float(np.interp(u, [r.u for r in rows], [r.p95 for r in rows])))
    return Bound(u, regressor, (worst,))


def _hover(loads: Counter[float]) -> float:
    """Median of the loads that are more than an idle."""
    most = max(loads)
    flown = sorted((load, n) for load, n in loads.items() if load >= _HOVER_SHARE * most)
    half = 0.5 * sum(n for _, n in flown)
    for load, n in flown:
        half -= n
        if half <= 0.0:
            return load
    return most


class Enough:
    """Keeps what is enough from falling: data do not become fewer."""

    def __init__(self) -> None:
        self._shares: dict[Situation, float] = {}
        self._over: set[Situation] = set()

    def reached(self, situation: Situation) -> bool:
        """Whether it was enough once, in this way of recording."""
        return situation in self._over

    def look(self, situation: Situation, guidance: Guidance) -> Guidance:
        """The guidance, with a share that is the largest so far."""
        # Whoever stands on the ground records nothing: what there is stays as it was.
        others = self._shares.values() if situation is Situation.GROUND else ()
        share = max(self._shares.get(situation, 0.0), guidance.share_done, *others)
        self._shares[situation] = share
        if guidance.enough:
            self._over.add(situation)
        return replace(guidance, share_done=share)


class Early:
    """Tells a verdict on too little from one that counts."""

    def __init__(self) -> None:
        self._until_s = 0.0

    def look(self, guidance: Guidance, seconds: float, analysis: Analysis | None) -> bool:
        """Whether a verdict against a compass is too early.

        Parameters
        ----------
        guidance
            As it is now.
        seconds
            Recorded by now.
        analysis
            The newest; it may have been made when there was too little.
        """
        if guidance.early:
            self._until_s = seconds
        return guidance.early or (analysis is not None and analysis.duration_s < self._until_s)
