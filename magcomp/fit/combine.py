"""A sweep on the ground and a flight in one recording: each tells what the other cannot.

At rest the field against the control quantity gives the motor vector several times sharper than a
flight does, for no attitude has a part in it; the flight gives offsets and soft iron. The two use
different readings, so they are put together as two measurements (docs/method.md, Sweep and
flight).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from magcomp.fit.robust import recorded_time, time_blocks
from magcomp.fit.sweep import STILL_WOBBLE_RAD, from_block_mean, is_still
from magcomp.model import (
    CORRECTION_SIZE,
    MOTOR,
    SOFT_IRON,
    BoolArray,
    FloatArray,
    IntArray,
    MotorFit,
    Samples,
    pack,
    symmetric,
    unpack,
)

_BLOCK_S, _LEAST_S = 3.0, 12.0
_LEAST_RANGE, _IDLE_SHARE = 0.4, 0.15
_LEAST_FLOWN_SHARE = 0.3
_AGREE_CHI2 = 16.3
"""Three numbers differ by more than this, in squared standard errors, once in a thousand."""


def still_rows(samples: Samples) -> BoolArray | None:
    """The rows of the longest stretch at rest in which the motors were swept; None without one.

    Parameters
    ----------
    samples
        A recording that also holds a flight.

    Returns
    -------
    ndarray of bool, shape (n,)

    Notes
    -----
    Motors that idle do so on the ground: a climb without wind keeps its attitude too, but what the
    heading does meanwhile is not known.
    """
    block = time_blocks(samples.time, _BLOCK_S)
    quiet = _quiet_blocks(samples, block)[block]
    number = np.cumsum(np.r_[True, quiet[1:] != quiet[:-1]])
    recorded = recorded_time(samples.time)
    top = float(np.quantile(samples.total, 0.98))
    best, longest = None, _LEAST_S
    for index in np.unique(number[quiet]):
        rows = number == index
        u = samples.total[rows]
        seconds = float(np.ptp(recorded[rows]))
        swept = np.ptp(u) > _LEAST_RANGE * top and u.min() < _IDLE_SHARE * top
        if seconds > longest and swept and is_still(samples.where(rows)):
            best, longest = rows, seconds
    if best is None or np.mean(~best) < _LEAST_FLOWN_SHARE:
        return None
    return np.asarray(best)


def _quiet_blocks(samples: Samples, block: IntArray) -> BoolArray:
    """Whether roll and pitch stay where they are, for each block."""
    count = np.maximum(np.bincount(block), 1)
    quiet = np.ones(len(count), dtype=bool)
    for angle in samples.attitude[:, :2].T:
        spread = np.sqrt(np.bincount(block, from_block_mean(angle, block) ** 2) / count)
        quiet &= spread < STILL_WOBBLE_RAD
    return quiet


def with_sweep(fit: MotorFit, sweep: MotorFit) -> MotorFit:
    """The flight's fit with a sweep's motor vector as one more measurement.

    Parameters
    ----------
    fit
        Of the flight, from readings that the sweep did not use.
    sweep
        Of the stretch at rest.

    Returns
    -------
    MotorFit
        The flight's own where the two contradict each other: what the vehicle stood on, or what
        held it, then had a part in the sweep.

    Notes
    -----
    The sweep measures g = D⁻¹ · MOT, the shift of the sensor's field per unit, whatever the soft
    iron D is: g is a function of nine of the twelve parameters, and the flight's answer moves
    along its own covariance until both agree.
    """
    told, doubt = _sensor_shift(sweep)
    slopes = _shift_slopes(fit)
    gap = told - np.linalg.solve(fit.correction.soft_iron, fit.correction.vector)
    spread = slopes @ fit.covariance @ slopes.T + doubt
    if float(gap @ np.linalg.solve(spread, gap)) > _AGREE_CHI2:
        return replace(fit, why=f"{fit.why}; the sweep before or after it contradicts the flight")
    gain = np.linalg.solve(spread, slopes @ fit.covariance).T
    covariance = fit.covariance - gain @ spread @ gain.T
    return replace(
        fit,
        correction=unpack(pack(fit.correction) + gain @ gap),
        covariance=(covariance + covariance.T) / 2.0,
        why=f"{fit.why}; the motors' part is known from the sweep too",
    )


def _sensor_shift(sweep: MotorFit) -> tuple[FloatArray, FloatArray]:
    """G of a sweep and its covariance."""
    inverse = np.linalg.inv(sweep.correction.soft_iron)
    covariance = inverse @ sweep.covariance[MOTOR, MOTOR] @ inverse.T
    return inverse @ sweep.correction.vector, covariance


def _shift_slopes(fit: MotorFit) -> FloatArray:
    """Derivatives of D⁻¹ · MOT, shape (3, 12)."""
    inverse = np.linalg.inv(fit.correction.soft_iron)
    shift = inverse @ fit.correction.vector
    slopes = np.zeros((3, CORRECTION_SIZE))
    slopes[:, MOTOR] = inverse
    for index, place in enumerate(range(SOFT_IRON.start, SOFT_IRON.stop)):
        slopes[:, place] = -inverse @ symmetric(np.eye(6)[index]) @ shift
    return slopes
