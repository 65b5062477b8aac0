"""What a flight's readings should be: the two residuals of a reading and their derivatives.

The corrected field must have the earth's strength at every attitude and every control quantity,
and its part along gravity must be the earth's vertical part (docs/method.md, Flights).
"""

from __future__ import annotations

import numpy as np

from magcomp.align.low_pass import low_pass
from magcomp.fit.control_noise import Noise, noise_of, whitened
from magcomp.model import (
    CORRECTION_SIZE,
    MOTOR,
    OFFSET,
    Correction,
    FloatArray,
    IntArray,
    Lags,
    MotorFit,
    Samples,
    pack,
    unpack,
)

STRENGTH, SIN_DIP, FIELD_LAG, REGRESSOR_LAG, APPLIED_LAG = range(
    CORRECTION_SIZE, CORRECTION_SIZE + 5
)
LAGS = slice(FIELD_LAG, APPLIED_LAG + 1)
LEANS_S = (2.0, 8.0)
"""How soon a lean that is held shows in the attitude: between these, for most filters."""

TILT = slice(LAGS.stop, LAGS.stop + 2)
LEAN = slice(TILT.stop, TILT.stop + 2 * len(LEANS_S))
NUISANCE = slice(TILT.start, LEAN.stop)
SIZE = LEAN.stop
"""Parameters where the control quantity has one part; other parts' motor vectors follow."""

DIAGONAL, OFF_DIAGONAL = slice(6, 9), slice(9, 12)


def strength_and_dip(
    samples: Samples, parameters: FloatArray, noise: Noise | None = None
) -> tuple[FloatArray, FloatArray]:
    """Residuals in mGauss of sensor field, shape (n, 2), and derivatives, shape (n, 2, SIZE).

    Parameters
    ----------
    samples, parameters
        Readings, and the parameters in the order of the module's slices, shape (SIZE,).
    noise
        Sizes of the errors where those of the control quantity are known too: both residuals are
        then made independent of each other.

    Notes
    -----
    The sensor's noise is alike on its axes, so the distance that counts is that in sensor axes
    between a reading and the nearest field the model allows: D⁻¹ · (b − M·u) − offset with b the
    earth's field at the known gravity and *any* heading. The heading is eliminated: of the three
    components the one along which it moves the reading is left out, and the two that remain are
    taken along the field (strength) and across it (dip). Slopes are those of the model's field,
    not of the noisy reading, so noise is not taken for soft iron (errors in variables).
    """
    return rows_of(samples, parameters, noise)[:2]


def rows_of(
    samples: Samples, parameters: FloatArray, noise: Noise | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """As :func:`strength_and_dip`, with the change of both residuals by one unit of u, (n, 2)."""
    values, slopes, pulls = _rows(samples, parameters)
    if noise is None:
        return values, slopes, pulls
    together = np.concatenate([values[:, :, None], pulls[:, :, None], slopes], axis=2)
    made = whitened(together, pulls, noise)
    return made[:, :, 0], made[:, :, 2:], made[:, :, 1]


def _rows(samples: Samples, parameters: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residuals, their derivatives, and their change by one unit of u, as they come."""
    correction = correction_at(parameters)
    strength, sine = parameters[STRENGTH], np.clip(parameters[SIN_DIP], -0.999, 0.999)
    cosine = np.sqrt(1.0 - sine**2)
    inverse: FloatArray = np.linalg.inv(correction.soft_iron).astype(np.float64)
    corrected = correction.apply(samples.raw, samples.u)
    down = samples.down
    level = corrected - np.einsum("ij,ij->i", corrected, down)[:, None] * down
    north = level / np.maximum(np.linalg.norm(level, axis=1), 1e-9)[:, None]
    earth = strength * (cosine * north + sine * down)
    axes = _axes(earth, down, inverse)
    apart = (corrected - earth) @ inverse.T
    pulled = [axis @ inverse for axis in axes]
    slopes = np.empty((len(samples), 2, len(parameters)))
    leaning = _leaning(samples)
    for kind in range(2):
        # A turn w of the body moves the field in body axes by w × b, which b × pulled weighs.
        turned = _cross(earth, pulled[kind])
        slopes[:, kind, TILT] = -turned[:, :2]
        slopes[:, kind, LEAN] = np.concatenate([-turned[:, :2] * each for each in leaning], axis=1)
        slopes[:, kind, FIELD_LAG] = np.einsum("ij,ij->i", turned, _cross(down, samples.down_rate))
    values = np.stack([np.einsum("ij,ij->i", axis, apart) for axis in axes], axis=1)
    values += slopes[:, :, NUISANCE] @ parameters[NUISANCE]
    pulls = np.stack([one @ correction.vector for one in pulled], axis=1)
    centred = (earth - correction.added(samples.u)) @ inverse.T
    pulled_rate = correction.added(samples.u_rate)
    for kind, (axis, pull) in enumerate(zip(axes, pulled, strict=True)):
        rows = slopes[:, kind, :]
        rows[:, MOTOR] = pull * samples.u[:, :1]
        for part, column in enumerate(range(SIZE, rows.shape[1], 3), start=1):
            rows[:, column : column + 3] = pull * samples.u[:, part : part + 1]
        rows[:, OFFSET] = axis
        rows[:, DIAGONAL] = pull * centred
        for column, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)), start=9):
            rows[:, column] = pull[:, i] * centred[:, j] + pull[:, j] * centred[:, i]
        rows[:, STRENGTH] = -np.einsum("ij,ij->i", pull, earth) / strength
        rows[:, SIN_DIP] = -strength * np.einsum("ij,ij->i", pull, down - sine / cosine * north)
        rows[:, REGRESSOR_LAG] = -np.einsum("ij,ij->i", pull, pulled_rate)
        rows[:, APPLIED_LAG] = np.einsum("ij,ij->i", axis, samples.raw_rate)
    return values, slopes, pulls


def _axes(
    earth: FloatArray, down: FloatArray, inverse: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Unit vectors in sensor axes along the field and across it, both square to a turn."""
    turn = _cross(down, earth) @ inverse.T
    turn /= np.maximum(np.linalg.norm(turn, axis=1), 1e-9)[:, None]
    along = earth @ inverse.T
    along -= np.einsum("ij,ij->i", along, turn)[:, None] * turn
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    return along, _cross(turn, along)


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Vector products of rows; NumPy's own takes three times as long."""
    ax, ay, az = one.T
    bx, by, bz = other.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _leaning(samples: Samples) -> list[FloatArray]:
    """Roll and pitch, followed by each of LEANS_S: what acceleration does to attitude, (n, 2) each.

    A multirotor accelerates where it leans, and its attitude filter takes the acceleration for
    gravity within seconds. A sum of a fast and a slow one comes near any in between, and near one
    that lets go again, as the vehicle does when its drag has caught up with its lean.
    """
    if len(samples) < 2:
        return [np.zeros((len(samples), 2)) for _ in LEANS_S]
    step = max(float(np.median(np.diff(samples.time))), 1e-3)
    tilt = samples.attitude[:, :2] - np.median(samples.attitude[:, :2], axis=0)
    return [low_pass(tilt, step / (each + step)) for each in LEANS_S]


def errors_of(samples: Samples, parameters: FloatArray) -> Noise | None:
    """The sizes of the errors at parameters near the solution, shape (SIZE,)."""
    values, _, pulls = _rows(samples, parameters)
    return noise_of(values, pulls, float(np.std(samples.total)))


def correction_at(parameters: FloatArray) -> Correction:
    """The correction among the parameters."""
    return unpack(np.delete(parameters, slice(CORRECTION_SIZE, SIZE)))


def motor_columns(slopes: FloatArray) -> FloatArray:
    """Derivatives by the motor vectors of all parts, shape (n, 2, k, 3)."""
    others = slopes[:, :, SIZE:].reshape(*slopes.shape[:2], -1, 3)
    return np.concatenate([slopes[:, :, None, MOTOR], others], axis=2)


def parameters_of(fit: MotorFit, lags: Lags) -> FloatArray:
    """The parameters of a fit at given lags, without tilt and lean, shape (SIZE + 3 (k − 1),)."""
    packed = pack(fit.correction)
    return np.concatenate(
        [
            packed[:CORRECTION_SIZE],
            [fit.strength, fit.vertical / fit.strength, lags.field, lags.regressor],
            [lags.regressor if lags.applied is None else lags.applied],
            np.zeros(SIZE - NUISANCE.start),
            packed[CORRECTION_SIZE:],
        ]
    )


def indices_of_correction(size: int) -> IntArray:
    """Where among so many parameters those of :func:`magcomp.model.pack` stand."""
    return np.delete(np.arange(size), slice(CORRECTION_SIZE, SIZE))


def lags_of(parameters: FloatArray) -> Lags:
    """The lags among the parameters."""
    field, regressor, applied = parameters[LAGS].tolist()
    return Lags(field, regressor, applied)


def vertical_of(parameters: FloatArray) -> float:
    """Downward part of the earth's field, mGauss."""
    return float(parameters[STRENGTH] * parameters[SIN_DIP])
