"""One compass, one row per new reading: what every fit works on."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from magcomp.model.numbers import median
from magcomp.model.recording import (
    BoolArray,
    FloatArray,
    IntArray,
    Series,
    interpolate,
    running_mean,
)

BLUR_S = 0.2
"""A reading is a mean over a tenth of a second, and motors follow their outputs within two."""

SLOW_S = 2.0
"""What varies within this is told with another gain than what lasts."""

LEANS_S = (2.0, 8.0)
"""How soon a lean that is held shows in the attitude: between these, for most filters."""

_LEAST_STEP_S = 1e-3


@dataclass(frozen=True, eq=False)
class Correction:
    """A complete compass correction: corrected = soft_iron · (raw + offset) + motor · u.

    The control quantity u is one number, such as the battery's current, or has k parts, such as
    the current of each motor. Wherever u is asked for, its parts may be given, shape (n, k), or
    their total, shape (n,), which then all parts share alike.

    Attributes
    ----------
    offset
        mGauss, shape (3,): minus the centre of the raw ellipsoid at u = 0.
    soft_iron
        Symmetric and positive definite, shape (3, 3).
    motor
        mGauss per unit of each part of the control quantity, shape (3, k); one vector, shape (3,),
        may be given where there is one part.

    Examples
    --------
    A current of 10 A that moves the field by −2 mGauss an ampere along x:

    >>> made = Correction(np.zeros(3), np.eye(3), np.array([2.0, 0.0, 0.0]))
    >>> made.apply(np.array([[180.0, 0.0, 400.0]]), np.array([10.0])).tolist()
    [[200.0, 0.0, 400.0]]
    """

    offset: FloatArray
    soft_iron: FloatArray
    motor: FloatArray

    def __post_init__(self) -> None:
        if np.ndim(self.motor) == 1:
            object.__setattr__(self, "motor", np.asarray(self.motor)[:, None])

    @property
    def vector(self) -> FloatArray:
        """Its field per unit of the total, mGauss, shared alike by all parts, shape (3,)."""
        return np.asarray(self.motor[:, 0] if self.motor.shape[1] == 1 else self.motor.mean(axis=1))

    def added(self, u: FloatArray) -> FloatArray:
        """What the motor correction adds, mGauss, shape (n, 3)."""
        if np.ndim(u) == 1:
            return np.multiply.outer(u, self.vector)
        return np.asarray(u @ self.motor.T)

    def apply(self, raw: FloatArray, u: FloatArray) -> FloatArray:
        """Corrected field, mGauss, shape (n, 3): docs/method.md, Equation 6."""
        return (raw + self.offset) @ self.soft_iron.T + self.added(u)

    def undo(self, corrected: FloatArray, u: FloatArray) -> FloatArray:
        """Sensor field, mGauss, shape (n, 3): the inverse of :meth:`apply`."""
        linear = corrected - self.added(u)
        return np.asarray(np.linalg.solve(self.soft_iron, linear.T).T - self.offset)

    def centre(self, u: float) -> FloatArray:
        """Centre of the raw ellipsoid at control quantity ``u``, mGauss, shape (3,)."""
        return -self.offset - np.linalg.solve(self.soft_iron, self.vector) * u


@dataclass(frozen=True)
class Lags:
    """Delays behind the attitude and behind the field, seconds.

    Attributes
    ----------
    field
        A field reported at t was measured at t − field, on the clock of the attitude.
    regressor
        A field reported at t goes with the control quantity reported for t − regressor.
    applied
        The motor correction that was in force multiplied the control quantity reported for
        t − applied; :attr:`Readings.applied_later` before t − regressor where None.
    """

    field: float = 0.0
    regressor: float = 0.0
    applied: float | None = None


@dataclass(frozen=True, eq=False)
class Control:
    """One control quantity as a function of time.

    Attributes
    ----------
    kind
        The name of a :class:`Quantity`.
    series
        The quantity, shape (n,), or its parts, shape (n, k), in the quantity's unit.
    origin
        In words: which messages it was made of.
    numbers
        Of which motor each part is, as the firmware counts them; empty where there is one part.
    unsure
        Standard error of the size of the parts' differences, as a share of it: how they went
        between the times they were told at is not known.
    """

    kind: str
    series: Series
    origin: str
    numbers: tuple[int, ...] = ()
    unsure: float = 0.0

    @cached_property
    def blurred(self) -> Series:
        """Its mean over :data:`BLUR_S` before and after each moment."""
        return running_mean(self.series, BLUR_S)

    @cached_property
    def slow(self) -> Series:
        """Its mean over :data:`SLOW_S` before and after each moment."""
        return running_mean(self.series, SLOW_S)

    @property
    def parts(self) -> int:
        """How many parts it has."""
        return 1 if self.series.value.ndim == 1 else self.series.value.shape[1]

    @property
    def total(self) -> Series:
        """The sum of the parts, shape (n,)."""
        if self.series.value.ndim == 1:
            return self.series
        return Series(self.series.time, self.series.value.sum(axis=1))


@dataclass(frozen=True, eq=False)
class InForce:
    """What the autopilot did to readings of one stretch of time.

    Attributes
    ----------
    correction
        Hard and soft iron and motor correction.
    regressor
        The control quantity ``correction.motor`` was multiplied by; None where it was off.
    unseen
        Parameters that act on the readings and of which the recording does not tell the value;
        the firmware's defaults stand for them.
    exponent
        The control quantity's parts are raised to it before they are multiplied.
    """

    correction: Correction
    regressor: str | None
    unseen: tuple[str, ...] = ()
    exponent: float = 1.0

    def multiplied(self, u: FloatArray) -> FloatArray:
        """What the motor vectors multiply at given values of the control quantity, same shape."""
        if u.ndim == 1:
            return u
        parts = u[:, : self.correction.motor.shape[1]]
        return np.asarray(np.maximum(parts, 0.0) ** self.exponent)


@dataclass(frozen=True, eq=False)
class Readings:
    """One compass before the lags are known: its new readings and what surrounds them.

    Attributes
    ----------
    compass
        1, 2 or 3.
    time
        Seconds, shape (n,).
    reported
        Field as the autopilot reported it, mGauss, shape (n, 3).
    stretch
        Index into ``in_force`` for each row, shape (n,).
    in_force
        What was in force, oldest first; the last is the present one.
    attitude
        Roll, pitch and yaw, radians, each unwrapped.
    corrected
        Whether what was in force is in ``reported``; False where the sensor's own field is.
    applied_later
        What is in force was multiplied by a control quantity about this much older than what
        disturbed the reading, seconds.
    told_offset, told_motor
        The offset and the motor correction of each reading as the log tells them, mGauss, shape
        (n, 3); None where only the parameters tell. They stand for those of ``in_force``.
    """

    compass: int
    time: FloatArray
    reported: FloatArray
    stretch: IntArray
    in_force: tuple[InForce, ...]
    attitude: Series
    corrected: bool = True
    applied_later: float = 0.05
    told_offset: FloatArray | None = None
    told_motor: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.time)

    @cached_property
    def step(self) -> float:
        """Usual time between two readings, seconds."""
        steps = np.diff(self.time)
        return max(float(median(steps)), _LEAST_STEP_S) if len(steps) else _LEAST_STEP_S

    @cached_property
    def usual_tilt(self) -> FloatArray:
        """Medians of roll and pitch, radians, shape (2,)."""
        if not len(self):
            return np.zeros(2)
        roll_and_pitch = Series(self.attitude.time, self.attitude.value[:, :2])
        return median(interpolate(roll_and_pitch, self.time))

    def where(self, keep: BoolArray) -> Readings:
        """The rows for which ``keep`` is true."""
        return replace(
            self,
            time=self.time[keep],
            reported=self.reported[keep],
            stretch=self.stretch[keep],
            told_offset=None if self.told_offset is None else self.told_offset[keep],
            told_motor=None if self.told_motor is None else self.told_motor[keep],
        )


@dataclass(frozen=True, eq=False)
class Samples:
    """One compass at given lags.

    Attributes
    ----------
    compass
        1, 2 or 3.
    lags
        The lags these rows were made with.
    time
        Seconds, shape (n,).
    raw
        Sensor field in body axes, the autopilot's correction undone, mGauss, shape (n, 3).
    raw_rate
        Change of ``raw`` per second by which the motor correction that was in force is taken to
        have been applied later, shape (n, 3).
    present
        Field as the correction now in force corrects it, mGauss, shape (n, 3).
    attitude
        Roll, pitch, yaw at the moment of measurement, radians, shape (n, 3).
    down
        Unit vector of gravity in body axes at that moment, shape (n, 3).
    down_rate
        Its change per second, shape (n, 3).
    lean
        Roll and pitch less what is usual of them, followed by a first-order low pass of each of
        :data:`LEANS_S`: what acceleration does to attitude, radians, shape (n, 4).
    u
        Parts of the control quantity, shape (n, k).
    u_rate
        Their change per second, shape (n, k).
    u_blur
        What :attr:`Control.blurred` differs from them by, shape (n, k).
    u_slow
        What :attr:`Control.slow` differs from them by, shape (n, k).
    """

    compass: int
    lags: Lags
    time: FloatArray
    raw: FloatArray
    raw_rate: FloatArray
    present: FloatArray
    attitude: FloatArray
    down: FloatArray
    down_rate: FloatArray
    lean: FloatArray
    u: FloatArray
    u_rate: FloatArray
    u_blur: FloatArray
    u_slow: FloatArray

    def __len__(self) -> int:
        return len(self.time)

    @property
    def total(self) -> FloatArray:
        """The control quantity as one number, the sum of its parts, shape (n,)."""
        return np.asarray(self.u[:, 0] if self.u.shape[1] == 1 else self.u.sum(axis=1))

    def where(self, keep: BoolArray) -> Samples:
        """The rows for which ``keep`` is true."""
        columns = (f.name for f in fields(self) if f.name not in ("compass", "lags"))
        return replace(self, **{name: getattr(self, name)[keep] for name in columns})
