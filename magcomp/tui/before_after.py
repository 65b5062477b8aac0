"""Each compass's heading as it was and as it is corrected, side by side, from one snapshot."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from magcomp import autopilots
from magcomp.geometry import heading
from magcomp.live.snapshot import CompassNow, LiveSnapshot
from magcomp.model import Analysis, FloatArray, InForce, quantity_of
from magcomp.tui.work import Work, Writing


@dataclass(frozen=True)
class HeadingPair:
    """One compass, degrees; None where not known.

    Attributes
    ----------
    compass
        1, 2 or 3.
    before, after
        With the calibration from before, and with the fit.
    moved_before, moved_after
        How far each has moved since the mark, −180 … 180.
    largest_before, largest_after
        The largest of these since the mark, without sign.
    """

    compass: int
    before: float | None
    after: float | None
    moved_before: float | None = None
    moved_after: float | None = None
    largest_before: float | None = None
    largest_after: float | None = None

    @property
    def correction(self) -> float | None:
        """What the new calibration takes out of the heading at this moment, degrees."""
        return _apart(self.after, self.before)


@dataclass(frozen=True)
class HeadingTrace:
    """A compass's headings in time.

    Attributes
    ----------
    seconds
        Before now, so from −60 to 0.
    before, after
        How far each has moved since the mark, degrees; NaN where not known or there is no mark.
    taken_out
        What the correction takes out of the heading, degrees; NaN where not known.
    """

    seconds: tuple[float, ...] = ()
    before: tuple[float, ...] = ()
    after: tuple[float, ...] = ()
    taken_out: tuple[float, ...] = ()


TRACE_S = 60.0


class HeadingWatch:
    """Remembers the headings at the mark, and how far they have moved since."""

    def __init__(self) -> None:
        self._times: deque[tuple[float, tuple[HeadingPair, ...]]] = deque()
        self._mark: dict[int, tuple[float | None, float | None]] | None = None
        self._largest: dict[int, tuple[float | None, float | None]] = {}

    @property
    def marked(self) -> bool:
        """There is a mark."""
        return self._mark is not None

    def mark(self, pairs: tuple[HeadingPair, ...]) -> None:
        """Measure from here."""
        self._mark = {pair.compass: (pair.before, pair.after) for pair in pairs}
        self._largest = {}
        self._times.clear()

    def unmark(self) -> None:
        """Forget the mark: who has moved on from there tells nothing by it."""
        if self._mark is not None:
            self._mark = None
            self._times.clear()

    def look(self, pairs: tuple[HeadingPair, ...], now: float) -> tuple[HeadingPair, ...]:
        """The pairs with how far they have moved; ``now`` in seconds."""
        moved = pairs if self._mark is None else tuple(map(self._moved, pairs))
        self._times.append((now, moved))
        while now - self._times[0][0] > TRACE_S:
            self._times.popleft()
        return moved

    def trace(self, compass: int) -> HeadingTrace:
        """The last minute of one compass."""
        last = self._times[-1][0] if self._times else 0.0
        rows = [
            (
                time - last,
                _known(pair.moved_before),
                _known(pair.moved_after),
                _known(pair.correction),
            )
            for time, pairs in self._times
            for pair in pairs
            if pair.compass == compass
        ]
        return HeadingTrace(*zip(*rows, strict=True)) if rows else HeadingTrace()

    def _moved(self, pair: HeadingPair) -> HeadingPair:
        marked = (self._mark or {}).get(pair.compass, (None, None))
        moved = (_apart(pair.before, marked[0]), _apart(pair.after, marked[1]))
        largest = self._largest.get(pair.compass, (None, None))
        largest = (_larger(largest[0], moved[0]), _larger(largest[1], moved[1]))
        self._largest[pair.compass] = largest
        return HeadingPair(pair.compass, pair.before, pair.after, *moved, *largest)


def heading_pairs(live: LiveSnapshot, work: Work, writing: Writing) -> tuple[HeadingPair, ...]:
    """Before and after for every compass that reports.

    Notes
    -----
    The vehicle reports with what is in force: before writing that is the old calibration, after
    it the new one. The other one is found by undoing what is in force.
    """
    return tuple(_pair(compass, live, work, writing) for compass in live.compasses)


def _pair(now: CompassNow, live: LiveSnapshot, work: Work, writing: Writing) -> HeadingPair:
    if writing.in_force:
        return HeadingPair(
            now.number, _with(now, live, writing.in_force, writing.before), now.heading_deg
        )
    after = now.heading_corrected_deg
    if work.analysis is not None:
        after = _with_fit(now, live, work.present, work.analysis)
    return HeadingPair(now.number, now.heading_deg, after)


def _with(
    now: CompassNow,
    live: LiveSnapshot,
    in_force: Mapping[str, float],
    wanted: Mapping[str, float],
) -> float | None:
    """Heading with another calibration than the one in force."""
    held, other = (_in_force(values, now, live) for values in (in_force, wanted))
    if held is None or other is None:
        return None
    u_held, u_other = _u(held, live), _u(other, live)
    if u_held is None or u_other is None:
        return None
    raw = held.correction.undo(np.array([now.field]), np.array([u_held]))
    return _heading(other.correction.apply(raw, np.array([u_other]))[0], live)


def _with_fit(
    now: CompassNow, live: LiveSnapshot, in_force: Mapping[str, float], analysis: Analysis
) -> float | None:
    """Heading with a fit that is not written yet."""
    result = next((c for c in analysis.compasses if c.fit.compass == now.number), None)
    held = _in_force(in_force, now, live)
    if result is None or held is None:
        return None
    u_held = _u(held, live)
    u = quantity_of(result.fit.regressor).of(current=live.current, throttle=live.throttle)
    if u is None or u_held is None:
        return None
    raw = held.correction.undo(np.array([now.field]), np.array([u_held]))
    return _heading(result.fit.correction.apply(raw, np.array([u]))[0], live)


def _in_force(values: Mapping[str, float], now: CompassNow, live: LiveSnapshot) -> InForce | None:
    """What parameters do to a compass; None before the vehicle is known."""
    if live.vehicle is None:
        return None
    return autopilots.of(live.vehicle).in_force(values, now.number)


def _u(in_force: InForce, live: LiveSnapshot) -> float | None:
    """What the autopilot multiplies by; 0 where its compensation is off, None where not known."""
    if in_force.regressor is None:
        return 0.0
    quantity = quantity_of(in_force.regressor)
    return quantity.of(current=live.current, throttle=live.throttle) if quantity.is_told else None


def _heading(field: FloatArray, live: LiveSnapshot) -> float | None:
    if live.attitude_deg is None:
        return None
    roll, pitch, _ = np.radians(live.attitude_deg)
    return math.degrees(float(heading(field, roll, pitch))) % 360.0


def _apart(one: float | None, other: float | None) -> float | None:
    if one is None or other is None:
        return None
    return (one - other + 180.0) % 360.0 - 180.0


def _larger(largest: float | None, moved: float | None) -> float | None:
    if moved is None:
        return largest
    return abs(moved) if largest is None else max(largest, abs(moved))


def _known(value: float | None) -> float:
    return math.nan if value is None else value
