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
from magcomp.align.low_pass import low_pass
from magcomp.earth import EarthField
from magcomp.fit.control_noise import Noise, noise_of, whitened
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
    IntArray,
    Lags,
    Readings,
    Samples,
    pack,
    symmetric,
    unpack,
)

STRENGTH, SIN_DIP, FIELD_LAG, REGRESSOR_LAG = range(CORRECTION_SIZE, CORRECTION_SIZE + 4)
TILT, LEAN = (
    slice(CORRECTION_SIZE + 4, CORRECTION_SIZE + 6),
    slice(CORRECTION_SIZE + 6, CORRECTION_SIZE + 8),
)
SIZE = CORRECTION_SIZE + 8

TILT_WIDTH_RAD = np.radians(0.5)
"""Autopilots level their attitude to about this: constant errors of roll and of pitch."""

LEAN_WIDTH, LEAN_S = 0.1, 4.0
"""Radians of attitude error a radian of lean held for seconds, and how soon it comes."""

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

UNPROVEN_OFFSET_MGAUSS, UNPROVEN_SOFT_IRON = 12.0, 0.015
"""How far an ordinary calibration is off where the data cannot contradict it."""

NEVER_CALIBRATED_MGAUSS = 20.0
"""Offsets shorter than this beside an untouched soft iron are what a vehicle is delivered with."""

BLOCK_S = 5.0

DRIFT_S = 30.0
"""Drift of real sensors and attitude filters is alike for about this long."""

_LEAST_BLOCKS = 12

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


def is_calibrated(present: Correction) -> bool:
    """Whether anybody ever calibrated this compass.

    Offsets of zero beside a soft iron of one are no calibration at zero; they are none.
    """
    untouched = np.array_equal(present.soft_iron, np.eye(3))
    return not (untouched and float(np.linalg.norm(present.offset)) < NEVER_CALIBRATED_MGAUSS)


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
    width[TILT], width[LEAN] = TILT_WIDTH_RAD, LEAN_WIDTH
    return Prior(mean, width)


@dataclass(frozen=True, eq=False)
class FlightEstimate(Estimate):
    """An estimate and the sizes of the errors it was made with.

    Attributes
    ----------
    errors
        None where those of the control quantity do not show.
    """

    errors: Noise | None = None


def estimate(
    problem: Problem,
    free: int,
    *,
    start: FloatArray | None = None,
    hold_lags: bool = False,
    errors: Noise | None = None,
    with_covariance: bool = True,
    rounds: int = ROUNDS,
) -> FlightEstimate:
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
    errors
        Sizes of the errors where known; found in the residuals otherwise, unless the estimate is
        one without covariance, which then takes the control quantity as exact.
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
    search = with_covariance and errors is None

    def rows_at(parameters: FloatArray) -> Samples:
        return problem.sample(lags_of(parameters)) if fixed is None else fixed

    def solved(begin: FloatArray, noise: Noise | None, *, last: bool) -> Estimate:
        return solve(
            lambda p: strength_and_dip(rows_at(p), p, noise),
            begin,
            known,
            blocks=drift_blocks(problem.readings.time) if with_covariance and last else None,
            doubt=_doubt(known),
            rounds=rounds,
            feasible=is_physical,
        )

    found = solved(begin, errors, last=not search)
    if search:
        errors = errors_of(rows_at(found.parameters), found.parameters)
        found = solved(found.parameters, errors, last=True)
    return FlightEstimate(**vars(found), errors=errors)


def errors_of(samples: Samples, parameters: FloatArray) -> Noise | None:
    """The sizes of the errors at parameters near the solution, shape (SIZE,)."""
    values, _, pulls = _rows(samples, parameters)
    return noise_of(values, pulls, float(np.std(samples.u)))


def drift_blocks(time: FloatArray) -> IntArray:
    """Blocks as long as the drift of sensors and attitude, a dozen of them at least."""
    duration = float(time[-1] - time[0]) if len(time) else 0.0
    return time_blocks(time, float(np.clip(duration / _LEAST_BLOCKS, BLOCK_S, DRIFT_S)))


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


def strength_and_dip(
    samples: Samples, parameters: FloatArray, noise: Noise | None = None
) -> tuple[FloatArray, FloatArray]:
    """Residuals in mGauss of sensor field, shape (n, 2), and derivatives, shape (n, 2, SIZE).

    Parameters
    ----------
    samples, parameters
        Readings, and the parameters in the order of the module's slices, shape (SIZE,).
    noise
        Sizes of the errors where those of the control quantity are known too: both residuals are
        then made independent of each other.

    Notes
    -----
    The sensor's noise is alike on its axes, so the distance that counts is that in sensor axes
    between a reading and the nearest field the model allows: D⁻¹ · (b − M·u) − offset with b the
    earth's field at the known gravity and *any* heading. The heading is eliminated: of the three
    components the one along which it moves the reading is left out, and the two that remain are
    taken along the field (strength) and across it (dip). Slopes are those of the model's field,
    not of the noisy reading, so noise is not taken for soft iron (errors in variables).
    """
    values, slopes, pulls = _rows(samples, parameters)
    if noise is None:
        return values, slopes
    return whitened(values, pulls, noise), whitened(slopes, pulls, noise)


def _rows(samples: Samples, parameters: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residuals, their derivatives, and their change by one unit of u, as they come."""
    correction = unpack(parameters[:CORRECTION_SIZE])
    strength, sine = parameters[STRENGTH], np.clip(parameters[SIN_DIP], -0.999, 0.999)
    cosine = np.sqrt(1.0 - sine**2)
    inverse: FloatArray = np.linalg.inv(correction.soft_iron).astype(np.float64)
    corrected = correction.apply(samples.raw, samples.u)
    down = samples.down
    level = corrected - np.einsum("ij,ij->i", corrected, down)[:, None] * down
    north = level / np.maximum(np.linalg.norm(level, axis=1), 1e-9)[:, None]
    earth = strength * (cosine * north + sine * down)
    axes = _axes(earth, down, inverse)
    apart = (corrected - earth) @ inverse.T
    pulled = [axis @ inverse for axis in axes]
    slopes = np.empty((len(samples), 2, SIZE))
    leaning = _leaning(samples)
    for kind in range(2):
        # A turn w of the body moves the field in body axes by w × b, which b × pulled weighs.
        turned = np.cross(earth, pulled[kind])
        slopes[:, kind, TILT] = -turned[:, :2]
        slopes[:, kind, LEAN] = -turned[:, :2] * leaning
        slopes[:, kind, FIELD_LAG] = np.einsum(
            "ij,ij->i", turned, np.cross(down, samples.down_rate)
        )
    values = np.stack([np.einsum("ij,ij->i", axis, apart) for axis in axes], axis=1)
    values += slopes[:, :, CORRECTION_SIZE + 4 :] @ parameters[CORRECTION_SIZE + 4 :]
    pulls = np.stack([one @ correction.motor for one in pulled], axis=1)
    centred = (earth - np.multiply.outer(samples.u, correction.motor)) @ inverse.T
    for kind, (axis, pull) in enumerate(zip(axes, pulled, strict=True)):
        rows = slopes[:, kind, :]
        rows[:, MOTOR] = pull * samples.u[:, None]
        rows[:, OFFSET] = axis
        rows[:, _DIAGONAL] = pull * centred
        for column, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)), start=9):
            rows[:, column] = pull[:, i] * centred[:, j] + pull[:, j] * centred[:, i]
        rows[:, STRENGTH] = -np.einsum("ij,ij->i", pull, earth) / strength
        rows[:, SIN_DIP] = -strength * np.einsum("ij,ij->i", pull, down - sine / cosine * north)
        rows[:, REGRESSOR_LAG] = (
            np.einsum("ij,ij->i", axis, samples.raw_rate) - pulls[:, kind] * samples.u_rate
        )
    return values, slopes, pulls


def _axes(
    earth: FloatArray, down: FloatArray, inverse: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Unit vectors in sensor axes along the field and across it, both square to a turn."""
    turn = np.cross(down, earth) @ inverse.T
    turn /= np.maximum(np.linalg.norm(turn, axis=1), 1e-9)[:, None]
    along = earth @ inverse.T
    along -= np.einsum("ij,ij->i", along, turn)[:, None] * turn
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    return along, np.cross(turn, along)


def _leaning(samples: Samples) -> FloatArray:
    """Roll and pitch, slowly followed: what acceleration does to an attitude filter, (n, 2).

    A multirotor accelerates where it leans, and its attitude filter takes the acceleration for
    gravity within a few seconds.
    """
    if len(samples) < 2:
        return np.zeros((len(samples), 2))
    step = max(float(np.median(np.diff(samples.time))), 1e-3)
    share = step / (LEAN_S + step)
    tilt = samples.attitude[:, :2] - np.median(samples.attitude[:, :2], axis=0)
    return low_pass(tilt, share)


def vertical_of(parameters: FloatArray) -> float:
    """Downward part of the earth's field, mGauss."""
    return float(parameters[STRENGTH] * parameters[SIN_DIP])


def correction_of(found: Estimate) -> Correction:
    """The correction among the parameters."""
    return unpack(found.parameters[:CORRECTION_SIZE])
