"""An ordinary flight, or hand-turning with motors running: strength and dip of the field.

The corrected field c = D · (raw + OFS) + MOT · u must have the earth's strength
at every attitude and every control quantity, and its part along gravity must be
the earth's vertical part. Neither residual contains the heading, so an error of
heading cannot leak in::

    r₁ = |c| − F                (PAPER.md 4)
    r₂ = c · down − F sin(dip)

Both lags are parameters like the others. How much is free follows from what the
data can tell: the motor vector alone, then offsets, then the diagonal, then the
off-diagonal of the soft iron, each group with the calibration in force as prior.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from magcomp.align import sample, within
from magcomp.earth import EarthField
from magcomp.fit.robust import ROUNDS, Estimate, Prior, solve, time_blocks
from magcomp.model import (
    CORRECTION_SIZE,
    MOTOR,
    OFFSET,
    SOFT_IRON,
    BoolArray,
    Control,
    Correction,
    FloatArray,
    Lags,
    Readings,
    Samples,
    pack,
    symmetric,
    unpack,
)

STRENGTH, SIN_DIP, FIELD_LAG, REGRESSOR_LAG = range(CORRECTION_SIZE, CORRECTION_SIZE + 4)
SIZE = CORRECTION_SIZE + 4

LAG_MEAN_S, LAG_WIDTH_S, LAG_MOST_S = 0.08, 0.1, 0.6
"""AUTOPILOTS.md, Timing: the field lags by 0.05–0.1 s, the current by something of that order."""

DIP_WIDTH = 0.02
"""The world model misses the sine of the local dip by about this much."""

SCALE_WIDTH = 0.15
"""Sensors without a calibrated scale are off by about this share."""

TRUSTED_OFFSET_MGAUSS = 4.0
TRUSTED_SOFT_IRON = 0.005
"""How well an ordinary calibration in force is taken to be known."""

OPEN_OFFSET_MGAUSS = 300.0
OPEN_SOFT_IRON = 0.15
BLOCK_S = 5.0

GROUPS = ("motor", "offset", "diagonal", "off-diagonal")
_DIAGONAL, _OFF_DIAGONAL = slice(6, 9), slice(9, 12)


@dataclass(frozen=True, eq=False)
class Problem:
    """One compass against one control quantity.

    Attributes
    ----------
    readings
        The compass; readings in gaps of the control quantity are left out.
    control
        The regressor.
    in_force
        Reported control quantities by kind, to undo corrections that were in force.
    earth
        Expected field.
    """

    readings: Readings
    control: Control
    in_force: Mapping[str, Control]
    earth: EarthField

    def __post_init__(self) -> None:
        object.__setattr__(self, "readings", within(self.readings, self.control.series))

    def where(self, keep: BoolArray) -> Problem:
        """The same with fewer readings."""
        return Problem(self.readings.where(keep), self.control, self.in_force, self.earth)

    def usual_lags(self) -> Lags:
        """The lags to be expected before any fit."""
        return Lags(LAG_MEAN_S, LAG_MEAN_S)

    def sample(self, lags: Lags) -> Samples:
        """Rows at given lags."""
        in_force = {**self.in_force, self.control.kind: self.control}
        return sample(self.readings, self.control, in_force, lags)


def prior(problem: Problem, free: int) -> Prior:
    """What is known before the data, with the first ``free`` groups of :data:`GROUPS` open."""
    present = problem.readings.in_force[-1].correction
    earth = problem.earth
    mean = np.zeros(SIZE)
    mean[:CORRECTION_SIZE] = pack(present)
    mean[MOTOR] = 0.0
    mean[[STRENGTH, SIN_DIP]] = earth.strength, np.sin(earth.dip)
    mean[[FIELD_LAG, REGRESSOR_LAG]] = LAG_MEAN_S
    width = np.zeros(SIZE)
    width[MOTOR] = np.inf
    width[OFFSET] = OPEN_OFFSET_MGAUSS if free >= 2 else TRUSTED_OFFSET_MGAUSS
    width[_DIAGONAL] = OPEN_SOFT_IRON if free >= 3 else 0.0
    width[_OFF_DIAGONAL] = OPEN_SOFT_IRON if free >= 4 else 0.0
    # A free shape and a free strength are one number too many: scale is then the model's.
    width[STRENGTH] = (1e-4 if free >= 3 else SCALE_WIDTH) * earth.strength
    width[SIN_DIP] = DIP_WIDTH
    width[[FIELD_LAG, REGRESSOR_LAG]] = LAG_WIDTH_S
    return Prior(mean, width)


def estimate(
    problem: Problem,
    free: int,
    *,
    start: FloatArray | None = None,
    hold_lags: bool = False,
    noise: FloatArray | None = None,
    with_covariance: bool = True,
    rounds: int = ROUNDS,
) -> Estimate:
    """Fit one compass with the first ``free`` groups of :data:`GROUPS` open.

    Parameters
    ----------
    problem
        The data.
    free
        1 … 4.
    start
        Parameters to begin at, shape (16,); the prior's mean by default.
    hold_lags
        Keep the lags of ``start``.
    noise
        Spread of both residuals, mGauss, shape (2,), where known.
    with_covariance
        False inside a search.
    rounds
        See :func:`magcomp.fit.robust.solve`.
    """
    known = prior(problem, free)
    if hold_lags:
        width = known.width.copy()
        width[[FIELD_LAG, REGRESSOR_LAG]] = 0.0
        known = Prior(known.mean, width)
    begin = known.mean if start is None else np.where(known.width > 0, start, known.mean)
    if hold_lags and start is not None:
        begin[[FIELD_LAG, REGRESSOR_LAG]] = start[[FIELD_LAG, REGRESSOR_LAG]]
    fixed = problem.sample(lags_of(begin)) if hold_lags else None

    def residuals(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        rows = problem.sample(lags_of(parameters)) if fixed is None else fixed
        return strength_and_dip(rows, parameters)

    blocks = time_blocks(problem.readings.time, BLOCK_S) if with_covariance else None
    return solve(
        residuals,
        begin,
        known,
        blocks=blocks,
        doubt=_doubt(known),
        noise=noise,
        rounds=rounds,
        feasible=is_physical,
    )


def estimate_lags(problem: Problem, correction: Correction) -> tuple[Lags, Lags]:
    """Both lags and their standard errors for a correction that is known already.

    Parameters
    ----------
    problem
        The data, transitions of the control quantity included.
    correction
        Found by a method that does not need the lags.
    """
    known = prior(problem, 1)
    width, begin = known.width.copy(), known.mean.copy()
    width[:CORRECTION_SIZE] = 0.0
    begin[:CORRECTION_SIZE] = pack(correction)
    found = solve(
        lambda p: strength_and_dip(problem.sample(lags_of(p)), p),
        begin,
        Prior(begin, width),
        blocks=time_blocks(problem.readings.time, BLOCK_S),
        feasible=is_physical,
    )
    field, regressor = np.sqrt(np.diag(found.covariance))[[FIELD_LAG, REGRESSOR_LAG]]
    return lags_of(found.parameters), Lags(float(field), float(regressor))


def _doubt(known: Prior) -> Prior:
    """The prior with the trusted soft iron as uncertain as an ordinary calibration leaves it."""
    width = known.width.copy()
    held = np.zeros(SIZE, dtype=bool)
    held[SOFT_IRON] = width[SOFT_IRON] == 0.0
    width[held] = TRUSTED_SOFT_IRON
    return Prior(known.mean, width)


def lags_of(parameters: FloatArray) -> Lags:
    """The two lags among the parameters."""
    return Lags(float(parameters[FIELD_LAG]), float(parameters[REGRESSOR_LAG]))


def is_physical(parameters: FloatArray) -> bool:
    """Whether the soft iron is positive definite and the lags possible.

    A mirrored soft iron fits strength and dip as well and turns the heading by 180°.
    """
    values = np.linalg.eigvalsh(symmetric(parameters[SOFT_IRON]))
    lags = np.abs(parameters[[FIELD_LAG, REGRESSOR_LAG]])
    return bool(values[0] > 0.3 and values[-1] < 3.0 and np.all(lags < LAG_MOST_S))


def strength_and_dip(samples: Samples, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residuals in mGauss, shape (n, 2), and their derivatives, shape (n, 2, 16)."""
    correction = unpack(parameters[:CORRECTION_SIZE])
    centred = samples.raw + correction.offset
    corrected = correction.apply(samples.raw, samples.u)
    size = np.linalg.norm(corrected, axis=1)
    along = corrected / size[:, None]
    residuals = np.stack(
        [
            size - parameters[STRENGTH],
            np.einsum("ij,ij->i", corrected, samples.down)
            - parameters[STRENGTH] * parameters[SIN_DIP],
        ],
        axis=1,
    )
    slopes = np.zeros((len(samples), 2, SIZE))
    shift = samples.raw_rate @ correction.soft_iron.T - np.multiply.outer(
        samples.u_rate, correction.motor
    )
    for kind, direction in enumerate((along, samples.down)):
        rows = slopes[:, kind, :]
        rows[:, MOTOR] = direction * samples.u[:, None]
        rows[:, OFFSET] = direction @ correction.soft_iron
        rows[:, _DIAGONAL] = direction * centred
        rows[:, 9] = direction[:, 0] * centred[:, 1] + direction[:, 1] * centred[:, 0]
        rows[:, 10] = direction[:, 0] * centred[:, 2] + direction[:, 2] * centred[:, 0]
        rows[:, 11] = direction[:, 1] * centred[:, 2] + direction[:, 2] * centred[:, 1]
        rows[:, REGRESSOR_LAG] = np.einsum("ij,ij->i", direction, shift)
    slopes[:, 0, STRENGTH] = -1.0
    slopes[:, 1, STRENGTH] = -parameters[SIN_DIP]
    slopes[:, 1, SIN_DIP] = -parameters[STRENGTH]
    slopes[:, 1, FIELD_LAG] = -np.einsum("ij,ij->i", corrected, samples.down_rate)
    return residuals, slopes


def vertical_of(parameters: FloatArray) -> float:
    """Downward part of the earth's field, mGauss."""
    return float(parameters[STRENGTH] * parameters[SIN_DIP])


def correction_of(found: Estimate) -> Correction:
    """The correction among the parameters."""
    return unpack(found.parameters[:CORRECTION_SIZE])
