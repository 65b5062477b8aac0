"""Whether the model that was fitted holds: straight in the control quantity, the same throughout.

A held-out proof cannot see what is alike in every part of a log, and a bound made of residuals
knows nothing of what the model leaves out. Here each thing the model leaves out is put into it in
turn, as a few more columns beside all the fitted ones, and what they take up is weighed against
its own standard error (docs/method.md, The judge).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from magcomp.fit import Problem
from magcomp.fit.field_model import (
    SIN_DIP,
    STRENGTH,
    motor_columns,
    parameters_of,
    strength_and_dip,
)
from magcomp.fit.flight import drift_blocks, prior
from magcomp.fit.robust import spread_of, time_blocks
from magcomp.geometry import horizontal_part
from magcomp.model import (
    OFFSET,
    FloatArray,
    IntArray,
    Lags,
    MotorFit,
)

_SPLITS = (0.2, 0.35, 0.5, 0.65, 0.8)
_LEAST_SIGMA, _LEAST_SIGMA_OF_A_CURVE = 3.5, 3.0
"""What is looked for at several moments, the largest counting, is larger by chance; a bend is
looked for once."""

_BLOCK_S = 15.0
_USUAL_DRIFT_MGAUSS = 3.0
_WIDEST = 0.1
_GRID = 21


@dataclass(frozen=True)
class Departure:
    """One way in which the readings depart from the model.

    Attributes
    ----------
    kind
        ``"curve"``, ``"step"``, ``"motors"``, ``"place"`` or ``"wander"``.
    degrees
        Heading error it stands for, at the largest control quantity seen.
    degrees_std
        Its standard error.
    mgauss
        Size of the field it stands for.
    at_s
        When it happened, seconds since the recording began; NaN where it is not a moment.
    gain
        By how much it lowers the weighted sum of squares: which of two departures that look
        alike it rather is.
    """

    kind: str
    degrees: float
    degrees_std: float
    mgauss: float
    at_s: float
    gain: float

    @property
    def sigmas(self) -> float:
        """Its size in standard errors."""
        return self.degrees / max(self.degrees_std, 1e-9)

    @property
    def is_plain(self) -> bool:
        """Whether it is more than its own error explains."""
        return self.sigmas > (_LEAST_SIGMA_OF_A_CURVE if self.kind == "curve" else _LEAST_SIGMA)


@dataclass(frozen=True, eq=False)
class _Linear:
    """Residuals and slopes at the fit, weighted; what more columns are put beside.

    Attributes
    ----------
    residuals, slopes
        Shapes (2, n) and (k, 2, n).
    precision
        Of the prior, shape (k,).
    blocks
        Where each block begins, shape (b,).
    """

    residuals: FloatArray
    slopes: FloatArray
    precision: FloatArray
    blocks: IntArray

    def taken_up(self, extra: FloatArray, width: float) -> tuple[FloatArray, FloatArray, float]:
        """What ``extra`` columns (m, 2, n) take up, shape (m,), its covariance, and the gain.

        ``width`` is what the columns may reasonably take, so that a direction the readings do not
        show stays at zero instead of running away. Neighbouring readings err alike: they count
        for as many fewer as their summed scores scatter more than single ones do.
        """
        columns = np.concatenate([self.slopes, extra])
        size, more = len(columns), len(extra)
        flat = columns.reshape(size, -1)
        information = flat @ flat.T / self._alike
        precision = np.concatenate([self.precision, np.full(more, 1.0 / width**2)])
        bread = np.linalg.pinv(information + np.diag(precision), hermitian=True)
        found = -bread @ (flat @ self.residuals.reshape(-1)) / self._alike
        left = self.residuals + np.tensordot(found, columns, axes=1)
        summed = self._summed(columns, left) / self._alike
        count = len(self.blocks)
        meat = summed @ summed.T * (count / max(count - size, 1) if count > size else 1.0)
        covariance = bread @ np.diag(precision) @ bread + _larger(
            bread @ meat @ bread, bread @ information @ bread
        )
        gain = float(np.sum(self.residuals**2) - np.sum(left**2)) / self._alike
        return found[-more:], covariance[-more:, -more:], gain

    @cached_property
    def _alike(self) -> float:
        """How many neighbouring readings say the same thing, on the whole."""
        flat = self.slopes.reshape(len(self.slopes), -1)
        bread = np.linalg.pinv(flat @ flat.T + np.diag(self.precision), hermitian=True)
        found = bread @ (flat @ self.residuals.reshape(-1))
        left = self.residuals - np.tensordot(found, self.slopes, axes=1)
        summed = self._summed(self.slopes, left)
        single = np.sum(self.slopes * left, axis=1)
        ratio = np.trace(bread @ summed @ summed.T) / max(np.trace(bread @ single @ single.T), 1e-9)
        return float(max(ratio, 1.0))

    def _summed(self, columns: FloatArray, residuals: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(np.sum(columns * residuals, axis=1), self.blocks, axis=1))


def _larger(first: FloatArray, second: FloatArray) -> FloatArray:
    """The covariance that is nowhere smaller on its diagonal than either."""
    scale = np.sqrt(np.maximum(np.diag(second) / np.maximum(np.diag(first), 1e-18), 1.0))
    return np.asarray(first * np.outer(scale, scale))


def departures_of(problem: Problem, fit: MotorFit, lags: Lags) -> tuple[Departure, ...]:
    """Every way of departing from the model that can be weighed, plain or not.

    Parameters
    ----------
    problem, fit
        What was fitted, by the method of flights or of levels, and what came out.
    lags
        To look at the readings with.
    """
    samples = problem.sample(lags)
    values, slopes = strength_and_dip(samples, parameters_of(fit, lags))
    linear = _weighted(problem, values, slopes)
    horizontal = horizontal_part(fit.strength, fit.vertical)
    top = float(np.quantile(samples.total, 0.98))
    if top <= 0.0:
        return ()
    weight = linear.slopes[OFFSET], motor_columns(linear.slopes).sum(axis=0) / top
    share = np.clip(samples.total / top, 0.0, 2.0)
    wide = _WIDEST * fit.strength
    curved, covariance, gain = linear.taken_up(weight[1] * share, wide)
    bow = _bow(share)
    found = [_departure("curve", bow * curved, bow**2 * covariance, gain, horizontal, np.nan)]
    steps = [samples.time > t for t in np.quantile(samples.time, _SPLITS)]
    moments = np.quantile(samples.time, _SPLITS)
    earth = linear.slopes[[STRENGTH, SIN_DIP]]
    earth[1] /= fit.strength
    for kind, columns in (("step", weight[0]), ("motors", weight[1]), ("place", earth)):
        tried = [
            _departure(kind, *linear.taken_up(columns * late, wide), horizontal, t)
            for late, t in zip(steps, moments.tolist(), strict=True)
        ]
        found.append(max(tried, key=lambda d: d.gain))
    found.append(_wander(linear, samples.time, weight[0], horizontal))
    return tuple(found)


def _bow(share: FloatArray) -> float:
    """How far s² departs between 0 and 1 from the line that fits it best at s, shape (n,).

    Examples
    --------
    A vehicle that hovers shows the bow where it hovers, and is off by more at rest:

    >>> even, hovers = np.linspace(0.0, 1.0, 101), np.linspace(0.5, 1.0, 101)
    >>> round(_bow(even), 2), round(_bow(hovers), 2)
    (0.16, 0.54)
    """
    line = np.polynomial.Polynomial.fit(share, share**2, 1)
    grid = np.linspace(0.0, 1.0, _GRID)
    return float(np.abs(grid**2 - line(grid)).max())


def _weighted(problem: Problem, values: FloatArray, slopes: FloatArray) -> _Linear:
    spread = spread_of(values)
    weight = 1.0 / np.sqrt(1.0 + (values / spread / 2.0) ** 2)
    root = np.sqrt(weight) / spread
    known = prior(problem, 4).precision
    return _Linear(
        residuals=(values * root).T,
        slopes=slopes.T * root.T,
        precision=known,
        blocks=np.flatnonzero(np.diff(drift_blocks(problem.readings.time), prepend=-1)),
    )


def _departure(
    kind: str,
    vector: FloatArray,
    covariance: FloatArray,
    gain: float,
    horizontal: float,
    at_s: float,
) -> Departure:
    """A body-fixed vector as heading error, with the error along its own direction."""
    size = float(np.linalg.norm(vector))
    unit = vector / size if size > 0.0 else np.ones(len(vector)) / np.sqrt(len(vector))
    std = float(np.sqrt(max(unit @ covariance @ unit, 0.0)))
    return Departure(
        kind,
        float(np.degrees(size / horizontal)),
        float(np.degrees(std / horizontal)),
        size,
        at_s,
        gain,
    )


def _wander(linear: _Linear, time: FloatArray, columns: FloatArray, horizontal: float) -> Departure:
    """How much an offset of its own for each stretch of time takes up, beyond usual drift."""
    block = time_blocks(time, _BLOCK_S)
    sizes, errors = [], []
    for number in np.unique(block):
        rows = block == number
        flat = columns[:, :, rows].reshape(3, -1)
        normal = flat @ flat.T + np.eye(3) / (3 * _USUAL_DRIFT_MGAUSS) ** 2
        inverse = np.linalg.inv(normal)
        vector = -inverse @ (flat @ linear.residuals[:, rows].reshape(-1))
        sizes.append(float(vector @ vector))
        errors.append(float(np.trace(inverse)) + 3 * _USUAL_DRIFT_MGAUSS**2)
    excess = max(float(np.mean(sizes)) - float(np.mean(errors)), 0.0)
    size = float(np.sqrt(excess))
    std = float(np.mean(errors)) * np.sqrt(2.0 / (3 * len(sizes))) / (2 * size) if size else 0.0
    return Departure(
        "wander",
        float(np.degrees(size / horizontal)),
        float(np.degrees(std / horizontal)),
        size,
        float("nan"),
        0.0,
    )
