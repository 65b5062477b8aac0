"""How a recording is being made: in the air, held in hand, tied down. No I/O, no clock.

Situations
----------
======== ============================================ ===========================================
GROUND   disarmed, and nothing recorded with motors   say how to begin
         on
UNSURE   motors on, not yet known                     turn it; no word of throttle
STILL    motors on, attitude as if nailed down        steps of the throttle, *if tied down*
HELD     motors on, tilted as nobody flies            turns at steady throttles
FLYING   motors on, a free body                       turn, climb, descend; never a throttle
======== ============================================ ===========================================

Rules
-----
1. A free body is told by its accelerometer. What holds a tilted vehicle pushes sideways as well, so
   it feels g · sin(tilt) across its own axis; a multirotor can only push along that axis, so while
   it gathers speed it feels nothing across it. Flights spend a third of their tilted time so, and a
   stand none of it.
2. Ground speed and height prove nothing: without a position the estimator drifts by metres.
   Height only keeps a vehicle from being taken for a nailed-down one.
3. Once flying, a vehicle counts as flying until it is disarmed; once held, as held. In doubt it
   may be in the air.
4. What the user says goes before all of this.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum

Vector = tuple[float, float, float]

G = 9.80665

RISEN_M = 1.5
"""Metres above where it was armed."""

TIPPED_RAD = math.radians(55.0)
"""A tilt that a multirotor flown for calibration does not have."""

TURNED_RAD = math.radians(30.0)
"""A vehicle that turns less than this stands still."""

RESTLESS_RAD = math.radians(0.4)
"""Roll or pitch within a few seconds that nothing nailed down shows, and every hover does."""

STILL_S = 8.0
BRIEF_S = 20.0
"""Motors on for less than this was a trial, and not a recording."""

_TIPPED_S = 0.4
_WINDOW_S = 1.0
_SWING_S = 4.0
_LEAST_TILT = math.sin(math.radians(5.0))
_FREE_ALONG = 0.5  # of what a vehicle at rest feels across its axis
_FREE_S = 1.0
_FREE_SHARE = 0.2
_LONGEST_STEP_S = 0.5


class Situation(StrEnum):
    """How the recording is being made; see the table at the top of the file."""

    GROUND = "ground"
    UNSURE = "unsure"
    STILL = "still"
    HELD = "held"
    FLYING = "flying"


class Manoeuvre(StrEnum):
    """What the user says that is being done: held on a stand, flown, or tied down."""

    STAND = "stand"
    FLIGHT = "flight"
    SWEEP = "sweep"


_SAID = {
    Manoeuvre.STAND: Situation.HELD,
    Manoeuvre.FLIGHT: Situation.FLYING,
    Manoeuvre.SWEEP: Situation.STILL,
}


@dataclass(frozen=True)
class Look:
    """What a vehicle says at a moment.

    Attributes
    ----------
    time
        Seconds of the vehicle's clock.
    armed
        None while unknown.
    attitude
        Roll, pitch, yaw in radians; None while unknown.
    height_m
        Above home; None while unknown.
    accel
        Specific force in body axes, m/s²; None while unknown.
    """

    time: float
    armed: bool | None
    attitude: Vector | None = None
    height_m: float | None = None
    accel: Vector | None = None


class SituationWatch:
    """Tells a vehicle that flies from one that is held or tied down.

    Fed with what the vehicle says, a few times a second.

    Attributes
    ----------
    manoeuvre
        What the user says; None to find out.
    """

    def __init__(self, manoeuvre: Manoeuvre | None = None) -> None:
        self.manoeuvre = manoeuvre
        self._found = Situation.GROUND
        self._armed_at: float | None = None
        self._last: float | None = None
        self._ground_m: float | None = None
        self._risen = False
        self._reference: Vector | None = None
        self._turned = False
        self._tipped_s = 0.0
        self._free_s = 0.0
        self._tilted_s = 0.0
        self._window: deque[tuple[float, float, float]] = deque()
        self._swing: deque[tuple[float, float, float]] = deque()

    @property
    def situation(self) -> Situation:
        """What was found, or what the user says."""
        if self.manoeuvre is None or self._found is Situation.GROUND:
            return self._found
        return _SAID[self.manoeuvre]

    def update(self, look: Look) -> Situation:
        """Take one look."""
        if look.armed:
            self._work(look)
        else:
            self._rest(look)
        return self.situation

    def _rest(self, look: Look) -> None:
        self._ground_m = look.height_m
        if self._armed_at is None:
            return
        brief = look.time - self._armed_at < BRIEF_S
        self._armed_at = None
        if self._found is Situation.UNSURE and brief:
            self._found = Situation.GROUND

    def _work(self, look: Look) -> None:
        if self._armed_at is None:
            self._armed_at, self._last, self._reference = look.time, None, look.attitude
            self._turned = self._risen = False
            self._window.clear()
            self._swing.clear()
        step = 0.0 if self._last is None else min(look.time - self._last, _LONGEST_STEP_S)
        self._last = look.time
        self._rise(look.height_m)
        if look.attitude is not None:
            self._move(look.time, look.attitude, step)
            if look.accel is not None:
                self._feel(look.time, look.attitude, look.accel, step)
        self._found = self._judged(look.time - self._armed_at)

    def _judged(self, seconds: float) -> Situation:
        if self._found is Situation.FLYING or self._is_free():
            return Situation.FLYING
        if self._found is Situation.HELD or self._tipped_s >= _TIPPED_S:
            return Situation.HELD
        restless = self._is_restless()
        if self._turned or seconds < STILL_S or (restless and self._risen):
            return Situation.UNSURE
        # Whoever stands still without moving at all is tied down; else it may hover low.
        return Situation.UNSURE if restless else Situation.STILL

    def _is_free(self) -> bool:
        tipped = self._found is Situation.HELD
        return (
            not tipped
            and self._free_s >= _FREE_S
            and self._free_s >= _FREE_SHARE * max(self._tilted_s, self._free_s)
        )

    def _rise(self, height_m: float | None) -> None:
        if height_m is None:
            return
        self._ground_m = height_m if self._ground_m is None else self._ground_m
        self._risen = self._risen or height_m - self._ground_m > RISEN_M

    def _move(self, time: float, attitude: Vector, step: float) -> None:
        if self._reference is None:
            self._reference = attitude
        turned = (
            abs(math.remainder(new - old, math.tau))
            for new, old in zip(attitude, self._reference, strict=True)
        )
        self._turned = self._turned or max(turned) > TURNED_RAD
        tilt = math.acos(math.cos(attitude[0]) * math.cos(attitude[1]))
        if tilt > TIPPED_RAD:
            self._tipped_s += step
        self._swing.append((time, attitude[0], attitude[1]))
        while time - self._swing[0][0] > _SWING_S:
            self._swing.popleft()

    def _is_restless(self) -> bool:
        if not self._swing:
            return False
        rolls, pitches = ([each[axis] for each in self._swing] for axis in (1, 2))
        return max(_range(rolls), _range(pitches)) > RESTLESS_RAD

    def _feel(self, time: float, attitude: Vector, accel: Vector, step: float) -> None:
        """Compare what is felt across the vehicle's axis with what one at rest would feel."""
        roll, pitch, _ = attitude
        x, y = math.sin(pitch), -math.cos(pitch) * math.sin(roll)
        self._window.append((time, (accel[0] * x + accel[1] * y) / G, x * x + y * y))
        while time - self._window[0][0] > _WINDOW_S:
            self._window.popleft()
        felt = sum(each[1] for each in self._window)
        at_rest = sum(each[2] for each in self._window)
        if at_rest < len(self._window) * _LEAST_TILT**2:
            return
        self._tilted_s += step
        if felt < _FREE_ALONG * at_rest:
            self._free_s += step


def _range(values: list[float]) -> float:
    return max(values) - min(values)
