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
from magcomp.autopilots.rotations import ROTATIONS, turn
from magcomp.model import FloatArray

_INTERNAL = -1
_BY_ANGLES = 100


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
        mounted = turn(*angles)
    elif number == _BY_ANGLES:
        mounted = turn(*_degrees(values, angle_names(compass)))
    else:
        mounted = turn(*ROTATIONS.get(number, (0, 0, 0)))
    return np.asarray(turn(*_degrees(values, BOARD_ANGLES)) @ mounted)


def _degrees(values: Mapping[str, float], names: tuple[str, ...]) -> tuple[float, ...]:
    angles = (values.get(name, 0.0) for name in names)
    return tuple(angle if math.isfinite(angle) else 0.0 for angle in angles)
