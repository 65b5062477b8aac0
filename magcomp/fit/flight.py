"""An ordinary flight, or hand-turning with motors running: strength and dip of the field.

The corrected field c = D · (raw + OFS) + MOT · u must have the earth's strength
at every attitude and every control quantity, and its part along gravity must be
the earth's vertical part. Neither residual contains the heading, so an error of
heading cannot leak in::

    r₁ = |c| − F                (docs/method.md, Equation 4)
    r₂ = c · down − F sin(dip)

The lags are parameters like the others. How much is free follows from what the
data can tell: the motor vector alone, then offsets, then the diagonal, then the
off-diagonal of the soft iron, each group with the calibration in force as prior.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from magcomp.align import sample, within
from magcomp.earth import EarthField
from magcomp.fit.control_noise import Noise
from magcomp.fit.field_model import (
    APPLIED_LAG,
    BLUR,
    DIAGONAL,
    FIELD_LAG,
    LAGS,
    LEAN,
    OFF_DIAGONAL,
    REGRESSOR_LAG,
    SIN_DIP,
    SIZE,
    STRENGTH,
    TILT,
    correction_at,
    errors_of,
    indices_of_correction,
    lags_of,
    rows_and_errors,
    strength_and_dip,
)
from magcomp.fit.robust import (
    NEGLIGIBLE,
    ROUNDS,
    Estimate,
    Prior,
    one_step,
    recorded_time,
    solve,
    time_blocks,
)
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
)

TILT_WIDTH_RAD = np.radians(0.5)
"""Autopilots level their attitude to about this: constant errors of roll and of pitch."""

LEAN_WIDTH = 0.1
"""Radians of attitude error a radian of lean held for seconds."""

BLUR_WIDTH = 1.0
"""The field may follow the control quantity at once, or as late as its blurred form, or between."""

SEARCHED = 0.1
"""A search is over where a step raises the log-likelihood by no more: a third of a standard error
along one direction, which changes no comparison and no size of an error."""

LAG_MEAN_S, LAG_WIDTH_S, LAG_MOST_S = 0.08, 0.1, 0.6
"""The field and the current are late by some 0.1 s: docs/autopilots.md, ArduPilot: timing."""

DIP_WIDTH = 0.02
"""The world model misses the sine of the local dip by about this much."""

SCALE_WIDTH = 0.15
"""Sensors without a calibrated scale are off by about this share."""

TRUSTED_OFFSET_MGAUSS = 4.0
TRUSTED_SOFT_IRON = 0.005
"""How well an ordinary calibration in force is taken to be known."""

EACH_MOTOR_MGAUSS_PER_A = 100.0
"""What a wire at a distance of 2 cm makes: 2 I / d."""

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
    size = SIZE + 3 * (problem.control.parts - 1)
    mean = np.zeros(size)
    mean[:CORRECTION_SIZE] = pack(present)[:CORRECTION_SIZE]
    mean[MOTOR] = 0.0
    mean[[STRENGTH, SIN_DIP]] = earth.strength, np.sin(earth.dip)
    mean[LAGS] = LAG_MEAN_S
    mean[APPLIED_LAG] += problem.readings.applied_later
    width = np.zeros(size)
    # Differences that a flight does not show at all must not come out as known to be nothing.
    width[MOTOR] = width[SIZE:] = np.inf if problem.control.parts == 1 else EACH_MOTOR_MGAUSS_PER_A
    width[OFFSET] = OPEN_OFFSET_MGAUSS if free >= 2 else TRUSTED_OFFSET_MGAUSS
    width[DIAGONAL] = OPEN_SOFT_IRON if free >= 3 else 0.0
    width[OFF_DIAGONAL] = OPEN_SOFT_IRON if free >= 4 else 0.0
    # A free shape and a free strength are one number too many: scale is then the model's.
    width[STRENGTH] = (1e-4 if free >= 3 else SCALE_WIDTH) * earth.strength
    width[SIN_DIP] = DIP_WIDTH
    width[LAGS] = LAG_WIDTH_S
    width[TILT], width[LEAN], width[BLUR] = TILT_WIDTH_RAD, LEAN_WIDTH, BLUR_WIDTH
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
        Parameters to begin at, shape (SIZE,); the prior's mean by default.
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
    known = _with_lags_held(prior(problem, free)) if hold_lags else prior(problem, free)
    begin = known.mean if start is None else np.where(known.width > 0, start, known.mean)
    if hold_lags and start is not None:
        begin[LAGS] = start[LAGS]
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
            enough=NEGLIGIBLE if with_covariance and last else SEARCHED,
            feasible=is_physical,
        )

    found = solved(begin, errors, last=not search)
    if search:
        errors = errors_of(rows_at(found.parameters), found.parameters)
        found = solved(found.parameters, errors, last=True)
    return FlightEstimate(**vars(found), errors=errors)


def near(problem: Problem, free: int, start: FloatArray) -> FloatArray:
    """The parameters of a part of the readings, from those of all of them.

    Parameters
    ----------
    problem
        A part of the readings.
    free
        Groups of :data:`GROUPS` that were open.
    start
        What all readings gave, shape (SIZE,); its lags are kept.
    """
    samples = problem.sample(lags_of(start))
    (values, slopes, _), _ = rows_and_errors(samples, start)
    return one_step(values, slopes, start, _with_lags_held(prior(problem, free)))


def _with_lags_held(known: Prior) -> Prior:
    width = known.width.copy()
    width[LAGS] = 0.0
    return Prior(known.mean, width)


def drift_blocks(time: FloatArray) -> IntArray:
    """Blocks as long as the drift of sensors and attitude, a dozen of them at least."""
    duration = float(recorded_time(time)[-1]) if len(time) else 0.0
    return time_blocks(time, float(np.clip(duration / _LEAST_BLOCKS, BLOCK_S, DRIFT_S)))


def estimate_lags(problem: Problem, correction: Correction) -> tuple[Lags, Lags]:
    """The lags and their standard errors for a correction that is known already.

    Parameters
    ----------
    problem
        The data, transitions of the control quantity included.
    correction
        Found by a method that does not need the lags.
    """
    known = prior(problem, 1)
    width, begin = known.width.copy(), known.mean.copy()
    among = indices_of_correction(len(begin))
    width[among] = 0.0
    begin[among] = pack(correction)
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
    held = np.zeros(len(width), dtype=bool)
    held[SOFT_IRON] = width[SOFT_IRON] == 0.0
    width[held] = TRUSTED_SOFT_IRON
    return Prior(known.mean, width)


def is_physical(parameters: FloatArray) -> bool:
    """Whether the soft iron is positive definite and the lags possible.

    A mirrored soft iron fits strength and dip as well and turns the heading by 180°.
    """
    values = np.linalg.eigvalsh(symmetric(parameters[SOFT_IRON]))
    lags = np.abs(parameters[LAGS])
    return bool(values[0] > 0.3 and values[-1] < 3.0 and np.all(lags < LAG_MOST_S))


def correction_of(found: Estimate) -> Correction:
    """The correction among the parameters."""
    return correction_at(found.parameters)
