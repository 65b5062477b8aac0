"""One compass, one row per new reading: what every fit works on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from magcomp.model.recording import BoolArray, FloatArray, IntArray, Series

THROTTLE = "throttle"
CURRENT = "current"
UNITS: Mapping[str, str] = {CURRENT: "A", THROTTLE: ""}
"""Unit of each control quantity; throttle is a fraction 0 … 1."""


@dataclass(frozen=True, eq=False)
class Correction:
    """A complete compass correction: corrected = soft_iron · (raw + offset) + motor · u.

    Attributes
    ----------
    offset
        mGauss, shape (3,): minus the centre of the raw ellipsoid at u = 0.
    soft_iron
        Symmetric and positive definite, shape (3, 3).
    motor
        mGauss per unit of the control quantity, shape (3,).
    """

    offset: FloatArray
    soft_iron: FloatArray
    motor: FloatArray

    def apply(self, raw: FloatArray, u: FloatArray) -> FloatArray:
        """Corrected field, mGauss, shape (n, 3): docs/method.md, Equation 6."""
        return (raw + self.offset) @ self.soft_iron.T + np.multiply.outer(u, self.motor)

    def undo(self, corrected: FloatArray, u: FloatArray) -> FloatArray:
        """Sensor field, mGauss, shape (n, 3): the inverse of :meth:`apply`."""
        linear = corrected - np.multiply.outer(u, self.motor)
        return np.asarray(np.linalg.solve(self.soft_iron, linear.T).T - self.offset)

    def centre(self, u: float) -> FloatArray:
        """Centre of the raw ellipsoid at control quantity ``u``, mGauss, shape (3,)."""
        return -self.offset - np.linalg.solve(self.soft_iron, self.motor) * u


@dataclass(frozen=True)
class Lags:
    """Delays behind the attitude and behind the field, seconds.

    Attributes
    ----------
    field
        A field reported at t was measured at t − field, on the clock of the attitude.
    regressor
        A field reported at t goes with the control quantity reported for t − regressor.
    """

    field: float = 0.0
    regressor: float = 0.0


@dataclass(frozen=True, eq=False)
class Control:
    """One control quantity as a function of time.

    Attributes
    ----------
    kind
        ``"current"`` or ``"throttle"``.
    series
        The quantity in the unit of :data:`UNITS`.
    origin
        In words: which messages it was made of.
    """

    kind: str
    series: Series
    origin: str


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
    """

    correction: Correction
    regressor: str | None
    unseen: tuple[str, ...] = ()


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
        What is in force was multiplied by a control quantity this much older than what disturbed
        the reading, seconds.
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
        Change of ``raw`` per second of regressor lag (a motor correction was undone), shape (n, 3).
    present
        Field as the correction now in force corrects it, mGauss, shape (n, 3).
    attitude
        Roll, pitch, yaw at the moment of measurement, radians, shape (n, 3).
    down
        Unit vector of gravity in body axes at that moment, shape (n, 3).
    down_rate
        Its change per second, shape (n, 3).
    u
        Control quantity, shape (n,).
    u_rate
        Its change per second, shape (n,).
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
    u: FloatArray
    u_rate: FloatArray

    def __len__(self) -> int:
        return len(self.time)

    def where(self, keep: BoolArray) -> Samples:
        """The rows for which ``keep`` is true."""
        columns = (f.name for f in fields(self) if f.name not in ("compass", "lags"))
        return replace(self, **{name: getattr(self, name)[keep] for name in columns})
