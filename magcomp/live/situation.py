"""How a recording is being made: flown, held in the hands or tied down. No I/O, no clock."""

from __future__ import annotations

import math
from enum import StrEnum

Vector = tuple[float, float, float]

RISEN_M = 1.5
MOVING = 1.5
"""Metres above where it was armed, and m/s over the ground, that nobody holding it reaches."""

TIPPED_RAD = math.radians(55.0)
"""A tilt that a multirotor flown for calibration does not have."""

TURNED_RAD = math.radians(30.0)
"""A vehicle that turns less than this stands still."""

STILL_S = 8.0


class Situation(StrEnum):
    """How the recording is being made; see the table in guide.py."""

    GROUND = "ground"
    UNSURE = "unsure"
    STILL = "still"
    HELD = "held"
    FLYING = "flying"


class SituationWatch:
    """Tells a vehicle that flies from one that is held or tied down.

    Fed with what the vehicle says, a few times a second.
    """

    def __init__(self) -> None:
        self.situation = Situation.GROUND
        self._ground_m: float | None = None
        self._tipped = False
        self._armed_at: float | None = None
        self._reference: Vector | None = None
        self._turned = False

    def update(
        self,
        now: float,
        armed: bool | None,
        attitude: Vector | None,
        height_m: float | None,
        speed: float | None,
    ) -> Situation:
        """Take one look; ``now`` in seconds."""
        if not armed:
            self._rest(height_m)
            return self.situation
        if self._armed_at is None:
            self._armed_at, self._reference, self._turned = now, attitude, False
        self._ground_m = height_m if self._ground_m is None else self._ground_m
        if self.situation is Situation.FLYING or self._is_flying(height_m, speed):
            self.situation = Situation.FLYING
            return self.situation
        self._look(attitude)
        if self._tipped:
            self.situation = Situation.HELD
        elif self._turned or now - self._armed_at < STILL_S:
            self.situation = Situation.UNSURE
        else:
            self.situation = Situation.STILL
        return self.situation

    def _rest(self, height_m: float | None) -> None:
        self._ground_m = height_m
        if self._armed_at is None:
            return
        self._armed_at = None
        if self.situation is Situation.UNSURE:
            self.situation = Situation.GROUND

    def _is_flying(self, height_m: float | None, speed: float | None) -> bool:
        risen = None not in (height_m, self._ground_m) and (
            (height_m or 0.0) - (self._ground_m or 0.0) > RISEN_M
        )
        return risen or (speed is not None and speed > MOVING)

    def _look(self, attitude: Vector | None) -> None:
        if attitude is None:
            return
        if self._reference is None:
            self._reference = attitude
        turned = (
            abs(math.remainder(new - old, math.tau))
            for new, old in zip(attitude, self._reference, strict=True)
        )
        self._turned = self._turned or max(turned) > TURNED_RAD
        tilt = math.acos(math.cos(attitude[0]) * math.cos(attitude[1]))
        self._tipped = self._tipped or tilt > TIPPED_RAD
