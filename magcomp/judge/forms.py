"""Which form the motors' field has: straight in one quantity, curved, or each motor its own.

Each form is a few more columns beside the fitted ones of one current, solved on four fifths of
the flight and looked at on the last. The simplest form that no other is clearly better than is
the one to believe (docs/method.md, Motor by motor).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from magcomp.fit import Problem, folds, spread
from magcomp.fit.field_model import (
    correction_at,
    parameters_of,
    strength_and_dip,
)
from magcomp.fit.flight import prior
from magcomp.fit.nearest import moved, nearest
from magcomp.fit.robust import spread_of
from magcomp.geometry import heading_shift
from magcomp.judge.evidence import used_lags
from magcomp.model import (
    BoolArray,
    Control,
    Correction,
    FloatArray,
    Form,
    IntArray,
    MotorFit,
    Samples,
    Series,
    interpolate,
)

CLEARLY = 0.97
"""A form with more numbers must leave less than this share of what a simpler one leaves unseen."""

MOST = 0.99
"""Heading errors in flight are those that this share of the readings does not exceed."""

CURVED = "curved current"
_MOST_FREE, _LEAST_FOLDS = 4, 3


@dataclass(frozen=True, eq=False)
class _Tried:
    name: str
    count: int
    held_out: float
    added: FloatArray
    u: FloatArray
    correction: Correction


def forms(
    problem: Problem,
    fit: MotorFit,
    motors: Control | None,
    throttle: Control | None,
) -> tuple[Form, ...]:
    """Compare what the field may follow, the simplest first.

    Parameters
    ----------
    problem, fit
        A flight and its fit by one current.
    motors
        The current of each motor, where known.
    throttle
        The throttle, where known.
    """
    whole = problem.sample(used_lags(fit))
    against = {fit.regressor: problem, CURVED: _curved(problem, whole)}
    for control in (throttle, motors):
        if control is not None:
            against[control.kind] = replace(problem, control=control)
    against = _of_the_same_readings(against)
    samples = against[fit.regressor].sample(used_lags(fit))
    if len(np.unique(folds(samples.time))) < _LEAST_FOLDS:
        return ()
    tried = [
        _tried(name, of, fit, problem.control if of.control is throttle else None)
        for name, of in against.items()
    ]
    tried.sort(key=lambda each: each.count)
    best = tried[0]
    for each in tried[1:]:
        if each.held_out < CLEARLY * best.held_out:
            best = each
    richest = min(tried, key=lambda each: each.held_out)
    field = fit.correction.apply(samples.raw, samples.u)
    return tuple(
        Form(
            each.name,
            each.count,
            each.held_out,
            np.nan
            if best is tried[0] or each.name == richest.name
            else left_deg(nearest(richest.added, each.u)[1], field, samples),
            is_best=each is best,
            curve=_curve(fit.correction, each.correction, _top(whole))
            if each.name == CURVED
            else (),
        )
        for each in tried
    )


def _of_the_same_readings(against: Mapping[str, Problem]) -> dict[str, Problem]:
    """Each with the readings that none of the others has in a gap of its quantity."""
    common = reduce(np.intersect1d, (each.readings.time for each in against.values()))
    return {name: each.where(np.isin(each.readings.time, common)) for name, each in against.items()}


def left_deg(left: FloatArray, field: FloatArray, samples: Samples) -> float:
    """Heading error that a field left over makes in a flight, degrees; see :data:`MOST`."""
    roll, pitch = samples.attitude[:, 0], samples.attitude[:, 1]
    return float(np.degrees(np.quantile(np.abs(heading_shift(left, field, roll, pitch)), MOST)))


def _curved(problem: Problem, samples: Samples) -> Problem:
    """The same against the current and its square: bent up, or down where it saturates."""
    series = problem.control.total
    parts = np.column_stack([series.value, series.value**2 / _top(samples)])
    return replace(problem, control=replace(problem.control, series=Series(series.time, parts)))


def _top(samples: Samples) -> float:
    return max(float(np.quantile(samples.total, 0.98)), 1e-9)


def _tried(name: str, problem: Problem, fit: MotorFit, base: Control | None = None) -> _Tried:
    """A form solved beside a fit of one quantity, on each part of the flight in turn.

    Where it has none of that quantity, ``base``, it begins at what is nearest to the fit.
    """
    lags = used_lags(fit)
    samples = problem.sample(lags)
    begun = _begun(fit.correction, name, samples)
    if base is not None:
        then = samples.time - lags.regressor
        added = fit.correction.added(interpolate(base.series, then))
        begun = moved(fit.correction, nearest(added, samples.u)[0])
    start = parameters_of(replace(fit, correction=begun), lags)
    values, slopes = strength_and_dip(samples, start)
    scale = spread_of(values)
    root = 1.0 / scale / np.sqrt(np.sqrt(1.0 + (values / scale / 2.0) ** 2))
    known = prior(problem, _MOST_FREE)
    moving = known.width > 0.0
    precision = np.diag(known.precision[moving])

    rooted = slopes.T[moving] * root.T
    left = values.T * root.T
    fold = folds(samples.time)
    each = [_normal(rooted[:, :, here], left[:, here]) for here in _parts(fold)]
    whole = (
        np.sum([matrix for matrix, _ in each], axis=0),
        np.sum([side for _, side in each], axis=0),
    )

    def solved(matrix: FloatArray, side: FloatArray) -> FloatArray:
        step = np.zeros(len(start))
        # A form that the readings do not determine is solved as far as they do.
        step[moving] = -np.linalg.pinv(matrix + precision, hermitian=True) @ side
        return step

    unseen = np.concatenate(
        [
            values[here] + slopes[here] @ solved(whole[0] - matrix, whole[1] - side)
            for here, (matrix, side) in zip(_parts(fold), each, strict=True)
        ]
    )
    found = correction_at(start + solved(*whole))
    return _Tried(name, found.motor.size, spread(unseen), found.added(samples.u), samples.u, found)


def _curve(fit: Correction, curved: Correction, top: float) -> tuple[tuple[float, ...], ...]:
    """How the centre of the readings moves with the quantity, in the field that the fit corrects.

    Three vectors: from the fit's centre at rest, per unit, and per unit squared.
    """
    back = fit.soft_iron @ np.linalg.inv(curved.soft_iron)
    slope, bend = -(back @ curved.motor).T
    rest = fit.soft_iron @ (fit.offset - curved.offset)
    return tuple(tuple(vector.tolist()) for vector in (rest, slope, bend / top))


def _parts(fold: IntArray) -> list[BoolArray]:
    return [fold == index for index in np.unique(fold)]


def _normal(rooted: FloatArray, left: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Information matrix and right side of a part, from columns (m, 2, n) and residuals (2, n)."""
    flat = rooted.reshape(len(rooted), -1)
    return flat @ flat.T, flat @ left.reshape(-1)


def _begun(correction: Correction, name: str, samples: Samples) -> Correction:
    """A correction of as many parts as the samples have, which corrects as the given one does."""
    parts = samples.u.shape[1]
    vectors = np.tile(correction.vector[:, None], parts)
    if name == CURVED:
        vectors[:, 1:] = 0.0
    return replace(correction, motor=vectors)
