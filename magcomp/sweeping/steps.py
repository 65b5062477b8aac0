"""The steps of a sweep, each chosen for what it tells. Pure functions.

Every axis of a compass reads baseline + drift + Σ g_m · i_m while the vehicle stands still, i_m
being motor m's current. Of the steps that may come next, the one is taken that takes most from the
uncertainty of the slopes g (docs/method.md, Steps of a sweep). The currents to expect come from the
steps done, so a step teaches what the next ones are worth.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from magcomp.errors import UsageError
from magcomp.model import FloatArray

GENTLE = 0.6
"""The first of a set of motors' steps, as a share of the most: nothing begins at its highest."""

LEAST_MOST, MOST_MOST = 0.1, 0.9
MOST_MOTORS = 12

_READINGS = 20
_NOISE_MGAUSS = 1.5
_SLOPE_WIDTH = 10.0
_LEVEL_WIDTH = 1000.0
_DRIFT_WIDTH = 1.0
ENOUGH_EACH, TOLD_APART = 0.1, 0.015
"""Standard errors, mGauss/A, of each motor's slope: where only their mean is wanted, and where each
motor gets a vector of its own."""

_ENOUGH_TOTAL = 0.01
"""Of all motors' mean slope: at 25 A it is known to 0.25 mGauss then, less than a tenth of a degree
of heading."""
_EXPONENT = 1.6
_MOST_ROUNDS = 5


@dataclass(frozen=True)
class Step:
    """Motors that spin together.

    Attributes
    ----------
    motors
        From 1.
    share
        Of the outputs' range, 0 … 1.
    """

    motors: tuple[int, ...]
    share: float


@dataclass(frozen=True)
class Measured:
    """A step that was carried out.

    Attributes
    ----------
    step
        Which.
    current
        What it drew more than the vehicle at rest, A.
    """

    step: Step
    current: float


def require_possible(motors: int, most: float) -> None:
    """Refuse a sweep that cannot be.

    Parameters
    ----------
    motors
        How many there are.
    most
        Share of the outputs' range of the strongest step.

    Raises
    ------
    UsageError
        Either is out of bounds.
    """
    if not 1 <= motors <= MOST_MOTORS:
        raise UsageError(
            f"The number of motors must be 1 to {MOST_MOTORS}; instead received {motors}"
        )
    if not LEAST_MOST <= most <= MOST_MOST:
        raise UsageError(
            f"The strongest step must be {100 * LEAST_MOST:.0f} to {100 * MOST_MOST:.0f} % of the "
            f"outputs' range; instead received {100 * most:g} %"
        )


def next_step(
    done: Sequence[Measured], motors: int, most: float, each: float = ENOUGH_EACH
) -> Step | None:
    """The step that tells most, or None where enough is known.

    Parameters
    ----------
    done
        What was carried out, in order.
    motors, most
        As :func:`require_possible`.
    each
        How well each motor's slope is to be known, mGauss/A.

    Examples
    --------
    >>> next_step([], 4, 0.4)
    Step(motors=(1,), share=0.24)
    """
    sets = _sets(motors)
    untried = [s for s in sets if not any(each.step.motors == s for each in done)]
    if untried:
        return Step(untried[0], round(GENTLE * most, 4))
    strong = [Step(s, most) for s in sets]
    counts = [sum(each.step == step for each in done) for step in strong]
    if min(counts) == 0:
        return strong[counts.index(0)]
    alone = counts[:motors]
    tired = len(done) >= _MOST_ROUNDS * (motors + 1)
    if min(alone) == max(alone) and (tired or _is_enough(done, motors, each)):
        return None
    if tired:
        return strong[alone.index(min(alone))]
    covariance = _covariance(done, motors)
    # A motor that lags behind comes first where two tell alike: the mean over all is to be even.
    return max(
        strong,
        key=lambda step: (_gain(step, done, motors, covariance), -counts[strong.index(step)]),
    )


def slope_errors(done: Sequence[Measured], motors: int) -> FloatArray:
    """Standard errors expected of each motor's slope, mGauss/A, shape (motors,)."""
    return np.asarray(np.sqrt(np.diag(_covariance(done, motors))[2:]))


def _sets(motors: int) -> list[tuple[int, ...]]:
    each: list[tuple[int, ...]] = [(motor,) for motor in range(1, motors + 1)]
    return each if motors == 1 else [*each, tuple(range(1, motors + 1))]


def _row(step: Step, current: float, place: float, motors: int) -> FloatArray:
    row = np.zeros(2 + motors)
    row[:2] = 1.0, place
    row[[1 + motor for motor in step.motors]] = current / len(step.motors)
    return row


def _rows(done: Sequence[Measured], motors: int) -> Iterator[FloatArray]:
    """Each step, and the rest before it."""
    for place, each in enumerate(done):
        yield _row(each.step, 0.0, place - 0.5, motors)
        yield _row(each.step, max(each.current, 0.0), float(place), motors)


def _covariance(done: Sequence[Measured], motors: int) -> FloatArray:
    width = np.full(2 + motors, _SLOPE_WIDTH)
    width[:2] = _LEVEL_WIDTH, _DRIFT_WIDTH
    rows = np.array([*_rows(done, motors)]).reshape(-1, 2 + motors)
    information = np.diag(width**-2) + rows.T @ rows * (_READINGS / _NOISE_MGAUSS**2)
    return np.asarray(np.linalg.inv(information))


def _gain(step: Step, done: Sequence[Measured], motors: int, covariance: FloatArray) -> float:
    """Logarithm by which the slopes' uncertain volume would shrink; rounded, for ties."""
    row = _row(step, _expected(step, done), float(len(done)), motors)
    weight = _READINGS / _NOISE_MGAUSS**2
    return round(float(np.log1p(weight * (row @ covariance @ row))), 2)


def _expected(step: Step, done: Sequence[Measured]) -> float:
    """Current of a step to come, A, by those of the same motors."""
    same = [each for each in done if each.step.motors == step.motors]
    scaled = [each.current * (step.share / each.step.share) ** _EXPONENT for each in same]
    return max(scaled[-1], 0.0) if scaled else 0.0


def _is_enough(done: Sequence[Measured], motors: int, each: float) -> bool:
    """Whether the slopes are known well: more than a compass can be read says nothing in flight."""
    slopes = _covariance(done, motors)[2:, 2:]
    total = float(np.sqrt(slopes.mean()))
    return total <= _ENOUGH_TOTAL and float(np.sqrt(slopes.diagonal().max())) <= each
