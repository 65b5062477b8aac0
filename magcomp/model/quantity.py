"""Control quantities: what a motor correction is multiplied by, with unit, grid and words.

Everything that differs between one quantity and another stands here once; the rest of magcomp
asks :func:`quantity_of`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Told = TypeVar("Told")

THROTTLE = "throttle"
CURRENT = "current"
MOTORS = "motors"
"""The current of each motor."""

DRIVE = "motor outputs"
"""What drives each motor: its duty times the battery's voltage."""

_MOST_ROWS = 50


@dataclass(frozen=True)
class Quantity:
    """A control quantity.

    Attributes
    ----------
    name
        As in ``MotorFit.regressor`` and on the command line.
    unit
        That of the numbers inside; empty for a share.
    shown_unit, scale
        The unit a person reads, and how many of it make one inside.
    noun
        What stands behind a value in a sentence, after a space; empty where the unit says enough.
    grid
        Values that a table of heading errors is given at.
    extends
        Whether the grid goes on to the largest value flown.
    is_throttle
        Whether the thrust demand, and not a current, is what it is made of.
    is_straight
        Whether the field follows it in a straight line, as physics has it.
    added_title
        Title of a column of motor vectors, with their unit.
    per
        What a motor vector is given per, in words.
    idle
        Below this the motors do not run.
    flies
        Below this a copter does not leave the ground.
    how_to_vary
        What to do so that it varies more.
    single
        The quantity of one part that comes nearest.
    how_to_have
        How a log comes to hold it, behind a sentence that says it is not there.
    is_told
        Whether it can be told from one reading of throttle and battery current.
    of_each
        The quantity that is this one told motor by motor; empty where none is.
    """

    name: str
    unit: str
    shown_unit: str
    scale: float
    noun: str
    grid: tuple[float, ...]
    extends: bool
    is_throttle: bool
    is_straight: bool
    added_title: str
    per: str
    idle: float
    flies: float
    how_to_vary: str
    single: str
    how_to_have: str = ""
    is_told: bool = True
    of_each: str = ""

    def text(self, u: float) -> str:
        """A value with its unit.

        Examples
        --------
        >>> quantity_of(CURRENT).text(20.2), quantity_of(THROTTLE).text(0.4)
        ('20 A', '40 %')
        """
        return f"{self.scale * u:.0f} {self.shown_unit}"

    def precise(self, u: float) -> str:
        """The same with one decimal."""
        return f"{self.scale * u:.1f} {self.shown_unit}"

    def in_sentence(self, u: float) -> str:
        """The same where the sentence does not say what it is a value of.

        Examples
        --------
        >>> quantity_of(CURRENT).in_sentence(20.2), quantity_of(THROTTLE).in_sentence(0.4)
        ('20 A', '40 % throttle')
        """
        return f"{self.text(u)} {self.noun}".rstrip()

    def of(self, *, current: Told, throttle: Told) -> Told:
        """The one of two values, series or limits that is this quantity's."""
        return throttle if self.is_throttle else current

    def rows(self, u_high: float) -> FloatArray:
        """Values for a table of heading errors where ``u_high`` is the largest flown.

        Examples
        --------
        >>> quantity_of(CURRENT).rows(62.0).tolist()
        [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0]
        """
        step = self.grid[1]
        if self.extends and u_high > self.grid[-1] + step / 2:
            # A monitor that claims a million amperes gets no million rows.
            step *= max(1.0, np.ceil(u_high / (step * _MOST_ROWS)))
            return np.arange(0.0, u_high + step / 2, step)
        return np.array(self.grid)


_AMPERES = Quantity(
    name=CURRENT,
    unit="A",
    shown_unit="A",
    scale=1.0,
    noun="",
    grid=(0.0, 10.0, 20.0, 30.0, 40.0, 50.0),
    extends=True,
    is_throttle=False,
    is_straight=True,
    added_title="motors add, mGauss per A",
    per="per A",
    # The electronics alone of a vehicle this work is for draw about as much.
    idle=1.0,
    flies=0.0,
    how_to_vary="fly climbs and descents so that the motors work harder and less hard",
    single=CURRENT,
    of_each=MOTORS,
)
_SHARE = Quantity(
    name=THROTTLE,
    unit="",
    shown_unit="%",
    scale=100.0,
    noun="throttle",
    grid=(0.0, 0.2, 0.4, 0.6, 0.8, 1.0),
    extends=False,
    is_throttle=True,
    is_straight=False,
    added_title="motors add at full, mGauss",
    per="at full",
    idle=-np.inf,
    flies=0.3,
    how_to_vary="fly climbs and descents",
    single=THROTTLE,
)

_EACH = replace(_AMPERES, name=MOTORS, of_each="")
_DRIVEN = replace(
    _AMPERES,
    name=DRIVE,
    of_each="",
    unit="V",
    shown_unit="V",
    is_told=False,
    how_to_have=": it takes SERVO_OUTPUT_RAW (or RCOU) and the battery's voltage",
)

QUANTITIES: Mapping[str, Quantity] = {
    each.name: each for each in (_AMPERES, _SHARE, _EACH, _DRIVEN)
}
"""By name."""


def quantity_of(kind: str | None) -> Quantity:
    """The quantity of a name; where none is multiplied, the current's words serve."""
    return QUANTITIES[kind or CURRENT]


def unit_of(kind: str) -> str:
    """Unit of a quantity; empty where it is none that is known."""
    return QUANTITIES[kind].unit if kind in QUANTITIES else ""
