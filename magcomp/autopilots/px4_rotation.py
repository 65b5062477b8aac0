"""How PX4 turns a compass's readings from the sensor's axes into the vehicle's."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from magcomp.autopilots.px4_names import (
    BOARD_ANGLES,
    BOARD_ROTATION,
    angle_names,
    single_name,
)
from magcomp.geometry import body_from_earth
from magcomp.model import FloatArray

_INTERNAL = -1
_BY_ANGLES = 100

ROTATIONS: Mapping[int, tuple[int, int, int]] = {
    **{number: (0, 0, 45 * number) for number in range(8)},
    **{8 + number: (180, 0, 45 * number) for number in range(8)},
    12: (0, 180, 0),
    **{16 + number: (90, 0, 45 * number) for number in range(4)},
    **{20 + number: (270, 0, 45 * number) for number in range(4)},
    24: (0, 90, 0),
    25: (0, 270, 0),
    26: (0, 180, 90),
    27: (0, 180, 270),
    28: (90, 90, 0),
    29: (180, 90, 0),
    30: (270, 90, 0),
    31: (90, 180, 0),
    32: (270, 180, 0),
    33: (90, 270, 0),
    34: (180, 270, 0),
    35: (270, 270, 0),
    36: (90, 180, 90),
    37: (90, 0, 270),
    38: (90, 68, 293),
    39: (0, 315, 0),
    40: (90, 315, 0),
}
"""MAV_SENSOR_ROTATION to roll, pitch and yaw, degrees."""


def rotation_number(values: Mapping[str, float], compass: int) -> int:
    """CAL_MAGn_ROT; −1, that of an internal compass, where it is unknown."""
    value = values.get(single_name("ROT", compass), float(_INTERNAL))
    return int(value) if math.isfinite(value) else _INTERNAL


def sensor_to_body(values: Mapping[str, float], compass: int) -> FloatArray:
    """The rotation R of one compass, shape (3, 3): body = R · sensor.

    Notes
    -----
    A small turn of the board against the vehicle comes on top of CAL_MAGn_ROT or, for an internal
    compass, of SENS_BOARD_ROT. A number that is in no table turns nothing.
    """
    number = rotation_number(values, compass)
    if number == _INTERNAL:
        board = values.get(BOARD_ROTATION, 0.0)
        angles = ROTATIONS.get(int(board) if math.isfinite(board) else 0, (0, 0, 0))
        mounted = _turn(*angles)
    elif number == _BY_ANGLES:
        mounted = _turn(*_degrees(values, angle_names(compass)))
    else:
        mounted = _turn(*ROTATIONS.get(number, (0, 0, 0)))
    return np.asarray(_turn(*_degrees(values, BOARD_ANGLES)) @ mounted)


def _degrees(values: Mapping[str, float], names: tuple[str, ...]) -> tuple[float, ...]:
    angles = (values.get(name, 0.0) for name in names)
    return tuple(angle if math.isfinite(angle) else 0.0 for angle in angles)


def _turn(roll: float, pitch: float, yaw: float) -> FloatArray:
    """About z by yaw, then y by pitch, then x by roll, degrees; shape (3, 3)."""
    turned = body_from_earth(*np.radians([roll, pitch, yaw])).T
    whole = np.rint(turned)
    # Turns by right angles only change places and signs, to the last bit.
    return np.asarray(np.where(np.abs(turned - whole) < 1e-9, whole, turned))
