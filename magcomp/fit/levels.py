"""The paper's method: turns at constant control quantities, and the line through the centres.

Readings at steady control quantities are grouped into levels. One soft-iron
shape is shared by all levels and every level has a centre of its own
(ellipsoid.py); the centres lie on a line in space (line.py), and the position
along it, regressed on the control quantity, gives the offset at any control
quantity (docs/method.md, The paper's algorithm).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from magcomp.fit.ellipsoid import Ellipsoids, fit_ellipsoids
from magcomp.fit.flight import BLOCK_S, Problem
from magcomp.fit.line import line_through
from magcomp.fit.residual import departures
from magcomp.fit.robust import time_blocks
from magcomp.fit.steady import steady_levels
from magcomp.fit.wander import Wander
from magcomp.model import (
    CORRECTION_SIZE,
    MOTOR,
    OFFSET,
    SOFT_IRON,
    BoolArray,
    Correction,
    FloatArray,
    IntArray,
    Lags,
    Level,
    Line,
    MotorFit,
    Samples,
    symmetric,
)

LEAST_COVERAGE = 0.03
"""Least eigenvalue of the mean outer product of directions; 1/3 for a full sphere, 0 for a turn
about one axis."""

_U_FLOOR = 1e-3
_MOST_TIMES = 200
_LEAST_IN_BIN = 20


def usable_levels(problem: Problem) -> tuple[Samples, IntArray]:
    """Readings that belong to a level turned through enough attitudes, and their level.

    Returns
    -------
    Samples
        Only the rows of usable levels.
    ndarray, shape (n,)
        Level 0 … k − 1 of each row, in order of the control quantity; empty where none is usable.
    """
    samples = problem.sample(Lags(0.0, 0.0))
    level = steady_levels(problem.control.total, samples)
    kept = [k for k in range(int(level.max(initial=-1)) + 1) if _covered(samples, level == k)]
    rows = np.isin(level, kept)
    return samples.where(rows), np.searchsorted(np.array(kept, dtype=np.intp), level[rows])


def _covered(samples: Samples, rows: BoolArray) -> bool:
    """Whether the field came from enough directions of the body to hold an ellipsoid's centre."""
    if np.count_nonzero(rows) < 60:
        return False
    down = samples.down[rows]
    return bool(np.linalg.eigvalsh(down.T @ down / len(down))[0] > LEAST_COVERAGE)


def fit_levels(problem: Problem, samples: Samples, level: IntArray) -> tuple[MotorFit, Ellipsoids]:
    """Ellipsoids of one shape, and the weighted line through their centres.

    Parameters
    ----------
    problem
        The compass and its control quantity.
    samples, level
        From :func:`usable_levels`; at least two levels.
    """
    blocks = time_blocks(samples.time, BLOCK_S)
    ellipsoids = fit_ellipsoids(samples.raw, level, problem.earth.strength, blocks=blocks)
    return through_centres(problem, samples, level, ellipsoids), ellipsoids


def through_centres(
    problem: Problem, samples: Samples, level: IntArray, ellipsoids: Ellipsoids
) -> MotorFit:
    """The weighted line through the centres of ellipsoids.

    Parameters
    ----------
    problem, samples, level
        As for :func:`fit_levels`.
    ellipsoids
        One a level; their covariance weighs the centres.
    """
    levels = tuple(
        _level(samples, level == k, ellipsoids, k) for k in range(len(ellipsoids.centres))
    )
    line = line_through(levels)
    slope = line.slope * line.direction
    origin = line.point + line.intercept * line.direction
    correction = Correction(
        offset=-origin, soft_iron=ellipsoids.soft_iron, motor=-ellipsoids.soft_iron @ slope
    )
    corrected = correction.apply(samples.raw, samples.u)
    along_gravity = np.einsum("ij,ij->i", corrected, samples.down)
    return MotorFit(
        compass=samples.compass,
        method="levels",
        why=f"the vehicle was turned at {len(levels)} steady levels of {problem.control.kind}",
        regressor=problem.control.kind,
        origin=problem.control.origin,
        correction=correction,
        covariance=_covariance(ellipsoids, levels, line, correction),
        free=frozenset({"motor", "offset", "diagonal", "off-diagonal"}),
        lags=Lags(np.nan, np.nan),
        lags_std=Lags(np.nan, np.nan),
        strength=ellipsoids.strength,
        vertical=float(np.median(along_gravity)),
        noise=ellipsoids.noise,
        levels=levels,
        line=line,
        u_low=min(lv.u for lv in levels),
        u_high=max(lv.u for lv in levels),
        count=len(samples),
    )


def drift_of_centres(time: FloatArray, level: IntArray, wander: Wander) -> FloatArray:
    """How a sensor's drift moves the centres, mGauss², shape (k, k), alike on each axis.

    Parameters
    ----------
    time, level
        Of each reading, shape (n,).
    wander
        Size and time of the drift.

    Notes
    -----
    The readings of a level were taken one after the other and share what the offsets had drifted
    by; a centre is off by the mean of it (docs/method.md, Levels).

    Examples
    --------
    Two levels, hours apart, of a second each:

    >>> time, level = np.array([0.0, 1.0, 9e3, 9e3 + 1.0]), np.array([0, 0, 1, 1])
    >>> drift_of_centres(time, level, Wander(drift_mgauss=2.0, drift_s=60.0)).round(1).tolist()
    [[4.0, 0.0], [0.0, 4.0]]
    """
    count = int(level.max()) + 1
    when = [
        time[level == k][:: -(-np.count_nonzero(level == k) // _MOST_TIMES)] for k in range(count)
    ]
    shared = np.empty((count, count))
    for i in range(count):
        for j in range(count):
            apart = np.abs(when[i][:, None] - when[j])
            shared[i, j] = np.mean(np.exp(-apart / wander.drift_s))
    return np.asarray(wander.drift_mgauss**2 * shared)


def _level(samples: Samples, rows: BoolArray, ellipsoids: Ellipsoids, index: int) -> Level:
    u = samples.total[rows]
    return Level(
        u=float(u.mean()),
        u_std=float(np.hypot(u.std() / np.sqrt(len(u)), _U_FLOOR)),
        centre=ellipsoids.centres[index],
        covariance=ellipsoids.centre_covariance(index),
        count=len(u),
    )


def _covariance(
    ellipsoids: Ellipsoids, levels: tuple[Level, ...], line: Line, correction: Correction
) -> FloatArray:
    """Covariance of the 12 correction parameters, by the linear map from shape and centres.

    Notes
    -----
    offset and slope are weighted means of the centres, the weights of the line taken as given;
    motor = −D · slope carries the doubt of D and of the slope.
    """
    count = len(levels)
    u = np.array([level.u for level in levels])
    weight = 1.0 / np.array([np.trace(level.covariance) for level in levels])
    design = np.column_stack([np.ones(count), u])
    gain = np.linalg.solve(design.T @ (design * weight[:, None]), (design * weight[:, None]).T)
    slope = line.slope * line.direction
    shape = correction.soft_iron
    jacobian = np.zeros((CORRECTION_SIZE, 6 + 3 * count))
    jacobian[SOFT_IRON, :6] = np.eye(6)
    for axis in range(6):
        jacobian[MOTOR, axis] = -symmetric(np.eye(6)[axis]) @ slope
    for index in range(count):
        columns = slice(6 + 3 * index, 9 + 3 * index)
        jacobian[OFFSET, columns] = -gain[0, index] * np.eye(3)
        jacobian[MOTOR, columns] = -gain[1, index] * shape
    covariance = jacobian @ ellipsoids.covariance @ jacobian.T
    # Centres off the line by more than their errors say the line is only nearly true.
    excess = max(1.0, line.chi2 / line.degrees) if line.degrees else 1.0
    return np.asarray(covariance * excess)


def centres_of_flight(
    samples: Samples,
    correction: Correction,
    earth: tuple[float, float],
    noise: float,
    bins: int = 8,
) -> tuple[Level, ...]:
    """Centres at several control quantities from a flight, by what strength and dip leave over.

    Parameters
    ----------
    samples
        Readings.
    correction
        Any correction close to the truth.
    earth
        Strength and vertical part of the earth's field, mGauss.
    noise
        Spread of the residuals, mGauss.
    bins
        Levels of the control quantity, each with the same number of readings.

    Notes
    -----
    In each bin the corrected field may be off by one body-fixed vector δ. To first order
    r₁ = along · δ and r₂ = down · δ; the bin's centre is the correction's less D⁻¹ δ.
    """
    edges = np.unique(np.quantile(samples.total, np.linspace(0.0, 1.0, bins + 1)))
    bin_of = np.clip(np.searchsorted(edges, samples.total, side="right") - 1, 0, len(edges) - 2)
    corrected = correction.apply(samples.raw, samples.u)
    along = corrected / np.linalg.norm(corrected, axis=1, keepdims=True)
    directions = np.stack([along, samples.down], axis=1)
    left = departures(corrected, samples.down, *earth)
    inverse = np.linalg.inv(correction.soft_iron)
    levels = []
    for index in range(len(edges) - 1):
        rows = bin_of == index
        if np.count_nonzero(rows) < _LEAST_IN_BIN:
            continue
        delta, covariance = _leftover(directions[rows], left[rows], noise)
        u = samples.total[rows]
        levels.append(
            Level(
                u=float(u.mean()),
                u_std=float(np.hypot(u.std() / np.sqrt(len(u)), _U_FLOOR)),
                centre=correction.centre(float(u.mean())) + inverse @ delta,
                covariance=inverse @ covariance @ inverse.T,
                count=int(np.count_nonzero(rows)),
            )
        )
    return tuple(levels)


def _leftover(
    directions: FloatArray, left: FloatArray, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Robust vector δ and its covariance from directions (n, 2, 3) and residuals (n, 2)."""
    flat, value = directions.reshape(-1, 3), left.reshape(-1)
    weight = np.ones(len(value))
    ridge = (noise / 100.0) ** 2 * np.eye(3)
    for _ in range(5):
        normal = flat.T @ (flat * weight[:, None]) + ridge
        delta = np.linalg.solve(normal, flat.T @ (weight * value))
        weight = 1 / np.sqrt(1 + ((value - flat @ delta) / (2 * noise)) ** 2)
    # Errors stay alike for about a second of a 10 Hz flight: ten readings count as one.
    return np.asarray(delta), np.asarray(np.linalg.inv(normal) * noise**2 * 10.0)


def with_line(fit: MotorFit, levels: tuple[Level, ...]) -> MotorFit:
    """The fit with these centres and the line through them; unchanged below two levels."""
    if len(levels) < 2:
        return fit
    return replace(fit, levels=levels, line=line_through(levels))
