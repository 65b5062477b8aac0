"""Attitude, levelling and heading.

Body axes are x forward, y right, z down; earth axes are north, east, down.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

_NO_HEADING = 1e-12
"""Square of a horizontal field, in any unit, that turns no compass: a dead one's, or a pole's."""


def wrap_angle(angle: ArrayLike) -> FloatArray:
    """Bring angles in radians into [−π, π).

    Examples
    --------
    >>> float(np.degrees(wrap_angle(np.radians(350.0))).round(9))
    -10.0
    """
    return (np.asarray(angle, dtype=np.float64) + np.pi) % (2 * np.pi) - np.pi


def level_matrix(roll: ArrayLike, pitch: ArrayLike) -> FloatArray:
    """Rotation from body axes to level axes, C(φ,θ).

    Parameters
    ----------
    roll, pitch
        Radians, any common shape (...).

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Notes
    -----
    docs/method.md, Equation 1.

    Examples
    --------
    A vehicle that leans 90° to the right has its right side where down was:

    >>> level_matrix(np.pi / 2, 0.0).round(9) @ [0.0, 1.0, 0.0]
    array([0., 0., 1.])
    """
    roll, pitch = np.broadcast_arrays(np.asarray(roll, float), np.asarray(pitch, float))
    sin_roll, cos_roll = np.sin(roll), np.cos(roll)
    sin_pitch, cos_pitch = np.sin(pitch), np.cos(pitch)
    zero = np.zeros_like(roll)
    return np.stack(
        [
            np.stack([cos_pitch, sin_roll * sin_pitch, cos_roll * sin_pitch], axis=-1),
            np.stack([zero, cos_roll, -sin_roll], axis=-1),
            gravity_direction(roll, pitch),
        ],
        axis=-2,
    )


def gravity_direction(roll: ArrayLike, pitch: ArrayLike) -> FloatArray:
    """Unit vector pointing down, in body axes, shape (..., 3): the last row of C(φ,θ).

    Examples
    --------
    >>> gravity_direction(0.0, np.radians(30.0)).round(3).tolist()
    [-0.5, 0.0, 0.866]
    """
    roll, pitch = np.asarray(roll, float), np.asarray(pitch, float)
    cos_pitch = np.cos(pitch)
    y, z = np.sin(roll) * cos_pitch, np.cos(roll) * cos_pitch
    down = np.empty((3, *np.shape(y)))
    np.negative(np.sin(pitch), out=down[0, ...])
    down[1], down[2] = y, z
    return np.moveaxis(down, 0, -1)


def gravity_and_rate(
    roll: FloatArray, pitch: FloatArray, roll_rate: FloatArray, pitch_rate: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """:func:`gravity_direction` and its change per second, shape (n, 3) each.

    Parameters
    ----------
    roll, pitch, roll_rate, pitch_rate
        Radians, and radians per second, shape (n,).

    Examples
    --------
    A level vehicle that pitches up by 1 rad/s:

    >>> none, one = np.zeros(1), np.ones(1)
    >>> (gravity_and_rate(none, none, none, one)[1] + 0.0).tolist()
    [[-1.0, 0.0, 0.0]]
    """
    sin_roll, cos_roll = np.sin(roll), np.cos(roll)
    sin_pitch, cos_pitch = np.sin(pitch), np.cos(pitch)
    down, rate = np.empty((2, 3, len(roll)))
    down[0], down[1], down[2] = -sin_pitch, sin_roll * cos_pitch, cos_roll * cos_pitch
    falling = sin_pitch * pitch_rate
    rate[0] = -cos_pitch * pitch_rate
    rate[1] = down[2] * roll_rate - sin_roll * falling
    rate[2] = -down[1] * roll_rate - cos_roll * falling
    return down.T, rate.T


def body_from_earth(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> FloatArray:
    """Rotation from north-east-down axes to body axes, shape (..., 3, 3).

    Notes
    -----
    Level axes turned by the heading: C(φ,θ)ᵀ · R_z(ψ)ᵀ, docs/method.md, Equation 1.

    Examples
    --------
    Heading east, the earth's north lies to the left:

    >>> (body_from_earth(0.0, 0.0, np.pi / 2) @ [1.0, 0.0, 0.0]).round(9).tolist()
    [0.0, -1.0, 0.0]
    """
    yaw = np.asarray(yaw, float)
    cos_yaw, sin_yaw = np.cos(yaw), np.sin(yaw)
    zero, one = np.zeros_like(yaw), np.ones_like(yaw)
    level_from_earth = np.stack(
        [
            np.stack([cos_yaw, sin_yaw, zero], axis=-1),
            np.stack([-sin_yaw, cos_yaw, zero], axis=-1),
            np.stack([zero, zero, one], axis=-1),
        ],
        axis=-2,
    )
    return np.asarray(np.swapaxes(level_matrix(roll, pitch), -1, -2) @ level_from_earth)


def angles_of(quaternion: ArrayLike) -> FloatArray:
    """Roll, pitch and yaw of unit quaternions.

    Parameters
    ----------
    quaternion
        From the earth's axes into the body's, w first, shape (n, 4).

    Returns
    -------
    FloatArray
        Radians, shape (n, 3).

    Examples
    --------
    >>> import numpy as np
    >>> from magcomp.geometry import angles_of
    >>> half = np.radians(30.0) / 2.0
    >>> np.degrees(angles_of([[np.cos(half), 0.0, 0.0, np.sin(half)]])).round(6).tolist()
    [[0.0, 0.0, 30.0]]
    """
    w, x, y, z = np.asarray(quaternion, dtype=np.float64).T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=1)


def heading(
    field: ArrayLike, roll: ArrayLike, pitch: ArrayLike, declination: float = 0.0
) -> FloatArray:
    """Heading of a body-axes field, radians in [−π, π).

    Parameters
    ----------
    field
        Field in body axes, any unit, shape (..., 3).
    roll, pitch
        Radians, shape (...).
    declination
        Radians, east positive; 0 gives the magnetic heading.

    Notes
    -----
    docs/method.md, Equation 2.

    Examples
    --------
    A field that points to the left of a level vehicle: it looks east.

    >>> float(np.degrees(heading([0.0, -200.0, 400.0], 0.0, 0.0)))
    90.0
    """
    level = np.einsum("...ij,...j->...i", level_matrix(roll, pitch), np.asarray(field, float))
    return wrap_angle(np.arctan2(-level[..., 1], level[..., 0]) + declination)


def heading_shift(
    disturbance: ArrayLike, field: ArrayLike, roll: ArrayLike, pitch: ArrayLike
) -> FloatArray:
    """First-order change of heading that a small body-axes disturbance makes, radians.

    Parameters
    ----------
    disturbance, field
        Body axes, one unit for both, shape (..., 3).
    roll, pitch
        Radians, shape (...).

    Notes
    -----
    docs/method.md, Equation 7.

    Examples
    --------
    10 mGauss to the right of a horizontal field of 200 mGauss turn the heading by 1/20:

    >>> float(heading_shift([0.0, 10.0, 0.0], [200.0, 0.0, 400.0], 0.0, 0.0))
    -0.05
    """
    level = level_matrix(roll, pitch)
    shift = np.einsum("...ij,...j->...i", level, np.asarray(disturbance, float))
    still = np.einsum("...ij,...j->...i", level, np.asarray(field, float))
    horizontal = np.maximum(still[..., 0] ** 2 + still[..., 1] ** 2, _NO_HEADING)
    return np.asarray((still[..., 1] * shift[..., 0] - still[..., 0] * shift[..., 1]) / horizontal)


def horizontal_part(strength: float, vertical: float) -> float:
    """The horizontal part of a field, in its unit, and at least 1: headings are divided by it.

    Examples
    --------
    >>> horizontal_part(500.0, 400.0)
    300.0
    """
    return math.sqrt(max(strength**2 - vertical**2, 1.0))


def apart(path: ArrayLike, other: ArrayLike) -> float:
    """How far a path strays from another: the largest distance of its points from the other's.

    Parameters
    ----------
    path, other
        Points, any unit, shapes (n, k) and (m, k).

    Examples
    --------
    >>> apart([[0.0, 0.0], [3.0, 5.0]], [[0.0, 0.0], [0.0, 1.0]])
    5.0
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415 -- slow to import, and seldom needed

    nearest, _ = cKDTree(np.asarray(other, float)).query(np.asarray(path, float))
    return float(np.max(nearest))
