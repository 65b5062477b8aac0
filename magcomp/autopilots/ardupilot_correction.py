"""ArduPilot's compass correction, forward and backward, and when it was in force.

The order inside the autopilot (AP_Compass, checked against ArduCopter 4.6.3)::

    corrected = D · (s · (raw + OFS)) + MOT · u

Fields on the link are *corrected* fields of compass priority 1, 2, 3, in body
axes, mGauss, truncated to whole numbers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from magcomp.autopilots.ardupilot_names import (
    ACTING,
    COMPENSATION_SWITCH,
    acting_on,
    parse,
    single_name,
    vector_names,
)
from magcomp.autopilots.terms import Kind
from magcomp.errors import ParameterFileError
from magcomp.model import CURRENT, THROTTLE, Correction, InForce, ParameterHistory

FloatArray = NDArray[np.float64]

SCALE_LIMIT = 1.5
"""COMPASS_SCALE is in force only between 1/1.5 and 1.5."""


class MotorCompensation(IntEnum):
    """COMPASS_MOTCT: one switch for all compasses, and what u is."""

    OFF = 0
    THROTTLE = 1
    CURRENT = 2


COMPENSATION_OF = {CURRENT: MotorCompensation.CURRENT, THROTTLE: MotorCompensation.THROTTLE}
"""COMPASS_MOTCT that makes the autopilot multiply by a control quantity."""

_WORST_CONDITION = 1e3
"""A soft iron that stretches one direction so much more than another is no calibration."""

_REGRESSOR_OF = {switch: kind for kind, switch in COMPENSATION_OF.items()}
_KIND_OF = {name: found.kind for name in ACTING if (found := parse(name)) is not None}


@dataclass(frozen=True, eq=False)
class Calibration:
    """Everything ArduPilot does to one compass.

    Attributes
    ----------
    offset
        COMPASS_OFS, mGauss, shape (3,); added to the raw field.
    soft_iron
        D, symmetric, shape (3, 3), from COMPASS_DIA and COMPASS_ODI.
    scale
        COMPASS_SCALE as used; 1 where it is out of limits.
    motor
        COMPASS_MOT, mGauss per unit of u, shape (3,); zero where switched off.
    compensation
        What u is.
    """

    offset: FloatArray
    soft_iron: FloatArray
    scale: float
    motor: FloatArray
    compensation: MotorCompensation

    def same_as(self, other: Calibration) -> bool:
        """Whether both correct every reading alike."""
        return (
            np.array_equal(self.offset, other.offset)
            and np.array_equal(self.soft_iron, other.soft_iron)
            and self.scale == other.scale
            and np.array_equal(self.motor, other.motor)
            and self.compensation == other.compensation
        )

    @property
    def has_soft_iron(self) -> bool:
        """Whether a soft-iron correction other than the identity is in force."""
        return not np.allclose(self.soft_iron, np.eye(3))


def soft_iron_matrix(diagonal: ArrayLike, off_diagonal: ArrayLike) -> FloatArray:
    """D from COMPASS_DIA and COMPASS_ODI, shape (3, 3); the identity where DIA is all zero.

    Examples
    --------
    >>> soft_iron_matrix([1.1, 1.0, 0.9], [0.01, 0.02, 0.03]).tolist()
    [[1.1, 0.01, 0.02], [0.01, 1.0, 0.03], [0.02, 0.03, 0.9]]
    >>> soft_iron_matrix([0.0, 0.0, 0.0], [0.01, 0.02, 0.03]).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    dx, dy, dz = np.asarray(diagonal, float)
    ox, oy, oz = np.asarray(off_diagonal, float)
    if dx == dy == dz == 0.0:
        return np.eye(3)
    return np.array([[dx, ox, oy], [ox, dy, oz], [oy, oz, dz]])


def soft_iron_parameters(matrix: FloatArray, compass: int) -> dict[str, float]:
    """COMPASS_DIA and COMPASS_ODI from a symmetric D."""
    diagonal = (matrix[0, 0], matrix[1, 1], matrix[2, 2])
    off_diagonal = (matrix[0, 1], matrix[0, 2], matrix[1, 2])
    return {
        **vector_parameters("DIA", compass, diagonal),
        **vector_parameters("ODI", compass, off_diagonal),
    }


def vector_parameters(kind: str, compass: int, vector: ArrayLike) -> dict[str, float]:
    """A vector's three parameters, as the float32 the autopilot stores."""
    values = np.asarray(vector, float)
    return {
        name: float(np.float32(value))
        for name, value in zip(vector_names(kind, compass), values, strict=True)
    }


def in_force(calibration: Calibration, unseen: tuple[str, ...] = ()) -> InForce:
    """What a calibration does to a reading, in magcomp's own terms."""
    return InForce(
        correction=Correction(
            offset=calibration.offset,
            soft_iron=calibration.scale * calibration.soft_iron,
            motor=calibration.motor,
        ),
        regressor=_REGRESSOR_OF.get(calibration.compensation),
        unseen=unseen,
    )


def correction_parameters(correction: Correction, compass: int, scale: float) -> dict[str, float]:
    """COMPASS_OFS, DIA, ODI and MOT that make the autopilot apply a correction.

    Parameters
    ----------
    correction
        corrected = soft_iron · (raw + offset) + motor · u.
    compass
        1, 2 or 3.
    scale
        COMPASS_SCALE as in force; it stays, so D = soft_iron / scale.
    """
    return {
        **vector_parameters("OFS", compass, correction.offset),
        **soft_iron_parameters(correction.soft_iron / scale, compass),
        **vector_parameters("MOT", compass, correction.vector),
    }


def calibration(values: Mapping[str, float], compass: int) -> Calibration:
    """Calibration of one compass; names not among ``values`` have the firmware's defaults."""

    def vector(kind: str, default: float = 0.0) -> FloatArray:
        return np.array([values.get(name, default) for name in vector_names(kind, compass)])

    # Where a part of it is told the firmware has it, and 1 is the default of the rest.
    has_soft_iron = any(name in values for name in vector_names("DIA", compass))
    scale = scale_in_force(values, compass)
    kind = values.get(COMPENSATION_SWITCH, 0.0)
    compensation = MotorCompensation(int(kind)) if kind in (0.0, 1.0, 2.0) else MotorCompensation(0)
    off = compensation is MotorCompensation.OFF
    return Calibration(
        offset=vector("OFS"),
        soft_iron=soft_iron_matrix(vector("DIA", float(has_soft_iron)), vector("ODI")),
        scale=scale,
        motor=np.zeros(3) if off else vector("MOT"),
        compensation=compensation,
    )


def scale_in_force(values: Mapping[str, float], compass: int) -> float:
    """COMPASS_SCALE as the firmware uses it."""
    scale = values.get(single_name("SCALE", compass), 1.0)
    return scale if is_scale_used(scale) else 1.0


def is_scale_used(scale: float) -> bool:
    """Whether the firmware takes a COMPASS_SCALE; else it goes on without."""
    return 1 / SCALE_LIMIT <= scale <= SCALE_LIMIT


def calibration_at(parameters: ParameterHistory, compass: int, time: float) -> Calibration:
    """Calibration of one compass in force at a time.

    Raises
    ------
    ParameterFileError
        Where a parameter of this compass is not a finite number.
    """
    values = {}
    for name in (*acting_on(compass), COMPENSATION_SWITCH):
        if not parameters.of(name):
            continue
        value = parameters.at(name, time, 0.0)
        if not math.isfinite(value):
            when = f" at {time:.1f} s" if math.isfinite(time) else ""
            raise not_finite({name: value}, when)
        values[name] = value
    return calibration(values, compass)


def not_finite(values: Mapping[str, float], when: str = "") -> ParameterFileError:
    """The error that parameters are no numbers, with what to do."""
    names = list(values)
    listed = " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
    held = ", ".join(dict.fromkeys(str(value) for value in values.values()))
    many = len(names) > 1
    ones = [name for name in names if _KIND_OF.get(name) in (Kind.DIAGONAL, Kind.SCALE)]
    neutral = "1" if len(ones) == len(names) else "0 (those of DIA and SCALE to 1)" if ones else "0"
    return ParameterFileError(
        f"{listed} must be {'finite numbers' if many else 'a finite number'}; instead the log "
        f"holds {held}{when}: set {'them' if many else 'it'} to {neutral} on the vehicle and "
        "record again"
    )


def not_undoable(parameters: ParameterHistory, compass: int) -> ParameterFileError | None:
    """The error that a soft iron once in force has no inverse; None where all have one."""
    diagonal, off_diagonal = vector_names("DIA", compass), vector_names("ODI", compass)
    names = (*diagonal, *off_diagonal)
    seen = set()
    for moment in (-math.inf, *calibration_changes(parameters, names)):
        told = {name: parameters.at(name, moment, 0.0) for name in names if parameters.of(name)}
        values = tuple(told.values())
        if values in seen:
            continue
        seen.add(values)
        if np.linalg.cond(calibration(told, compass).soft_iron) > _WORST_CONDITION:
            held = ", ".join(f"{name} {value:g}" for name, value in told.items())
            return ParameterFileError(
                f"{diagonal[0][:-2]} and {off_diagonal[0][:-2]} must be a soft iron that can be "
                f"undone; instead the log holds {held}: set those of DIA to 1 and of ODI to 0 on "
                "the vehicle and record again"
            )
    return None


def calibration_changes(
    parameters: ParameterHistory, names: Iterable[str] = ACTING
) -> tuple[float, ...]:
    """Times at which any parameter that acts on a compass reading changed its value."""
    times: set[float] = set()
    for name in names:
        reports = parameters.of(name)
        times.update(
            later.time
            for earlier, later in itertools.pairwise(reports)
            if later.value != earlier.value
        )
    return tuple(sorted(times))


def unseen(parameters: ParameterHistory, compass: int) -> tuple[str, ...]:
    """Parameters of a compass whose value is not told, though the vehicle has them.

    A firmware without soft iron or scale has no such name for any compass. A log that lacks a
    whole kind shows such a firmware only if it holds the vehicle's whole list, or at least all of
    what every firmware has: and one that has scales has soft iron too, one that has OFS has MOT.
    """
    names = (*acting_on(compass), COMPENSATION_SWITCH)
    missing = [name for name in names if not parameters.of(name)]
    always = (*vector_names("OFS", compass), *vector_names("MOT", compass), COMPENSATION_SWITCH)
    if not parameters.whole and any(name in missing for name in always):
        return tuple(missing)
    kinds = {kind for name, kind in _KIND_OF.items() if parameters.of(name)}
    if kinds & {Kind.OFF_DIAGONAL, Kind.SCALE}:
        kinds |= {Kind.DIAGONAL, Kind.OFF_DIAGONAL}
    kinds |= {_KIND_OF[name] for name in always if name in _KIND_OF}
    return tuple(name for name in missing if _KIND_OF[name] in kinds)


def correct(raw: ArrayLike, u: ArrayLike, calibration: Calibration) -> FloatArray:
    """Corrected field, mGauss, as the autopilot computes it.

    Parameters
    ----------
    raw
        Sensor field in body axes, mGauss, shape (..., 3).
    u
        Control quantity in the unit of ``calibration.compensation``, shape (...).
    """
    rows = np.asarray(raw, float)
    made = in_force(calibration).correction.apply(rows.reshape(-1, 3), np.ravel(u))
    return made.reshape(rows.shape)
