"""Robust non-linear least squares with priors, noise levels and honest covariance.

The estimate minimises

    Σ ρ(r / σ) + ½ (p − p₀)ᵀ P (p − p₀),    ρ the soft-L1 loss,

by Levenberg–Marquardt on reweighted residuals, σ re-estimated per kind of
residual from the residuals themselves. Residuals of a flight are correlated in
time (the current is known only now and then), so the covariance is built from
sums over blocks of time, not from single readings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from magcomp.model import BoolArray, FloatArray, IntArray, median, usual_steps

ROUNDS = 6
"""σ is re-estimated this often at most."""

LOSS_SCALE = 2.0
"""Residuals beyond this many σ count linearly."""

NOISE_FLOOR = 0.2
"""mGauss: readings are rounded to whole ones, so no σ is less."""

_MAD_TO_STD = 1.4826
_STEPS = 12
_DAMPING_START = 1e-6
_DAMPING_MOST = 1e3
_ANOTHER = 0.9
_GAP_S, _GAP_STEPS = 2.0, 5.0
NEGLIGIBLE = 1e-3
"""A gain of log-likelihood that no digit of the answer notices."""

Residuals = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Parameters (k,) → residuals (n, g) of g kinds and their derivatives (n, g, k)."""


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known before the data: a mean and a width per parameter.

    Attributes
    ----------
    mean, width
        Shape (k,). Width 0 holds a parameter; infinity leaves it to the data.
    """

    mean: FloatArray
    width: FloatArray

    @property
    def precision(self) -> FloatArray:
        """1 / width², 0 where a parameter is held (it does not move) or free."""
        held = self.width == 0.0
        return np.where(held, 0.0, 1.0 / np.where(held, 1.0, self.width) ** 2)


@dataclass(frozen=True, eq=False)
class Estimate:
    """A solution.

    Attributes
    ----------
    parameters
        Shape (k,).
    covariance
        Shape (k, k); rows and columns of held parameters are zero.
    noise
        σ of each kind of residual, shape (g,).
    cost
        Σ ρ of the data at the solution, with each kind's log σ: comparable between regressors.
    residuals
        Shape (n, g).
    """

    parameters: FloatArray
    covariance: FloatArray
    noise: FloatArray
    cost: float
    residuals: FloatArray


def solve(
    residuals: Residuals,
    start: FloatArray,
    prior: Prior,
    *,
    blocks: IntArray | None = None,
    doubt: Prior | None = None,
    noise_floor: float = NOISE_FLOOR,
    noise: FloatArray | None = None,
    rounds: int = ROUNDS,
    enough: float = NEGLIGIBLE,
    feasible: Callable[[FloatArray], bool] = lambda _: True,
) -> Estimate:
    """Find the most probable parameters.

    Parameters
    ----------
    residuals
        The model.
    start
        Where to begin, shape (k,); held parameters stay there.
    prior
        Means and widths.
    blocks
        Block number of each row, shape (n,), ascending; rows of a block are taken to share
        their error. None skips the covariance, for use inside a search.
    doubt
        The prior the covariance is made with, where it differs: parameters held in the search
        may still be uncertain. The same prior by default.
    noise_floor
        Least σ, in the unit of the residuals (rounding of the readings).
    noise
        σ per kind to be used as they are, shape (g,).
    rounds
        How often σ is re-estimated at most; few in a search that only compares.
    enough
        A step that raises the log-likelihood by no more is the last one.
    feasible
        Steps to parameters for which this is false are not taken.
    """
    parameters = start.astype(np.float64)
    values, slopes = residuals(parameters)
    scale = spread_of(values, noise_floor) if noise is None else noise
    for _ in range(rounds if noise is None else 1):
        parameters, values, slopes = _descend(
            residuals, parameters, values, slopes, prior, scale, enough, feasible
        )
        if noise is not None:
            break
        previous, scale = scale, spread_of(values, noise_floor)
        if np.all(np.abs(scale / previous - 1) < 0.02):
            break
    weights = _weights(values / scale)
    covariance = (
        _covariance(
            values,
            slopes,
            weights / scale**2,
            weights**3 / scale**2,
            prior if doubt is None else doubt,
            blocks,
        )
        if blocks is not None
        else np.zeros((len(parameters), len(parameters)))
    )
    return Estimate(
        parameters=parameters,
        covariance=covariance,
        noise=scale,
        cost=_loss(values / scale) + len(values) * float(np.sum(np.log(scale))),
        residuals=values,
    )


def one_step(
    values: FloatArray,
    slopes: FloatArray,
    start: FloatArray,
    prior: Prior,
) -> FloatArray:
    """The parameters after a single Gauss–Newton step from a point near the solution.

    Parameters
    ----------
    values, slopes
        Residuals at ``start``, shape (n, g), and their derivatives, shape (n, g, k).
    start
        Near the solution, shape (k,).
    prior
        As for :func:`solve`.
    """
    moving = prior.width > 0.0
    scale = spread_of(values)
    hessian, gradient = _normal(values, slopes, _weights(values / scale) / scale**2, moving)
    precision = prior.precision[moving]
    gradient += precision * (start - prior.mean)[moving]
    parameters = start.astype(np.float64)
    parameters[moving] -= np.linalg.pinv(hessian + np.diag(precision), hermitian=True) @ gradient
    return parameters


def _normal(
    values: FloatArray, slopes: FloatArray, weights: FloatArray, moving: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Information matrix and gradient of weighted residuals, of the parameters that move."""
    root = np.sqrt(weights)
    rooted = _columns(slopes, moving) * root.T
    flat = rooted.reshape(len(rooted), -1)
    # A matrix times its own transpose takes half the multiplications.
    return flat @ flat.T, flat @ (values * root).T.reshape(-1)


def _columns(slopes: FloatArray, moving: BoolArray) -> FloatArray:
    """The derivatives by each parameter that moves, one after the other, shape (m, g, n)."""
    return np.asarray(slopes.T if moving.all() else slopes.T[moving])


def spread_of(values: FloatArray, floor: float = NOISE_FLOOR) -> FloatArray:
    """Robust σ of each kind of residual, shape (g,), and at least the rounding of the readings.

    Examples
    --------
    One reading far out does not widen it:

    >>> spread_of(np.array([[-1.0], [1.0], [-1.0], [1.0], [500.0]]), 0.1).round(4).tolist()
    [1.4826]
    """
    return np.maximum(_MAD_TO_STD * median(np.abs(values)), floor)


def _weights(z: FloatArray) -> FloatArray:
    return np.asarray(1.0 / np.sqrt(1.0 + (z / LOSS_SCALE) ** 2))


def _loss(z: FloatArray) -> float:
    return float(LOSS_SCALE**2 * np.sum(np.sqrt(1.0 + (z / LOSS_SCALE) ** 2) - 1.0))


def _descend(
    residuals: Residuals,
    parameters: FloatArray,
    values: FloatArray,
    slopes: FloatArray,
    prior: Prior,
    scale: FloatArray,
    enough: float,
    feasible: Callable[[FloatArray], bool],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Levenberg–Marquardt steps at fixed σ until they no longer help."""
    moving = prior.width > 0.0
    precision = prior.precision[moving]

    def objective(at: FloatArray, left: FloatArray) -> float:
        away = (at - prior.mean)[moving]
        return _loss(left / scale) + 0.5 * float(away @ (precision * away))

    now = objective(parameters, values)
    damping = _DAMPING_START
    for _ in range(_STEPS):
        weights = _weights(values / scale) / scale**2
        hessian, gradient = _normal(values, slopes, weights, moving)
        hessian += np.diag(precision)
        gradient += precision * (parameters - prior.mean)[moving]
        progress, refused = False, np.inf
        while damping < _DAMPING_MOST:
            damped = hessian + damping * np.diag(np.diag(hessian) + 1e-12)
            step = np.zeros_like(parameters)
            try:
                step[moving] = -np.linalg.solve(damped, gradient)
            except np.linalg.LinAlgError:
                # Readings of one attitude and one control quantity leave a direction undetermined.
                damping *= 10.0
                continue
            promised = -float(gradient @ step[moving])
            if promised < enough:
                break
            trial = parameters + step
            # A step that is hardly another than the last one is refused as that was.
            if promised < _ANOTHER * refused and feasible(trial):
                refused = promised
                trial_values, trial_slopes = residuals(trial)
                value = objective(trial, trial_values)
                if value <= now:
                    progress = now - value > enough
                    parameters, values, slopes, now = trial, trial_values, trial_slopes, value
                    damping = max(damping * 0.1, _DAMPING_START)
                    break
            damping *= 10.0
        if not progress:
            break
    return parameters, values, slopes


def _covariance(
    values: FloatArray,
    slopes: FloatArray,
    weights: FloatArray,
    bend: FloatArray,
    prior: Prior,
    blocks: IntArray,
) -> FloatArray:
    """Sandwich covariance with scores summed over blocks, shrunk where blocks are few."""
    moving = prior.width > 0.0
    size = int(moving.sum())
    # The slope of the score: d(w·z)/dz of the soft-L1 loss is w³, not w.
    data, _ = _normal(values, slopes, bend, moving)
    precision = np.diag(prior.precision[moving])
    bread = np.linalg.pinv(data + precision + 1e-12 * np.eye(size), hermitian=True)
    scores = np.sum(_columns(slopes, moving) * (weights * values).T, axis=1)
    starts = np.flatnonzero(np.r_[True, np.diff(blocks) != 0])
    per_block = np.add.reduceat(scores, starts, axis=1)
    count = len(starts)
    meat = per_block @ per_block.T * (count / max(count - 1, 1))
    # With few blocks the summed scores say little about each direction: lean on one common factor.
    inflation = max(1.0, float(np.trace(np.linalg.pinv(data) @ meat)) / size)
    trust = count / (count + 4.0 * size)
    meat = trust * meat + (1 - trust) * inflation * data
    covariance = np.zeros((len(moving), len(moving)))
    covariance[np.ix_(moving, moving)] = bread @ (meat + precision) @ bread
    return covariance


def recorded_time(time: FloatArray) -> FloatArray:
    """Seconds of recording up to each moment, shape (n,): what a gap lasts does not count.

    A clock that jumps by an hour, or a link that was lost for one, says nothing.
    """
    steps = np.diff(time)
    if not len(steps):
        return np.zeros(len(time))
    longest = np.maximum(_GAP_S, _GAP_STEPS * usual_steps(steps))
    return np.concatenate([[0.0], np.cumsum(np.minimum(steps, longest))])


def time_blocks(time: FloatArray, seconds: float) -> IntArray:
    """Number of the block of ``seconds`` of recording each moment falls into, shape (n,).

    Examples
    --------
    >>> time_blocks(np.array([10.0, 11.9, 12.0, 17.0]), 2.0).tolist()
    [0, 0, 1, 3]
    """
    return np.asarray(np.floor(recorded_time(time) / seconds), dtype=np.intp)
