"""Errors of the control quantity: they move a reading along the motor vector.

A current is measured late, seldom and with noise. Its error e moves both residuals of a reading by
e·a, where a is the motor vector as the residuals see it. Such errors lie along one direction, and
the other one is worth many times more: the residuals are whitened by diag(σ²) + σᵤ² a aᵀ
(docs/method.md, Flights).

The slopes stay those at the u that was reported. Whether a motor vector fitted so comes out too
short (errors of a measurement) or not (errors of a smoothed or rebuilt current, which do not
depend on what is reported) cannot be told from the residuals; on recorded flights it does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magcomp.fit.robust import NOISE_FLOOR, spread_of
from magcomp.model import FloatArray, median

MOST_SHARE = 0.25
"""σᵤ is at most this share of the spread of u: beyond it, u would not be a measurement."""

_LEAST_SIGNAL = 3.0
_ROUNDS = 25
_ROBUST = 3.0
_SETTLED = 0.01


@dataclass(frozen=True, eq=False)
class Noise:
    """What the two residuals of a reading are made of.

    Attributes
    ----------
    sensor
        σ of each residual but for the control quantity, mGauss, shape (2,).
    control
        σᵤ, in the unit of the control quantity.
    """

    sensor: FloatArray
    control: float


def whitened(columns: FloatArray, pulls: FloatArray, noise: Noise) -> FloatArray:
    """Residuals (2, n) or slopes (k, 2, n) made independent, still in mGauss of the sensor.

    Parameters
    ----------
    columns
        What to whiten.
    pulls
        Change of the residuals by one unit of u, shape (2, n).
    noise
        The sizes of the errors.

    Notes
    -----
    L⁻¹ · columns with L Lᵀ = diag(σ²) + σᵤ² a aᵀ, times σ: without errors of u nothing changes.
    """
    first, second = noise.sensor
    shared = noise.control * pulls
    one = np.sqrt(first**2 + shared[0] ** 2)
    mixed = shared[0] * shared[1] / one
    two = np.sqrt(np.maximum(second**2 + shared[1] ** 2 - mixed**2, 1e-12))
    made = np.empty_like(columns)
    top, bottom = made[..., 0, :], made[..., 1, :]
    np.multiply(columns[..., 0, :], first / one, out=top)
    np.multiply(columns[..., 1, :], second / two, out=bottom)
    bottom -= top * (mixed * second / (first * two))
    return made


def noise_of(values: FloatArray, pulls: FloatArray, spread_u: float) -> Noise | None:
    """The errors that make such residuals, or None where u does not show in them.

    Parameters
    ----------
    values, pulls
        Residuals, and their change by one unit of u, shape (2, n).
    spread_u
        Standard deviation of u.

    Notes
    -----
    Expectation maximisation with the error of u as the hidden factor; readings far out count
    less.
    """
    sensor = spread_of(values.T)
    signal = float(median(np.hypot(*pulls))) * spread_u
    if signal < _LEAST_SIGNAL * float(np.linalg.norm(sensor)):
        return None
    most = MOST_SHARE * spread_u
    noise = Noise(sensor, most / 4)
    squares, mixed = pulls**2, pulls * values
    for _ in range(_ROUNDS):
        variance = noise.sensor**2
        precision = squares[0] / variance[0] + squares[1] / variance[1] + 1.0 / noise.control**2
        error = (mixed[0] / variance[0] + mixed[1] / variance[1]) / precision
        left = (values - pulls * error) ** 2
        far = left[0] / variance[0] + left[1] / variance[1] + (error / noise.control) ** 2
        weight = 1.0 / (1.0 + far / (2 * _ROBUST**2))
        weight /= np.sum(weight)
        doubt = weight / precision
        control = float(np.sqrt(weight @ error**2 + np.sum(doubt)))
        spread = left @ weight + squares @ doubt
        before = noise.control
        noise = Noise(np.maximum(np.sqrt(spread), NOISE_FLOOR), float(np.clip(control, 1e-3, most)))
        if abs(noise.control / before - 1.0) < _SETTLED:
            break
    return noise
