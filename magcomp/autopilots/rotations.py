"""The ways a compass can be mounted, as both autopilots number them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from magcomp.geometry import body_from_earth
from magcomp.model import FloatArray

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


def turn(roll: float, pitch: float, yaw: float) -> FloatArray:
    """About z by yaw, then y by pitch, then x by roll, degrees; shape (3, 3).

    Examples
    --------
    Upside down, what the sensor has on its right is on the vehicle's left:

    >>> (turn(180, 0, 0) @ [0.0, 1.0, 0.0]).tolist()
    [0.0, -1.0, 0.0]
    """
    turned = body_from_earth(*np.radians([roll, pitch, yaw])).T
    whole = np.rint(turned)
    # Turns by right angles only change places and signs, to the last bit.
    return np.asarray(np.where(np.abs(turned - whole) < 1e-9, whole, turned))


@cache
def right_angles() -> Mapping[int, FloatArray]:
    """The 24 turns by right angles, each by its lowest number, that of no turn first."""
    found: dict[int, FloatArray] = {}
    for number, angles in ROTATIONS.items():
        if any(angle % 90 for angle in angles):
            continue
        made = turn(*angles)
        if not any(np.array_equal(made, known) for known in found.values()):
            found[number] = made
    return found


def number_of(turned: FloatArray) -> int | None:
    """The number of a turn by right angles, shape (3, 3); None for any other.

    Examples
    --------
    >>> number_of(turn(180, 0, 0)), number_of(turn(0, 10, 0))
    (8, None)
    """
    return next((n for n, known in right_angles().items() if np.allclose(turned, known)), None)


def named(number: int) -> str:
    """The angles of a number in words.

    Examples
    --------
    >>> named(8), named(10), named(0)
    ('roll 180°', 'roll 180° and yaw 90°', 'no turn')
    """
    each = zip(("roll", "pitch", "yaw"), ROTATIONS[number], strict=True)
    return " and ".join(f"{axis} {angle}°" for axis, angle in each if angle) or "no turn"
