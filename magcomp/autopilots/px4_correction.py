"""PX4's compass correction, forward and backward, and what of the parameters is in force.

The order inside the autopilot (docs/autopilots.md, PX4: correction)::

    corrected = R · S · ((sensor + P · COMP) − OFF)

in gauss, with COMP, OFF and S in the sensor's axes, P the current in kiloampere or the thrust
0 … 1, and R from the sensor's axes into the vehicle's. In magcomp's own form, in body axes and
mGauss, the soft iron is R · S · Rᵀ, which is as symmetric as S; the offset is −R · OFF, and the
motor vector R · S · COMP.

The parameters are not what is in force: the firmware takes them over only while disarmed, and
only where they differ enough from what it has.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from magcomp.autopilots.px4_names import (
    COMPENSATION_SWITCH,
    OLD_ROTATION_SWITCH,
    acting_on,
    parse,
    vector_names,
)
from magcomp.model import (
    CURRENT,
    THROTTLE,
    Correction,
    FloatArray,
    InForce,
    ParameterHistory,
    Series,
    quantity_of,
)

MGAUSS = 1000.0
"""mGauss in a gauss; also amperes in a kiloampere, so that COMP in gauss per kiloampere is mGauss
per ampere."""

OFFSET_ZONE, OLD_OFFSET_ZONE = 0.005, 0.01
"""Changes of OFF up to this length are not taken over, gauss; the longer one to 1.13."""

SHAPE_ZONE = 0.01
"""Changes of SCALE and of ODIAG up to this length are not taken over."""


class Compensation(IntEnum):
    """CAL_MAG_COMP_TYP: one switch for all compasses, and what P is."""

    OFF = 0
    THRUST = 1
    CURRENT_0 = 2
    CURRENT_1 = 3


REGRESSOR_OF = {
    Compensation.THRUST: THROTTLE,
    Compensation.CURRENT_0: CURRENT,
    Compensation.CURRENT_1: CURRENT,
}


def compensation_of(regressor: str, battery: int) -> Compensation:
    """The switch that multiplies COMP by a control quantity, of a battery instance where current.

    Parameters
    ----------
    battery
        0 or 1, as the firmware counts.
    """
    if quantity_of(regressor).is_throttle:
        return Compensation.THRUST
    return Compensation.CURRENT_1 if battery == 1 else Compensation.CURRENT_0


@dataclass(frozen=True, eq=False)
class Calibration:
    """What PX4 does to one sensor, in its own terms.

    Attributes
    ----------
    offset
        OFF, gauss, shape (3,), subtracted.
    scale, off_diagonal
        SCALE and ODIAG, shape (3,) each.
    motor
        COMP, gauss per kiloampere or gauss at full thrust, shape (3,).
    compensation
        What P is; values that the firmware does not know are off.
    """

    offset: FloatArray
    scale: FloatArray
    off_diagonal: FloatArray
    motor: FloatArray
    compensation: Compensation

    @property
    def soft_iron(self) -> FloatArray:
        """S, shape (3, 3)."""
        (sx, sy, sz), (xy, xz, yz) = self.scale, self.off_diagonal
        return np.array([[sx, xy, xz], [xy, sy, yz], [xz, yz, sz]])

    def same_as(self, other: Calibration) -> bool:
        """Whether both correct every reading alike."""
        return self.compensation == other.compensation and all(
            np.array_equal(getattr(self, name), getattr(other, name))
            for name in ("offset", "scale", "off_diagonal", "motor")
        )


AT_START = Calibration(np.zeros(3), np.ones(3), np.zeros(3), np.zeros(3), Compensation.OFF)
"""What a firmware begins with before it looks at its parameters."""


def stored(values: Mapping[str, float], compass: int) -> Calibration:
    """The calibration that the parameters hold, in force or not."""

    def vector(kind: str, default: float = 0.0) -> FloatArray:
        return np.array([values.get(name, default) for name in vector_names(kind, compass)])

    kind = values.get(COMPENSATION_SWITCH, 0.0)
    known = kind in tuple(Compensation)
    return Calibration(
        offset=vector("OFF"),
        scale=vector("SCALE", 1.0),
        off_diagonal=vector("ODIAG"),
        motor=vector("COMP"),
        compensation=Compensation(int(kind)) if known else Compensation.OFF,
    )


def offset_zone(values: Mapping[str, float]) -> float:
    """Length up to which a change of OFF is not taken over, gauss."""
    return OLD_OFFSET_ZONE if OLD_ROTATION_SWITCH in values else OFFSET_ZONE


def taken_over(present: Calibration, wanted: Calibration, zone: float) -> Calibration:
    """What is in force after a disarmed vehicle has looked at its parameters.

    Parameters
    ----------
    present
        What was in force.
    wanted
        What the parameters hold.
    zone
        From :func:`offset_zone`.
    """
    return Calibration(
        offset=_taken(present.offset, wanted.offset, zone),
        scale=_taken(present.scale, wanted.scale, SHAPE_ZONE)
        if (wanted.scale > 0.0).all()
        else present.scale,
        off_diagonal=_taken(present.off_diagonal, wanted.off_diagonal, SHAPE_ZONE),
        motor=wanted.motor,
        compensation=wanted.compensation,
    )


def _taken(present: FloatArray, wanted: FloatArray, zone: float) -> FloatArray:
    far = np.isfinite(wanted).all() and float(np.linalg.norm(wanted - present)) > zone
    return wanted if far else present


def after_start(values: Mapping[str, float], compass: int) -> Calibration:
    """What is in force after a start with given parameters."""
    return taken_over(AT_START, stored(values, compass), offset_zone(values))


def stretches(
    parameters: ParameterHistory, compass: int, armed: Series | None
) -> list[tuple[float, Calibration]]:
    """What was in force from each time on, oldest first; the first from −∞.

    Notes
    -----
    A recording tells nothing of the time before it, so that it is taken to follow a start with
    its first values. The switch acts at once, all else at the next change of any parameter while
    disarmed.
    """
    names = (*acting_on(compass), COMPENSATION_SWITCH)
    values = {name: changes[0].value for name in names if (changes := parameters.of(name))}
    zone = offset_zone(dict.fromkeys(parameters.names, 0.0))
    now = taken_over(AT_START, stored(values, compass), zone)
    found = [(-math.inf, now)]
    for time, changed in _changes(parameters):
        values |= {name: value for name, value in changed.items() if name in names}
        wanted = stored(values, compass)
        if not is_armed(armed, time):
            later = taken_over(now, wanted, zone)
        else:
            later = replace(now, compensation=wanted.compensation)
        if not later.same_as(now):
            found.append((time, later))
            now = later
    return found


def _changes(parameters: ParameterHistory) -> list[tuple[float, dict[str, float]]]:
    """Parameters that got another value than before, by time, oldest first."""
    last: dict[str, float] = {}
    found: dict[float, dict[str, float]] = {}
    for name in parameters.names:
        for report in parameters.of(name):
            before = last.get(name)
            if before is not None and before != report.value:
                found.setdefault(report.time, {})[name] = report.value
            last[name] = report.value
    return sorted(found.items())


def is_armed(armed: Series | None, time: float) -> bool:
    """Whether a vehicle was armed at a time; False where unknown."""
    if armed is None or not len(armed):
        return False
    row = int(np.searchsorted(armed.time, time, side="right")) - 1
    return row >= 0 and bool(armed.value[row] > 0.5)


def unseen(parameters: ParameterHistory, compass: int) -> tuple[str, ...]:
    """Parameters that act on a compass whose value is not told, though the vehicle has them."""
    names = (*acting_on(compass), COMPENSATION_SWITCH)
    missing = [name for name in names if not parameters.of(name)]
    kinds = {
        found.kind
        for name in parameters.names
        if (found := parse(name)) is not None and found.compass in (0, compass)
    }
    if not parameters.whole:
        return tuple(missing)
    return tuple(
        name for name in missing if (found := parse(name)) is not None and found.kind in kinds
    )


def body_correction(calibration: Calibration, rotation: FloatArray) -> Correction:
    """A calibration in magcomp's own form: body axes and mGauss.

    Parameters
    ----------
    rotation
        From the sensor's axes into the vehicle's, shape (3, 3).
    """
    off = calibration.compensation is Compensation.OFF
    unit = MGAUSS if calibration.compensation is Compensation.THRUST else 1.0
    soft_iron = calibration.soft_iron
    motor = np.zeros(3) if off else unit * rotation @ soft_iron @ calibration.motor
    turned = rotation @ soft_iron @ rotation.T
    return Correction(
        offset=-MGAUSS * rotation @ calibration.offset,
        soft_iron=(turned + turned.T) / 2,
        motor=np.asarray(motor),
    )


def sensor_calibration(
    correction: Correction, rotation: FloatArray, compensation: Compensation
) -> Calibration:
    """The inverse of :func:`body_correction`, for a switch that is not off."""
    unit = MGAUSS if compensation is Compensation.THRUST else 1.0
    soft_iron = rotation.T @ correction.soft_iron @ rotation
    return Calibration(
        offset=np.asarray(-rotation.T @ correction.offset / MGAUSS),
        scale=np.diag(soft_iron).copy(),
        off_diagonal=soft_iron[(0, 0, 1), (1, 2, 2)],
        motor=np.asarray(np.linalg.solve(soft_iron, rotation.T @ correction.vector) / unit),
        compensation=compensation,
    )


def in_force(
    calibration: Calibration, rotation: FloatArray, missing: tuple[str, ...] = ()
) -> InForce:
    """What a calibration does to a reading, in magcomp's own terms."""
    return InForce(
        correction=body_correction(calibration, rotation),
        regressor=REGRESSOR_OF.get(calibration.compensation),
        unseen=missing,
    )


def correct(sensor: ArrayLike, power: ArrayLike, calibration: Calibration) -> FloatArray:
    """The corrected field in the sensor's axes, gauss, as the autopilot computes it.

    Parameters
    ----------
    sensor
        sensor_mag, gauss, shape (..., 3).
    power
        P, shape (...).
    """
    rows = MGAUSS * np.asarray(sensor, float)
    unit = 1.0 if calibration.compensation is Compensation.THRUST else MGAUSS
    made = body_correction(calibration, np.eye(3)).apply(
        rows.reshape(-1, 3), unit * np.ravel(power)
    )
    return np.asarray(made.reshape(rows.shape) / MGAUSS)
