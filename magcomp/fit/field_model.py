"""What a flight's readings should be: the two residuals of a reading and their derivatives.

The corrected field must have the earth's strength at every attitude and every control quantity,
and its part along gravity must be the earth's vertical part (docs/method.md, Flights).
"""

from __future__ import annotations

import numpy as np

from magcomp.fit.control_noise import Noise, noise_of, whitened
from magcomp.model import (
    CORRECTION_SIZE,
    LEANS_S,
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
TILT = slice(LAGS.stop, LAGS.stop + 2)
LEAN = slice(TILT.stop, TILT.stop + 2 * len(LEANS_S))
BLUR = LEAN.stop
SLOW = BLUR + 1
NUISANCE = slice(TILT.start, SLOW + 1)
SIZE = SLOW + 1
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

    In memory the readings are the last axis of everything here: what is done to a column then
    runs along the memory, and the columns of a least-squares problem lie one after the other.
    """
    return rows_of(samples, parameters, noise)[:2]


def rows_of(
    samples: Samples, parameters: FloatArray, noise: Noise | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """As :func:`strength_and_dip`, with the change of both residuals by one unit of u, (n, 2)."""
    return _rows(_columns(samples, parameters), noise)


def rows_and_errors(
    samples: Samples, parameters: FloatArray
) -> tuple[tuple[FloatArray, FloatArray, FloatArray], Noise | None]:
    """As :func:`rows_of` with the errors that the residuals show themselves, and those errors."""
    columns = _columns(samples, parameters)
    noise = _errors(samples, columns)
    return _rows(columns, noise), noise


def errors_of(samples: Samples, parameters: FloatArray) -> Noise | None:
    """The sizes of the errors at parameters near the solution, shape (SIZE,)."""
    return _errors(samples, _columns(samples, parameters))


def _errors(samples: Samples, columns: FloatArray) -> Noise | None:
    return noise_of(columns[0], columns[1], float(np.std(samples.total)))


def _rows(columns: FloatArray, noise: Noise | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Values (n, 2), slopes (n, 2, SIZE) and pulls (n, 2), independent where the noise is known."""
    made = columns if noise is None else whitened(columns, columns[1], noise)
    return made[0].T, made[2:].T, made[1].T


def _columns(samples: Samples, parameters: FloatArray) -> FloatArray:
    """Residuals, their change by one unit of u, and their derivatives, shape (2 + SIZE, 2, n)."""
    correction = correction_at(parameters)
    inverse: FloatArray = np.linalg.inv(correction.soft_iron).astype(np.float64)
    down, u = _across(samples.down), _across(samples.u)
    corrected = _across(correction.apply(samples.raw, samples.u))
    earth, by_dip = _earth(corrected, down, parameters)
    axes = _axes(earth, down, inverse)
    pulled = _turned(inverse, axes)
    # A turn w of the body moves the field in body axes by w × b, which b × pulled weighs.
    turned = _cross(earth[:, None], pulled)
    centred = inverse @ (earth - _across(correction.added(samples.u)))

    columns = np.empty((2 + len(parameters), 2, len(samples)))
    slopes = columns[2:]
    slopes[MOTOR] = pulled * u[0]
    for part, column in enumerate(range(SIZE, len(slopes), 3), start=1):
        slopes[column : column + 3] = pulled * u[part]
    slopes[OFFSET] = axes
    slopes[DIAGONAL] = pulled * centred[:, None]
    for column, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)), start=OFF_DIAGONAL.start):
        slopes[column] = pulled[i] * centred[j] + pulled[j] * centred[i]
    slopes[STRENGTH] = -_dot(pulled, earth[:, None]) / parameters[STRENGTH]
    slopes[SIN_DIP] = -_dot(pulled, by_dip[:, None])
    slopes[FIELD_LAG] = _dot(turned, _cross(down, _across(samples.down_rate))[:, None])
    slopes[REGRESSOR_LAG] = -_dot(pulled, _across(correction.added(samples.u_rate))[:, None])
    slopes[APPLIED_LAG] = _dot(axes, _across(samples.raw_rate)[:, None])
    slopes[TILT] = -turned[:2]
    lean = _across(samples.lean)
    for place, start in enumerate(range(LEAN.start, LEAN.stop, 2)):
        slopes[start : start + 2] = slopes[TILT] * lean[2 * place : 2 * place + 2, None]
    slopes[BLUR] = _dot(pulled, _across(correction.added(samples.u_blur))[:, None])
    slopes[SLOW] = _dot(pulled, _across(correction.added(samples.u_slow))[:, None])
    columns[0] = _dot(axes, (inverse @ (corrected - earth))[:, None])
    columns[0] += np.tensordot(parameters[NUISANCE], slopes[NUISANCE], axes=1)
    columns[1] = np.tensordot(correction.vector, pulled, axes=1)
    return columns


def _earth(
    corrected: FloatArray, down: FloatArray, parameters: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The earth's field where each reading points, and its change by the dip's sine, (3, n)."""
    strength, sine = parameters[STRENGTH], np.clip(parameters[SIN_DIP], -0.999, 0.999)
    cosine = np.sqrt(1.0 - sine**2)
    north = _unit(corrected - _dot(corrected, down) * down)
    return strength * (cosine * north + sine * down), strength * (down - sine / cosine * north)


def _axes(earth: FloatArray, down: FloatArray, inverse: FloatArray) -> FloatArray:
    """Unit vectors in sensor axes along the field and across it, both square to a turn.

    Shape (3, 2, n).
    """
    turn = _unit(inverse @ _cross(down, earth))
    along = inverse @ earth
    along = _unit(along - _dot(along, turn) * turn)
    return np.stack([along, _cross(turn, along)], axis=1)


def _across(rows: FloatArray) -> FloatArray:
    """Rows (n, k) as columns (k, n) that lie one after the other in memory."""
    return np.ascontiguousarray(rows.T)


def _turned(matrix: FloatArray, vectors: FloatArray) -> FloatArray:
    """A symmetric matrix times every vector of (3, 2, n)."""
    return np.asarray((matrix @ vectors.reshape(3, -1)).reshape(vectors.shape))


def _dot(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(one[0] * other[0] + one[1] * other[1] + one[2] * other[2])


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.sqrt(_dot(vectors, vectors)), 1e-9))


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Vector products along the first axis; NumPy's own takes three times as long."""
    return np.stack(
        [
            one[1] * other[2] - one[2] * other[1],
            one[2] * other[0] - one[0] * other[2],
            one[0] * other[1] - one[1] * other[0],
        ]
    )


def correction_at(parameters: FloatArray) -> Correction:
    """The correction among the parameters."""
    return unpack(np.delete(parameters, slice(CORRECTION_SIZE, SIZE)))


def motor_columns(slopes: FloatArray) -> FloatArray:
    """Of derivatives (size, 2, n) those by the motor vectors of all parts, shape (k, 3, 2, n)."""
    return np.concatenate([slopes[MOTOR], slopes[SIZE:]]).reshape(-1, 3, *slopes.shape[1:])


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
