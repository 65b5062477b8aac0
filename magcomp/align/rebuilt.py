"""A quantity that is told seldom, smoothed or both, rebuilt from what drives the motors.

It is regressed on what is told more often. That leaves an error which is independent of the rebuilt
quantity, so it does not bias a slope the way an error of interpolation does (docs/method.md, Motor
by motor).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from magcomp.align.low_pass import low_pass
from magcomp.model import Control, FloatArray, Series, interpolate, least_at, median, running_mean

_SHIFTS = np.arange(-0.2, 0.301, 0.02)
_COARSE = 3
"""Every so manieth shift is tried, and then those around the best: a vehicle's current has no two
that fit so near each other."""
_TRENDS_S = (5.0, 2.0, 1.0)
"""Half-widths of the window, longest first, over which what outputs do not explain is followed."""

_CLEARLY_SHORTER = 0.9
_TIMES_SMOOTHED = 5.0
LEAST_ROWS = 30
POWERS = (1, 2, 3)
_EXPONENTS, _FINE_EXPONENT = (0.4, 3.6, 0.4), 0.01
_LEAST_EXPLAINED = 0.8
_SMOOTHINGS = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.5)
"""Time constants in seconds by which a battery monitor may smooth.

PX4's telemetry does by 0.5 up to 1.15: docs/autopilots.md, PX4: link.
"""
_STEPS_SEEN = 0.4
"""Of the step at which outputs are told: a shorter smoothing is lost between them."""
_CLEARLY_SMOOTHED = 0.97
_FEWEST = 2
_STEPS_OF_SMOOTHING = 4
_MOST_REGRESSED, _MOST_FOR_EXPONENT = 20_000, 2_000
_MOST_ROWS, _MOST_ROWS_A_VALUE = 1_000_000, 50
"""More rows in even steps than this mean that the times are not to be trusted."""


class Rebuilt(NamedTuple):
    """A form of a quantity, and how it came about.

    Attributes
    ----------
    control
        The form.
    cost
        Mean square it leaves of what was reported.
    coefficients
        Of 1 and of the means of the duties' powers.
    trend
        What drifts slowly and was added, shape (n,).
    """

    control: Control
    cost: float
    coefficients: FloatArray
    trend: FloatArray


def rebuild(
    reference: Series,
    duty: Series,
    kind: str,
    name: str,
    *,
    measured: bool = False,
    powers: Sequence[float] = POWERS,
) -> Rebuilt | None:
    """The reference regressed on powers of the duty, shape (n, k), sampled more often.

    What is ``measured`` has noise of its own, and a smoothing of that looks like the monitor's.

    A battery monitor smooths what it measures. Where the duty is told often enough to show that,
    the quantity is rebuilt as it was before: more than a shift in time lies between the two, and a
    slope against the smoothed one comes out too large.
    """
    if len(reference) < LEAST_ROWS:
        return None
    features = _features(duty, powers)
    plain = _regressed(reference, features, 0.0)
    if plain is None:
        return None
    step = float(np.median(np.diff(duty.time)))
    smoothed = [
        found
        for each in _SMOOTHINGS
        if not measured
        and each > _STEPS_SEEN * step > 0.0
        and (found := _regressed(reference, features, each)) is not None
    ]
    best = min(smoothed, key=lambda found: found.cost, default=plain)
    if not best.cost < _CLEARLY_SMOOTHED * plain.cost:
        best = plain
    return _followed(reference, features, best, kind, name)


def _features(duty: Series, powers: Sequence[float]) -> Series:
    means = [np.mean(duty.value**power, axis=1) for power in powers]
    return Series(duty.time, np.array(means).T)


def exponent_of(reference: Series, drive: Series, shift: float) -> tuple[float, float]:
    """The power of what drives each motor that a quantity follows best, and what it leaves.

    Parameters
    ----------
    reference
        The sum over the motors, but for a constant share and what drives nothing.
    drive
        Of each motor, from 0, shape (n, k).
    shift
        By how many seconds the reference comes later.

    Returns
    -------
    tuple of float
        The power, and the mean square as in :class:`Rebuilt`.
    """
    few = slice(None, None, -(-len(reference) // _MOST_FOR_EXPONENT))
    told = Series(reference.time[few], reference.value[few])
    then = Series(told.time, interpolate(drive, told.time - shift))

    def cost(power: float) -> float:
        return _regress(told, _features(then, (power,)), 0.0)[1]

    return least_at(cost, np.arange(*_EXPONENTS), _FINE_EXPONENT)


class _Regressed(NamedTuple):
    """What of a smoothed quantity is explained, and how.

    Attributes
    ----------
    smoothing
        Its time constant, seconds.
    coefficients, cost
        See :class:`Rebuilt`.
    as_reported
        What is explained of it, at the times it was told.
    """

    smoothing: float
    coefficients: FloatArray
    cost: float
    as_reported: Series


def _regressed(reference: Series, features: Series, smoothing: float) -> _Regressed | None:
    """The reference as the smoothed features explain it; None where they do not."""
    seen = smoothed(features, smoothing)
    # Enough to find four coefficients by: of hours of current every few readings.
    few = slice(None, None, -(-len(reference) // _MOST_REGRESSED))
    told = Series(reference.time[few], reference.value[few])
    coarse = {k: _regress(told, seen, _SHIFTS[k]) for k in range(0, len(_SHIFTS), _COARSE)}
    near = min(coarse, key=lambda k: coarse[k][1])
    around = range(max(near - _COARSE + 1, 0), min(near + _COARSE, len(_SHIFTS)))
    fits = coarse | {k: _regress(told, seen, _SHIFTS[k]) for k in around if k != near}
    best = min(fits, key=lambda k: fits[k][1])
    coefficients, cost = fits[best]
    if not cost < (1 - _LEAST_EXPLAINED) * float(np.var(reference.value)):
        return None
    as_reported = coefficients[0] + seen.value @ coefficients[1:]
    explained = Series(features.time + _SHIFTS[best], as_reported)
    return _Regressed(smoothing, coefficients, cost, explained)


def _followed(
    reference: Series, features: Series, found: _Regressed, kind: str, name: str
) -> Rebuilt:
    """The quantity as it was before it was smoothed, and what its features do not explain."""
    time = found.as_reported.time
    left = reference.value - interpolate(found.as_reported, reference.time)
    modelled = found.coefficients[0] + features.value @ found.coefficients[1:]
    slow = interpolate(_trend(Series(reference.time, left), found.smoothing), time)
    value = np.maximum(modelled + slow, 0.0)
    control = Control(kind, Series(time, value), name)
    return Rebuilt(control, found.cost, found.coefficients, slow)


def _trend(left: Series, smoothing: float) -> Series:
    """What outputs do not explain of a current: its mean over a window of time.

    A motor draws less in the wash of a descent, and more as the wind takes it: a matter of seconds.
    A shorter window follows that and takes in more noise; it is taken where it tells each value
    clearly better from those beside it. What a monitor smooths in another way than it is taken to
    lasts some of its time constants, and is no load.
    """
    least = min(_TIMES_SMOOTHED * smoothing, _TRENDS_S[0])
    windows = [(half, running_mean(left, half)) for half in _TRENDS_S if half >= least]
    tried = [(_untold(left, means, half), means) for half, means in windows]
    usual, best = tried[0], min(tried, key=lambda each: each[0])
    return (best if best[0] < _CLEARLY_SHORTER * usual[0] else usual)[1]


def _untold(series: Series, means: Series, half_width: float) -> float:
    """Mean square of what the others in the window of each value do not tell of it."""
    first = np.searchsorted(series.time, series.time - half_width, side="left")
    last = np.searchsorted(series.time, series.time + half_width, side="right")
    others = last - first - 1
    if np.any(others < 1):
        return np.inf
    return float(np.mean(((series.value - means.value) * (others + 1) / others) ** 2))


def smoothed(series: Series, constant: float) -> Series:
    """What a first-order low pass of a time constant in seconds makes of columns, (n, k)."""
    if constant <= 0.0 or len(series) < _FEWEST:
        return series
    told, length = float(np.median(np.diff(series.time))), float(np.ptp(series.time))
    most = min(_MOST_ROWS, _MOST_ROWS_A_VALUE * len(series))
    step = max(min(told, constant / _STEPS_OF_SMOOTHING), length / most)
    if step > told:
        return series
    time = np.arange(series.time[0], series.time[-1] + step, step)
    share = 1.0 - float(np.exp(-step / constant))
    value = np.empty(series.value.shape)
    # One column after the other: of half a day, all of them at once are 100 MB.
    for to, column in zip(value.T, series.value.T, strict=True):
        even = np.interp(time, series.time, column)[:, None]
        to[:] = np.interp(series.time, time, low_pass(even, share, even[0]).ravel())
    return Series(series.time, value)


def _regress(reference: Series, features: Series, shift: float) -> tuple[FloatArray, float]:
    """Robust coefficients at one shift in time, and the robust mean square they leave."""
    columns = np.ones((1 + features.value.shape[1], len(reference)))
    columns[1:] = interpolate(features, reference.time - shift).T
    weight = np.ones(len(reference))
    ridge = 1e-9 * np.eye(len(columns)) * len(reference)
    for _ in range(4):
        weighted = columns * weight
        coefficients = np.linalg.solve(weighted @ columns.T + ridge, weighted @ reference.value)
        left = reference.value - coefficients @ columns
        spread = 1.4826 * float(median(np.abs(left))) + 1e-3 * float(np.ptp(reference.value))
        weight = 1 / (1 + (left / (3 * spread)) ** 2)
    return np.asarray(coefficients), float(np.average(left**2, weights=weight))
