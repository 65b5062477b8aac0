"""The Cramér-Rao bound of a simulated recording: what the best estimator possible would leave.

Nothing here is taken from the fit under test but the formula of the correction. The twelve
parameters are free around the truth, with a prior as wide as the calibration in force was made;
seen are, at each reading, the field's strength and its part along the attitude's vertical. What
the benchmark puts on top of a simulated recording is known here in size, not in value: white
noise, drift, tilt that is constant, that wanders and that follows lean. Lags and current are taken
as known, so the bound is a little hopeful.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magcomp.align.readings import is_new
from magcomp.geometry import body_from_earth
from magcomp.model import Correction, FloatArray, Recording, Series, interpolate, pack, unpack

MOST_READINGS = 400
TRUNCATION_MGAUSS = 0.3
KNOWN_STRENGTH, KNOWN_SINE = 0.005, 0.01
"""How well the world model tells the field, as shares."""

CALIBRATED, OPEN = (4.0, 0.005), (300.0, 0.15)
"""Widths of offsets in mGauss and of soft iron: an ordinary calibration in force, and none."""

_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class Sizes:
    """Standard deviations of what disturbs: mGauss, radians, and seconds for how long it lasts."""

    noise: float
    drift: float
    drift_s: float
    level: float
    wander: float
    wander_s: float
    lean: float


def covariance(
    recording: Recording, exact: Correction, ned: FloatArray, sizes: Sizes, *, calibrated: bool
) -> FloatArray:
    """Of the parameters in the order of :func:`magcomp.model.pack`, shape (12, 12).

    Parameters
    ----------
    recording
        As simulated, before anything is put on top.
    exact
        The correction that undoes everything, its motor vector per ampere.
    ned
        Earth's field, mGauss.
    sizes
        Of what is put on top.
    calibrated
        Whether the exact hard and soft iron are in force.
    """
    time, each, attitude, amperes = _seen(recording)
    down, field = _directions(attitude, ned)
    strength, sine = float(np.linalg.norm(ned)), float(ned[2] / np.linalg.norm(ned))
    along = np.stack([field / strength, down], axis=1)  # what is compared, (n, 2, 3)
    tip = np.cross(down, field)[:, :2]  # change of the vertical part by a turn of the attitude
    lean = attitude[:, :2] - np.median(attitude[:, :2], axis=0)

    slopes = np.zeros((len(time), 2, 18))
    slopes[:, :, :12] = along @ _of_correction(field, amperes, exact)
    slopes[:, 0, 12] = -1.0
    slopes[:, 1, 12:14] = -sine, -strength
    slopes[:, 1, 14:16], slopes[:, 1, 16:] = tip, tip * lean
    prior = np.concatenate(
        [
            np.full(3, 1e3),
            np.repeat(CALIBRATED if calibrated else OPEN, (3, 6)),
            [KNOWN_STRENGTH * strength, KNOWN_SINE],
            np.full(2, max(sizes.level, 1e-6)),
            np.full(2, max(sizes.lean, 1e-6)),
        ]
    )

    errors = _of_errors(time, along @ exact.soft_iron, tip, each, sizes)
    white = np.linalg.solve(np.linalg.cholesky(errors), slopes.reshape(-1, 18))
    information = white.T @ white + np.diag(prior**-2.0)
    return np.asarray(np.linalg.inv(information)[:12, :12])


def _seen(recording: Recording) -> tuple[FloatArray, int, FloatArray, FloatArray]:
    """Times of new readings, how many each stands for, and attitude and current there."""
    attitude, current = recording.attitude, recording.current
    if attitude is None or current is None:
        raise SystemExit(f"{recording.source} must hold attitude and current to have a bound")
    series = recording.field[min(recording.field)]
    time = series.time[is_new(series.value)]
    time = time[(time > current.time[0]) & (time < current.time[-1])]
    each = -(-len(time) // MOST_READINGS)
    time = time[::each]
    turning = Series(attitude.time, np.unwrap(attitude.value, axis=0))
    return time, each, interpolate(turning, time), interpolate(current, time)


def _directions(attitude: FloatArray, ned: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gravity and the earth's field in body axes, shape (n, 3) each."""
    turned = body_from_earth(*attitude.T)
    return turned[:, :, 2], turned @ ned


def _of_correction(field: FloatArray, amperes: FloatArray, exact: Correction) -> FloatArray:
    """Change of the corrected field by motor vector, offset and soft iron, shape (n, 3, 12)."""
    inverse = np.linalg.inv(exact.soft_iron)
    shifted = (field - exact.added(amperes)) @ inverse.T
    slopes = np.zeros((len(field), 3, 12))
    slopes[:, :, :3] = amperes[:, None, None] * np.eye(3)
    slopes[:, :, 3:6] = exact.soft_iron
    for column, (i, j) in enumerate(_ENTRIES, start=6):
        slopes[:, i, column] += shifted[:, j]
        if i != j:
            slopes[:, j, column] += shifted[:, i]
    return slopes


def _of_errors(
    time: FloatArray, along: FloatArray, tip: FloatArray, each: int, sizes: Sizes
) -> FloatArray:
    """Covariance of what is compared, shape (2 n, 2 n)."""
    count = len(time)
    apart = np.abs(time[:, None] - time)
    alike = np.einsum("ngk,mhk->ngmh", along, along)
    errors = sizes.drift**2 * np.exp(-apart / sizes.drift_s)[:, None, :, None] * alike
    wander = sizes.wander**2 * np.exp(-apart / sizes.wander_s) * (tip @ tip.T)
    errors[:, 1, :, 1] += wander
    rows = np.arange(count)
    errors[rows, :, rows, :] += sizes.noise**2 / each * np.einsum("ngk,nhk->ngh", along, along)
    errors[rows, :, rows, :] += TRUNCATION_MGAUSS**2 / each * np.eye(2)
    return np.asarray(errors.reshape(2 * count, 2 * count))


def drawn(exact: Correction, spread: FloatArray, rng: np.random.Generator) -> Correction:
    """A correction as an estimator that reaches the bound would give it."""
    return unpack(rng.multivariate_normal(pack(exact), spread, method="eigh"))
