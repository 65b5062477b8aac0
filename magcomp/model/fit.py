"""What a fit found, with how sure it is, and what the judge makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from magcomp.model.forms import AsWritten, Form
from magcomp.model.recording import FloatArray, Vehicle
from magcomp.model.samples import Correction, Lags

CORRECTION_SIZE = 12
"""Parameters of a correction: motor x y z, offset x y z, soft iron xx yy zz xy xz yz.

Where the control quantity has more than one part, the other parts' motor vectors follow.
"""

MOTOR, OFFSET, SOFT_IRON = slice(0, 3), slice(3, 6), slice(6, 12)
_ROWS, _COLUMNS = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])


def pack(correction: Correction) -> FloatArray:
    """A correction of k parts as its 9 + 3 k parameters, 12 for one part."""
    first, others = correction.motor[:, 0], correction.motor[:, 1:]
    return np.concatenate(
        [first, correction.offset, correction.soft_iron[_ROWS, _COLUMNS], others.T.reshape(-1)]
    )


def unpack(parameters: FloatArray) -> Correction:
    """A correction from its parameters: the inverse of :func:`pack`."""
    others = parameters[CORRECTION_SIZE:].reshape(-1, 3)
    return Correction(
        offset=parameters[OFFSET].copy(),
        soft_iron=symmetric(parameters[SOFT_IRON]),
        motor=np.vstack([parameters[MOTOR], others]).T,
    )


def symmetric(six: FloatArray) -> FloatArray:
    """Symmetric 3×3 matrix from xx, yy, zz, xy, xz, yz.

    Examples
    --------
    >>> symmetric(np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])).tolist()
    [[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 3.0]]
    """
    matrix = np.empty((3, 3))
    matrix[_ROWS, _COLUMNS] = six
    matrix[_COLUMNS, _ROWS] = six
    return matrix


@dataclass(frozen=True, eq=False)
class Level:
    """The centre of the raw ellipsoid at one control quantity: docs/method.md, Fig. 4.

    Attributes
    ----------
    u
        Control quantity.
    u_std
        Standard error of its mean.
    centre
        mGauss, shape (3,).
    covariance
        mGauss², shape (3, 3).
    count
        Readings it rests on.
    """

    u: float
    u_std: float
    centre: FloatArray
    covariance: FloatArray
    count: int


@dataclass(frozen=True, eq=False)
class Line:
    """The line in space the centres lie on.

    Attributes
    ----------
    point
        A point on the line, mGauss, shape (3,).
    direction
        Unit vector, shape (3,).
    positions
        Position of each centre along the line from ``point``, mGauss, shape (k,).
    slope, intercept
        position = intercept + slope · u, mGauss per unit and mGauss.
    slope_std
        Standard error of the slope.
    rms
        Distance of the centres from the line, mGauss.
    straightness
        Share of the centres' spread that lies along the line, 0 … 1.
    chi2, degrees
        Weighted squared distance of the centres from slope · u, and its degrees of freedom.
    """

    point: FloatArray
    direction: FloatArray
    positions: FloatArray
    slope: float
    intercept: float
    slope_std: float
    rms: float
    straightness: float
    chi2: float
    degrees: int


@dataclass(frozen=True, eq=False)
class MotorFit:
    """How one compass moves with one control quantity.

    Attributes
    ----------
    compass
        1, 2 or 3.
    method
        ``"sweep"``, ``"levels"`` or ``"flight"``.
    why
        In words, why this method and these free parameters.
    regressor
        The name of a :class:`Quantity`.
    origin
        In words, what the regressor was made of.
    correction
        What to write.
    covariance
        Of the parameters of :func:`pack`, shape (12, 12) for one part.
    free
        Which groups the data determined: a subset of ``{"motor", "offset", "diagonal",
        "off-diagonal"}``.
    lags, lags_std
        The delays and their standard errors; NaN where a method cannot see one.
    strength, vertical
        Earth field as found, mGauss; ``vertical`` is its downward part.
    noise
        Robust spread of the residuals, mGauss.
    levels, line
        The centres and the line through them; no line through fewer than two.
    u_low, u_high
        Range of the control quantity the data cover (2nd and 98th percentile).
    count
        Readings used.
    kept
        Whether the correction is the one that was in force, because the data cannot tell it from
        a better one.
    numbers
        Of which motor each part of the control quantity is; empty where it has one part.
    told_apart
        Covariance of how the motors' vectors differ, as the recording alone tells it,
        (mGauss per unit)², shape (3 (k − 1), 3 (k − 1)); empty where the control quantity has one
        part.
    """

    compass: int
    method: str
    why: str
    regressor: str
    origin: str
    correction: Correction
    covariance: FloatArray
    free: frozenset[str]
    lags: Lags
    lags_std: Lags
    strength: float
    vertical: float
    noise: float
    levels: tuple[Level, ...]
    line: Line | None
    u_low: float
    u_high: float
    count: int
    kept: bool = False
    numbers: tuple[int, ...] = ()
    told_apart: FloatArray = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def interference(self) -> FloatArray:
        """Field the motors add to the corrected field, mGauss per unit, shape (3,)."""
        return -self.correction.vector

    @property
    def interference_std(self) -> FloatArray:
        """Standard errors of :attr:`interference`, shape (3,)."""
        return np.asarray(np.sqrt(np.diag(self.shared_covariance)[MOTOR]))

    @property
    def by_motor(self) -> tuple[tuple[int, FloatArray, FloatArray], ...]:
        """Number of each motor, what it adds, mGauss per unit, (3,), and its standard errors."""
        std = np.sqrt(np.diag(self.covariance))
        each = np.vstack([std[MOTOR], std[CORRECTION_SIZE:].reshape(-1, 3)])
        return (
            tuple(zip(self.numbers, -self.correction.motor.T, each, strict=True))
            if (self.numbers)
            else ()
        )

    @property
    def shared_covariance(self) -> FloatArray:
        """Covariance where all parts share the total alike, shape (12, 12).

        Of the 12 parameters ``Correction.vector``, offset and soft iron: :attr:`covariance` itself
        where the control quantity has one part.
        """
        parts = self.correction.motor.shape[1]
        mean = np.zeros((CORRECTION_SIZE, len(self.covariance)))
        mean[:, :CORRECTION_SIZE] = np.eye(CORRECTION_SIZE)
        mean[MOTOR, MOTOR] /= parts
        mean[MOTOR, CORRECTION_SIZE:] = np.tile(np.eye(3) / parts, parts - 1)
        return np.asarray(mean @ self.covariance @ mean.T)


class Grade(StrEnum):
    """The judge's word."""

    GOOD = "good"
    MARGINAL = "marginal"
    REJECTED = "rejected"


@dataclass(frozen=True)
class HeadingError:
    """Largest heading error over a full turn at one control quantity, degrees.

    Attributes
    ----------
    u
        Control quantity.
    before
        With the correction that was in force, measured against the fit.
    after
        With the fitted correction, expected (median of what the uncertainty allows).
    p95
        With the fitted correction, not exceeded with 95 % probability.
    """

    u: float
    before: float
    after: float
    p95: float


@dataclass(frozen=True)
class Coverage:
    """What the data cover.

    Attributes
    ----------
    sphere
        Share of the sphere of directions of the field seen in body axes, 0 … 1.
    heading
        Share of the full turn seen, 0 … 1.
    tilt_deg
        Largest tilt (98th percentile).
    u_low, u_high
        Range of the control quantity.
    seconds
        Time with readings in use.
    u_median
        Control quantity in use half of the time the motors worked: the hover of a flight. NaN
        where unknown.
    """

    sphere: float
    heading: float
    tilt_deg: float
    u_low: float
    u_high: float
    seconds: float
    u_median: float = np.nan


@dataclass(frozen=True)
class FieldResidual:
    """Field variation that a correction leaves unexplained, mGauss (root mean square).

    Attributes
    ----------
    before
        With the correction that was in force.
    after
        With the fit, on the data it saw.
    held_out
        With fits that did not see the data they are tested on.
    held_out_before
        With the correction in force, on the same held-out stretches.
    """

    before: float
    after: float
    held_out: float
    held_out_before: float


@dataclass(frozen=True)
class Verdict:
    """What the judge says of one compass.

    Attributes
    ----------
    grade
        Good, marginal or rejected.
    reasons
        For a pilot, most important first.
    heading_error
        By control quantity.
    residual, coverage
        The evidence.
    """

    grade: Grade
    reasons: tuple[str, ...]
    heading_error: tuple[HeadingError, ...]
    residual: FieldResidual
    coverage: Coverage


@dataclass(frozen=True, eq=False)
class CompassResult:
    """One compass from fit to parameters.

    Attributes
    ----------
    parameters
        Exactly what would be written.
    insisted
        What would be written if the user insists on a rejected fit.
    left_out
        What would be written for this compass if its fit is not, though another compass's is: one
        switch may serve all compasses.
    forms
        What the field may follow, compared on unseen data; empty where only one was tried.
    as_written
        What the firmware can apply of the fit, where that is not the fit itself.
    """

    fit: MotorFit
    verdict: Verdict
    in_force: Correction
    parameters: Mapping[str, float]
    insisted: Mapping[str, float] = field(default_factory=dict)
    left_out: Mapping[str, float] = field(default_factory=dict)
    forms: tuple[Form, ...] = ()
    as_written: AsWritten | None = None


@dataclass(frozen=True, eq=False)
class Analysis:
    """The answer for one recording.

    Attributes
    ----------
    source, duration_s, vehicle
        Where it comes from.
    compasses
        One result a compass, in order.
    notes
        What a user should know of the recording: what was missing, what was left out.
    only_to_look_at
        Why no parameters follow from it, whatever the verdict: the firmware cannot multiply what
        it was fitted against. Empty where it can.
    """

    source: str
    duration_s: float
    vehicle: Vehicle
    compasses: tuple[CompassResult, ...]
    notes: tuple[str, ...]
    only_to_look_at: str = ""

    @property
    def grade(self) -> Grade:
        """The best grade among the compasses; what is written is what is not rejected."""
        order = (Grade.GOOD, Grade.MARGINAL, Grade.REJECTED)
        return min((c.verdict.grade for c in self.compasses), key=order.index)
