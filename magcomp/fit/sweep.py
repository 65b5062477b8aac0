"""The vehicle stands still and the control quantity changes: the field against it, directly."""

from __future__ import annotations

import numpy as np

from magcomp.errors import FitRejectedError
from magcomp.fit.drift import covariance_of_drift
from magcomp.fit.flight import (
    BLOCK_S,
    LAG_MEAN_S,
    LAG_MOST_S,
    LAG_WIDTH_S,
    OPEN_OFFSET_MGAUSS,
    OPEN_SOFT_IRON,
    TRUSTED_SOFT_IRON,
    UNPROVEN_OFFSET_MGAUSS,
    UNPROVEN_SOFT_IRON,
    Problem,
    is_calibrated,
)
from magcomp.fit.line import line_through
from magcomp.fit.robust import Prior, solve, time_blocks
from magcomp.fit.steady import steady_levels
from magcomp.model import (
    CORRECTION_SIZE,
    MOTOR,
    OFFSET,
    SOFT_IRON,
    Correction,
    FloatArray,
    IntArray,
    Lags,
    Level,
    MotorFit,
    Samples,
)

STILL_TILT_RAD = np.radians(5.0)
"""A vehicle on its legs tilts less than this with its motors running."""

STILL_WOBBLE_RAD, _WOBBLE_S = np.radians(0.2), 5.0
"""A vehicle on its legs stays within this of its mean attitude over seconds for half of the time;
one that hovers never does."""

STILL_SHARE = 0.02
"""Standing still, the control quantity explains the field but for this share of its strength."""

_START, _SLOPE, _LAG = slice(0, 3), slice(3, -1), -1
_LAGS_TRIED = np.arange(-0.1, 0.501, 0.05)


def is_still(samples: Samples) -> bool:
    """Whether the vehicle neither tilted nor turned.

    The autopilot's own heading is no witness: the interference moves it. Standing still means
    that the tilt stays and that a straight line in u explains the field.
    """
    middle = np.median(samples.attitude[:, :2], axis=0)
    tilt = np.quantile(np.abs(samples.attitude[:, :2] - middle), 0.95, axis=0)
    if np.any(tilt > STILL_TILT_RAD) or _wobble(samples) > STILL_WOBBLE_RAD:
        return False
    design = np.column_stack([np.ones(len(samples)), samples.u])
    line = np.linalg.lstsq(design, samples.raw, rcond=None)[0]
    left = np.linalg.norm(samples.raw - design @ line, axis=1)
    strength = float(np.median(np.linalg.norm(samples.present, axis=1)))
    return bool(np.median(left) < STILL_SHARE * strength)


def _wobble(samples: Samples) -> float:
    """Median departure of roll and pitch from their mean over seconds, radians, the larger one."""
    block = time_blocks(samples.time, _WOBBLE_S)
    tilt = samples.attitude[:, :2].T
    return float(max(np.median(np.abs(from_block_mean(angle, block))) for angle in tilt))


def from_block_mean(values: FloatArray, block: IntArray) -> FloatArray:
    """Each value less the mean of its block, shape (n,).

    Examples
    --------
    >>> from_block_mean(np.array([1.0, 3.0, 7.0]), np.array([0, 0, 2])).tolist()
    [-1.0, 1.0, 0.0]
    """
    mean = np.bincount(block, values) / np.maximum(np.bincount(block), 1)
    return np.asarray(values - mean[block])


def fit_sweep(problem: Problem, *, lag: float | None = None, drifts: bool = True) -> MotorFit:
    """Raw field = constant + slope · u(t − lag), robustly; MOT = −D · slope.

    Parameters
    ----------
    problem
        The compass and its control quantity.
    lag
        The regressor's lag where it is known; estimated otherwise.
    drifts
        Whether the covariance is to hold the sensor's drift; nobody asks for it in a search.

    Raises
    ------
    FitRejectedError
        Where the control quantity does not change.

    Notes
    -----
    docs/method.md, Sweeps: at rest only the hard iron moves. A slope g of the raw field becomes
    MOT = −s · D · g (docs/autopilots.md, ArduPilot: correction).
    """
    parts = problem.control.parts
    begin = np.zeros(4 + 3 * parts)
    begin[_LAG] = _nearest_lag(problem) if lag is None else lag
    at_start = problem.sample(Lags(0.0, float(begin[_LAG])))
    if not np.ptp(at_start.total) > 0.0:
        raise FitRejectedError(
            f"The {problem.control.kind} must change during a sweep; instead it stayed at "
            f"{at_start.total[0]:.2f}"
        )
    design = np.column_stack([np.ones(len(at_start)), at_start.u])
    begin[:_LAG] = np.linalg.lstsq(design, at_start.raw, rcond=None)[0].reshape(-1)
    width = np.full(len(begin), np.inf)
    width[_LAG] = LAG_WIDTH_S if lag is None else 0.0
    mean = begin.copy()
    mean[_LAG] = LAG_MEAN_S if lag is None else lag

    def residuals(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        rows = problem.sample(Lags(0.0, float(parameters[_LAG])))
        vectors = parameters[_SLOPE].reshape(parts, 3)
        left = rows.raw - parameters[_START] - rows.u @ vectors
        slopes = np.zeros((len(rows), 3, len(begin)))
        for axis in range(3):
            slopes[:, axis, axis] = -1.0
            slopes[:, axis, 3 + axis : _LAG : 3] = -rows.u
        slopes[:, :, _LAG] = rows.raw_rate + rows.u_rate @ vectors
        return left, slopes

    found = solve(
        residuals,
        begin,
        Prior(mean, width),
        blocks=time_blocks(problem.readings.time, BLOCK_S / 5),
        feasible=lambda p: bool(abs(p[_LAG]) < LAG_MOST_S),
    )
    samples = problem.sample(Lags(0.0, float(found.parameters[_LAG])))
    covariance = found.covariance.copy()
    if drifts:
        fitted = np.column_stack([np.ones(len(samples)), samples.u])
        drift = covariance_of_drift(samples.time, found.residuals, fitted)
        covariance[:_LAG, :_LAG] += np.kron(drift, np.eye(3))
    return _answer(problem, samples, found.parameters, covariance, float(np.max(found.noise)))


def _nearest_lag(problem: Problem) -> float:
    """The lag of a coarse search: steps of the control quantity make many local minima."""

    def left(lag: float) -> float:
        rows = problem.sample(Lags(0.0, lag))
        design = np.column_stack([np.ones(len(rows)), rows.u])
        line = np.linalg.lstsq(design, rows.raw, rcond=None)[0]
        return float(np.sum(np.abs(rows.raw - design @ line)))

    return float(min(_LAGS_TRIED, key=left))


def _lag_std(problem: Problem, stated: float) -> float:
    """Standard error of a lag seen in steps: no better than when the steps were sampled."""
    interval = float(np.median(np.diff(problem.control.series.time)))
    return float(np.hypot(stated, interval / np.sqrt(12.0)))


def _answer(
    problem: Problem,
    samples: Samples,
    parameters: FloatArray,
    covariance: FloatArray,
    noise: float,
) -> MotorFit:
    present = problem.readings.in_force[-1].correction
    shape, slope = present.soft_iron, parameters[_SLOPE].reshape(-1, 3)
    parts = len(slope)
    correction = Correction(present.offset, shape, -shape @ slope.T)
    full = np.zeros((CORRECTION_SIZE + 3 * (parts - 1),) * 2)
    full[:CORRECTION_SIZE, :CORRECTION_SIZE] = np.diag(_unseen_variance(present))
    doubt = np.repeat(TRUSTED_SOFT_IRON**2 * np.sum(slope**2, axis=1), 3)
    shapes = np.kron(np.eye(parts), shape)
    of_motors = np.r_[MOTOR, CORRECTION_SIZE : len(full)]
    full[np.ix_(of_motors, of_motors)] = shapes @ covariance[_SLOPE, _SLOPE] @ shapes.T
    full[of_motors, of_motors] += doubt
    corrected = correction.apply(samples.raw, samples.u)
    levels = _levels(problem, samples, parameters, present, noise)
    return MotorFit(
        compass=samples.compass,
        method="sweep",
        why=(
            f"the vehicle stood still while the {problem.control.kind} changed; offsets and soft "
            "iron are taken as they are"
        ),
        regressor=problem.control.kind,
        origin=problem.control.origin,
        correction=correction,
        covariance=full,
        free=frozenset({"motor"}),
        lags=Lags(np.nan, float(parameters[_LAG])),
        lags_std=Lags(np.nan, _lag_std(problem, float(np.sqrt(covariance[_LAG, _LAG])))),
        strength=float(np.median(np.linalg.norm(corrected, axis=1))),
        vertical=float(np.median(np.einsum("ij,ij->i", corrected, samples.down))),
        noise=noise,
        levels=levels,
        line=line_through(levels) if len(levels) > 1 else None,
        u_low=float(np.quantile(samples.total, 0.02)),
        u_high=float(np.quantile(samples.total, 0.98)),
        count=len(samples),
        numbers=problem.control.numbers,
    )


def _unseen_variance(present: Correction) -> FloatArray:
    """Variances of the 12 parameters a vehicle at rest cannot show; of the motor vector, 0."""
    known = is_calibrated(present)
    variance = np.zeros(CORRECTION_SIZE)
    variance[OFFSET] = (UNPROVEN_OFFSET_MGAUSS if known else OPEN_OFFSET_MGAUSS) ** 2
    variance[SOFT_IRON] = (UNPROVEN_SOFT_IRON if known else OPEN_SOFT_IRON) ** 2
    return variance


def _levels(
    problem: Problem,
    samples: Samples,
    parameters: FloatArray,
    present: Correction,
    noise: float,
) -> tuple[Level, ...]:
    """Mean raw field at each steady level, as a centre; the ends of the range where none is."""
    moved = samples.raw - parameters[_START] - present.offset
    level = steady_levels(problem.control.total, samples)
    groups = [level == k for k in range(int(level.max(initial=-1)) + 1)]
    if len(groups) < 2:
        middle = np.median(samples.total)
        groups = [samples.total <= middle, samples.total > middle]
    levels = []
    for rows in groups:
        count = int(np.count_nonzero(rows))
        if count == 0:
            continue
        u = samples.total[rows]
        levels.append(
            Level(
                u=float(u.mean()),
                u_std=float(np.hypot(u.std() / np.sqrt(count), 1e-3)),
                centre=np.median(moved[rows], axis=0),
                covariance=(noise**2 / count + 0.01) * np.eye(3),
                count=count,
            )
        )
    return tuple(levels)
