"""How a disturbance that the motors make turns the heading: docs/method.md, Equations 8 to 11.

Equations 1, 2 and 7 are in :mod:`magcomp.geometry`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from magcomp.geometry import level_matrix
from magcomp.model import FloatArray


def level_components(strength: ArrayLike, dip: ArrayLike, heading: ArrayLike) -> FloatArray:
    """Forward and right components X_h, Y_h of the earth's field in level axes.

    Parameters
    ----------
    strength
        Total field H, mGauss, shape (...).
    dip
        σ, radians below the horizon, shape (...).
    heading
        Magnetic heading ψ, radians, shape (...).

    Returns
    -------
    ndarray, shape (..., 2)

    Notes
    -----
    docs/method.md, Equation 8.

    Examples
    --------
    >>> level_components(500.0, np.radians(60.0), 0.0).round(6).tolist()
    [250.0, -0.0]
    """
    horizontal = np.asarray(strength, float) * np.cos(dip)
    return np.stack([horizontal * np.cos(heading), -horizontal * np.sin(heading)], axis=-1)


def level_heading_shift(
    forward: ArrayLike, right: ArrayLike, strength: ArrayLike, dip: ArrayLike, heading: ArrayLike
) -> FloatArray:
    """First-order change of heading, radians, that a disturbance in level axes makes.

    Parameters
    ----------
    forward, right
        ΔX_h and ΔY_h, mGauss, shape (...).
    strength, dip, heading
        See :func:`level_components`.

    Notes
    -----
    docs/method.md, Equation 9.

    Examples
    --------
    >>> float(level_heading_shift(0.0, 10.0, 200.0, 0.0, 0.0))
    -0.05
    """
    along = np.cos(heading) * np.asarray(right, float) + np.sin(heading) * np.asarray(
        forward, float
    )
    return np.asarray(-along / (np.asarray(strength, float) * np.cos(dip)))


def disturbance(size: ArrayLike, elevation: ArrayLike, azimuth: ArrayLike) -> FloatArray:
    """Body-axes disturbance of a size and a direction, shape (..., 3).

    Parameters
    ----------
    size
        H_m, mGauss, shape (...).
    elevation
        α over the x-y plane towards z, radians, shape (...).
    azimuth
        β in that plane from x towards y, radians, shape (...).

    Notes
    -----
    docs/method.md, Equation 10.

    Examples
    --------
    >>> disturbance(10.0, np.radians(90.0), 0.0).round(9).tolist()
    [0.0, 0.0, 10.0]
    """
    size = np.asarray(size, float)
    return np.stack(
        np.broadcast_arrays(
            size * np.cos(elevation) * np.cos(azimuth),
            size * np.cos(elevation) * np.sin(azimuth),
            size * np.sin(elevation),
        ),
        axis=-1,
    )


def shift_per_size(
    elevation: ArrayLike,
    azimuth: ArrayLike,
    strength: ArrayLike,
    dip: ArrayLike,
    roll: ArrayLike,
    pitch: ArrayLike,
    heading: ArrayLike,
) -> FloatArray:
    """Change of heading per mGauss of a disturbance of fixed direction, radians per mGauss.

    Parameters
    ----------
    elevation, azimuth
        See :func:`disturbance`.
    strength, dip, heading
        See :func:`level_components`.
    roll, pitch
        Attitude, radians, shape (...).

    Notes
    -----
    docs/method.md, Equation 11: at a fixed attitude the shift is this times H_m, and H_m grows with
    the control quantity.

    Examples
    --------
    A disturbance to the right at heading north, where 250 mGauss are horizontal:

    >>> float(np.round(shift_per_size(0.0, np.pi / 2, 500.0, np.radians(60.0), 0.0, 0.0, 0.0), 6))
    -0.004
    """
    unit = disturbance(1.0, elevation, azimuth)
    level = np.einsum("...ij,...j->...i", level_matrix(roll, pitch), unit)
    return level_heading_shift(level[..., 0], level[..., 1], strength, dip, heading)
