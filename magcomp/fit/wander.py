"""Errors that last: tilt that wanders, offsets that drift, a current that is off for a while.

Readings of a minute share them, so a minute says little more than a reading, and least squares
both answers worse and believes itself more than it should. Here they are states of their own, two
tilts, three offsets and an error of the control quantity for each short stretch of time,
first-order Gauss–Markov processes whose sizes are those that make the residuals likeliest.
Marginalised, they leave a generalised least-squares problem; the precision of the states is a
band, so it costs linear time (docs/method.md, Flights).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from magcomp.fit.field_model import TILT
from magcomp.fit.robust import Prior, spread_of
from magcomp.model import OFFSET, FloatArray, IntArray

STATES = 6
"""Two tilts, three offsets, and the control quantity."""

LEAST_STRETCH_S, MOST_STRETCHES = 1.0, 400

DRIFTS_MGAUSS, DRIFTS_S = (0.2, 0.6, 1.5, 3.0, 6.0, 12.0), (20.0, 60.0, 200.0)

_TRIED: Mapping[str, tuple[float, ...]] = {
    "control_share": (0.001, 0.01, 0.03, 0.08, 0.15),
    "control_s": (1.0, 3.0, 10.0, 40.0),
    "tilt_rad": tuple(np.radians((0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0)).tolist()),
    "tilt_s": (3.0, 10.0, 30.0, 100.0),
    "drift_mgauss": DRIFTS_MGAUSS,
    "drift_s": DRIFTS_S,
}
_ROUNDS = 8
_NEGLIGIBLE = 0.5
_LEAST_TILT_RAD, _LEAST_DRIFT_MGAUSS = np.radians(0.12), 0.5
_LOSS_SCALE = 4.0
_STEPS = 4


@dataclass(frozen=True)
class Wander:
    """Sizes and times of the processes.

    Attributes
    ----------
    tilt_rad, tilt_s
        Of roll and pitch.
    drift_mgauss, drift_s
        Of the offsets.
    control_share, control_s
        Of the control quantity, as a share of its spread.
    """

    tilt_rad: float = float(np.radians(0.05))
    tilt_s: float = 10.0
    drift_mgauss: float = 0.6
    drift_s: float = 60.0
    control_share: float = 0.01
    control_s: float = 3.0

    @property
    def shows(self) -> bool:
        """Whether there is any to speak of."""
        return self.tilt_rad > _LEAST_TILT_RAD or self.drift_mgauss > _LEAST_DRIFT_MGAUSS

    def neighbours(self) -> Iterator[Wander]:
        """The same with one number at the next smaller or larger of the values tried."""
        for name, values in _TRIED.items():
            place = values.index(getattr(self, name))
            for value in values[max(place - 1, 0) : place + 2]:
                yield replace(self, **{name: value})


@dataclass(frozen=True, eq=False)
class Reduced:
    """A weighted linear problem with the states taken out of each stretch.

    Attributes
    ----------
    time
        Middle of each stretch, shape (m,).
    states
        Information of the states, shape (m, 6, 6).
    mixed
        Between the states and the parameters with the residuals as a last column, (m, 6, k + 1).
    whole
        Of the parameters and the residuals of all stretches, shape (k + 1, k + 1).
    """

    time: FloatArray
    states: FloatArray
    mixed: FloatArray
    whole: FloatArray


def stretches(time: FloatArray) -> IntArray:
    """Number of the stretch each reading falls into, shape (n,), without empty ones."""
    duration = float(time[-1] - time[0])
    length = max(LEAST_STRETCH_S, duration / MOST_STRETCHES)
    return np.unique(np.floor((time - time[0]) / length), return_inverse=True)[1]


def starts_of(time: FloatArray) -> IntArray:
    """First reading of each stretch."""
    return np.asarray(np.flatnonzero(np.r_[True, np.diff(stretches(time)) != 0]))


@dataclass(frozen=True, eq=False)
class Rows:
    """Readings at some parameters.

    Attributes
    ----------
    time
        Of each reading, shape (n,).
    values, slopes
        Residuals with independent errors, shape (n, 2), and their derivatives, (n, 2, SIZE).
    pulls
        What one standard deviation of the control quantity adds to them, shape (n, 2).
    """

    time: FloatArray
    values: FloatArray
    slopes: FloatArray
    pulls: FloatArray


def reduced(rows: Rows, weights: FloatArray) -> Reduced:
    """Sums over stretches of weighted residuals and their slopes.

    Parameters
    ----------
    rows
        The readings.
    weights
        One over the variance of each residual, shape (n, 2).
    """
    starts = starts_of(rows.time)
    slopes, values, pulls = rows.slopes.T, rows.values.T[np.newaxis], rows.pulls.T[np.newaxis]
    columns = np.concatenate([slopes, values, pulls])
    weighted = columns * weights.T
    states = [*range(TILT.start, TILT.stop), *range(OFFSET.start, OFFSET.stop), len(columns) - 1]
    sums = np.stack(
        [
            np.add.reduceat(np.sum(weighted * columns[state], axis=1), starts, axis=1)
            for state in states
        ]
    ).transpose(2, 0, 1)
    flat = columns[:-1].reshape(len(columns) - 1, -1)
    return Reduced(
        time=np.add.reduceat(rows.time, starts) / np.diff(np.r_[starts, len(rows.time)]),
        states=sums[:, :, states],
        mixed=sums[:, :, :-1],
        whole=flat @ weighted[:-1].reshape(len(flat), -1).T,
    )


def marginal(part: Reduced, wander: Wander) -> tuple[FloatArray, float]:
    """Information of parameters and residuals without the states, and a log-likelihood.

    Returns
    -------
    ndarray, shape (k + 1, k + 1)
        Last row and column belong to the residuals.
    float
        −½ log det of what the states' precision gained: what the likelihood loses to them.
    """
    own, between, prior_log_det = _prior_precision(part.time, wander)
    blocks = part.states.copy()
    np.einsum("mss->ms", blocks)[...] += own
    taken, log_det = _eliminated(blocks, between[:, :, np.newaxis] * np.eye(STATES), part.mixed)
    return part.whole - taken, -0.5 * (log_det - prior_log_det)


def _eliminated(
    blocks: FloatArray, between: FloatArray, right: FloatArray
) -> tuple[FloatArray, float]:
    """What a block-tridiagonal precision S takes from the columns b it meets: bᵀ S⁻¹ b, log det S.

    Parameters
    ----------
    blocks
        On the diagonal, shape (m, s, s).
    between
        Rows of each block's successor and columns of its own, shape (m − 1, s, s).
    right
        The columns, shape (m, s, k).

    Notes
    -----
    Every other block is eliminated at once, and again of those that are left: few steps over many
    blocks instead of many over one. SciPy's solver of bands is no faster, and takes longer to
    import than a fit takes.
    """
    # Where one block is left, it goes; else every second one, between the others.
    first = min(len(blocks) - 1, 1)
    gone, here = blocks[first::2], right[first::2]
    inverse = np.linalg.inv(gone)
    at_here = inverse @ here
    count = right.shape[2]
    taken = here.reshape(-1, count).T @ at_here.reshape(-1, count)
    log_det = 2.0 * float(np.sum(np.log(np.linalg.cholesky(gone).diagonal(axis1=1, axis2=2))))
    if not first:
        return taken, log_det
    blocks, right = blocks[::2].copy(), right[::2].copy()
    followed = slice(len(blocks) - 1)
    before, after = between[::2], between[1::2]
    at_before = inverse @ before
    blocks[: len(gone)] -= before.transpose(0, 2, 1) @ at_before
    right[: len(gone)] -= before.transpose(0, 2, 1) @ at_here
    blocks[1:] -= after @ inverse[followed] @ after.transpose(0, 2, 1)
    right[1:] -= after @ at_here[followed]
    of_others, log_det_of_others = _eliminated(blocks, -after @ at_before[followed], right)
    return taken + of_others, log_det + log_det_of_others


def _prior_precision(time: FloatArray, wander: Wander) -> tuple[FloatArray, FloatArray, float]:
    """The states' own prior precision (m, 6), that between stretches (m − 1, 6), and log det."""
    apart = np.diff(time)[:, np.newaxis]
    size = np.array([wander.tilt_rad] * 2 + [wander.drift_mgauss] * 3 + [wander.control_share])
    constant = np.array([wander.tilt_s] * 2 + [wander.drift_s] * 3 + [wander.control_s])
    kept = np.exp(-apart / constant)
    news = size**2 * np.maximum(1.0 - kept**2, 1e-9)
    own = np.zeros((len(time), STATES))
    own[0] = 1.0 / size**2
    own[1:] += 1.0 / news
    own[:-1] += kept**2 / news
    log_det = -2.0 * float(np.sum(np.log(size))) - float(np.sum(np.log(news)))
    return own, -kept / news, log_det


@dataclass(frozen=True, eq=False)
class Posterior:
    """What one prior and the data say together.

    Attributes
    ----------
    parameters, covariance
        Shapes (SIZE,) and (SIZE, SIZE).
    evidence
        Logarithm, comparable between priors of the same problem.
    wander
        The processes it was made with.
    """

    parameters: FloatArray
    covariance: FloatArray
    evidence: float
    wander: Wander


def likeliest(part: Reduced, prior: Prior, at: FloatArray) -> Wander:
    """The processes that make the residuals likeliest, climbed to by one number at a time."""
    scores: dict[Wander, float] = {}

    def score(tried: Wander) -> float:
        if tried not in scores:
            scores[tried] = evidences(part, tried, (prior,), at)[0]
        return scores[tried]

    best = Wander()
    for _ in range(_ROUNDS):
        before = score(best)
        for tried in best.neighbours():
            if score(tried) > score(best):
                best = tried
        if score(best) - before < _NEGLIGIBLE:
            break
    return best


def _normal(
    information: FloatArray, prior: Prior, at: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Matrix and gradient of a Gauss–Newton step of what moves, and the square at ``at``."""
    moving = prior.width > 0.0
    precision = prior.precision[moving]
    pull = precision * (at - prior.mean)[moving]
    matrix = information[:-1, :-1][np.ix_(moving, moving)] + np.diag(precision)
    gradient = information[:-1, -1][moving] + pull
    return matrix, gradient, float(information[-1, -1] + (at - prior.mean)[moving] @ pull)


def evidences(
    part: Reduced, wander: Wander, priors: Iterable[Prior], at: FloatArray
) -> tuple[float, ...]:
    """Logarithm of how likely each prior makes the data, as linear as they are around ``at``.

    Parameters
    ----------
    part
        The readings at ``at``.
    wander
        The processes.
    priors
        Means and widths.
    at
        Near the solution, shape (SIZE,).
    """
    information, loss = marginal(part, wander)
    return tuple(_evidence(information, loss, prior, at) for prior in priors)


def _evidence(information: FloatArray, loss: float, prior: Prior, at: FloatArray) -> float:
    """Logarithm of how likely the data are, the parameters integrated out around their best."""
    matrix, gradient, square = _normal(information, prior, at)
    gain = float(gradient @ np.linalg.solve(matrix, gradient))
    precision = prior.precision[prior.width > 0.0]
    spread = float(np.linalg.slogdet(matrix)[1] - np.sum(np.log(precision[precision > 0.0])))
    return loss - 0.5 * (square - gain + spread)


def _posterior(
    information: FloatArray, loss: float, prior: Prior, at: FloatArray, wander: Wander
) -> Posterior:
    """One Gauss–Newton step from ``at`` with a Gaussian prior."""
    matrix, gradient, _ = _normal(information, prior, at)
    moving = prior.width > 0.0
    covariance = np.linalg.pinv(matrix, hermitian=True)
    parameters = at.copy()
    parameters[moving] -= covariance @ gradient
    whole = np.zeros((len(at), len(at)))
    whole[np.ix_(moving, moving)] = covariance
    return Posterior(parameters, whole, _evidence(information, loss, prior, at), wander)


def posterior(
    part_at: Callable[[FloatArray], Reduced],
    start: FloatArray,
    prior: Prior,
    feasible: Callable[[FloatArray], bool],
    wander: Wander,
    part: Reduced | None = None,
) -> Posterior | None:
    """The parameters with both processes marginalised; None where the steps run away.

    Parameters
    ----------
    part_at
        The model: parameters, shape (SIZE,), to what :func:`reduced` makes of the readings.
    start
        Near the solution, shape (SIZE,).
    prior
        Means and widths.
    feasible
        Whether parameters are possible.
    wander
        The processes.
    part
        What ``part_at`` makes of ``start``, where known already.
    """
    at, found = start, None
    for _ in range(_STEPS):
        found = _posterior(*marginal(part or part_at(at), wander), prior, at, wander)
        part = None
        if not np.all(np.isfinite(found.parameters)) or not feasible(found.parameters):
            return None
        at = found.parameters
    return found


def weighed(rows: Rows) -> Reduced:
    """Sums over stretches, each reading with the weight that its neighbours give it."""
    return reduced(rows, _weights(rows.time, rows.values))


def _weights(time: FloatArray, values: FloatArray) -> FloatArray:
    """One over the variance of each residual: white noise from neighbours, outliers less."""
    return weights_and_rest(time, values)[0]


def weights_and_rest(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weights of residuals, and what of each its neighbours do not have too, shape (n, 2) both."""
    close = np.diff(time) < 2.0
    steps = np.diff(values, axis=0)[close] if close.any() else values
    white = spread_of(steps / np.sqrt(2.0))
    left = values - np.stack([_running_median(column) for column in values.T], axis=1)
    return np.asarray(1.0 / (1.0 + (left / white / _LOSS_SCALE) ** 2) / white**2), left


def _running_median(values: FloatArray, half: int = 7) -> FloatArray:
    padded = np.pad(values, half, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)


def mixed(found: Iterable[Posterior]) -> Posterior:
    """Several posteriors of the same data, each weighed by its evidence."""
    each = tuple(found)
    best = max(each, key=lambda one: one.evidence)
    weights = np.array([np.exp(one.evidence - best.evidence) for one in each])
    weights /= weights.sum()
    mean = np.sum([w * one.parameters for w, one in zip(weights, each, strict=True)], axis=0)
    covariance = np.zeros_like(best.covariance)
    for weight, one in zip(weights, each, strict=True):
        apart = one.parameters - mean
        covariance += weight * (one.covariance + np.outer(apart, apart))
    return Posterior(mean, covariance, best.evidence, best.wander)
