"""What a heading error does to a mission: a square flown corner by corner with a wrong compass.

The vehicle knows by GPS where it is and where the next corner lies; which way that is, it takes
from its compass. So it sets off askew, sees that it is off the line, and turns in late: its path
bends.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from magcomp.geometry import apart
from magcomp.model import FloatArray

SIDE_M = 50.0
"""Length of each leg, and what a mission is called by."""

_STEP_M = 0.5
_ARRIVED_M = 0.25
_LONGEST = 3.0
"""A leg longer than this many times its line is given up: the corner is never found."""


@dataclass(frozen=True, eq=False)
class Mission:
    """A square flown with a heading that errs.

    Attributes
    ----------
    planned
        East and north of the start, m, every half metre, shape (n, 2).
    path
        What is flown, shape (m, 2).
    arrives
        Whether every corner is found.
    """

    planned: FloatArray
    path: FloatArray
    arrives: bool

    @property
    def stray_m(self) -> float:
        """How far it strays from what was planned."""
        return apart(self.path, self.planned)


def mission(errors: FloatArray) -> Mission:
    """Fly the square, nose ahead.

    Parameters
    ----------
    errors
        Heading found less true heading, radians, at true headings spread evenly over a turn from
        north on, shape (k,).

    Examples
    --------
    A compass that is right flies the square; one that errs by 20° everywhere bends every leg:

    >>> round(mission(np.zeros(36)).stray_m, 2)
    0.0
    >>> round(mission(np.full(36, np.radians(20.0))).stray_m, 1)
    6.7
    """
    corners = SIDE_M * np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
    share = np.arange(0.0, 1.0, _STEP_M / SIDE_M)[:, np.newaxis]
    planned = [start + share * (end - start) for start, end in pairwise(corners)]
    path, arrives = [corners[0]], True
    for corner in corners[1:]:
        leg = _leg(path[-1], corner, errors)
        path += leg
        arrives = arrives and bool(np.hypot(*(corner - leg[-1])) <= _ARRIVED_M)
        if not arrives:
            break
    return Mission(np.vstack([*planned, corners[-1:]]), np.array(path), arrives)


def _leg(start: FloatArray, corner: FloatArray, errors: FloatArray) -> list[FloatArray]:
    at, leg = start, [start]
    yaw = _bearing(corner - at)
    for _ in range(round(_LONGEST * SIDE_M / _STEP_M)):
        # It turns until it believes to look at the corner; how wrong it is, depends on its yaw.
        yaw = _bearing(corner - at) - _error_at(yaw, errors)
        step = min(_STEP_M, float(np.hypot(*(corner - at))))
        at = at + step * np.array([np.sin(yaw), np.cos(yaw)])
        leg.append(at)
        if np.hypot(*(corner - at)) <= _ARRIVED_M:
            break
    return leg


def _bearing(way: FloatArray) -> float:
    return float(np.arctan2(way[0], way[1]))


def _error_at(yaw: float, errors: FloatArray) -> float:
    turn = np.linspace(0.0, 2 * np.pi, len(errors) + 1)
    return float(np.interp(np.mod(yaw, 2 * np.pi), turn, np.append(errors, errors[0])))
