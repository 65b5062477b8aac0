"""ArduPilot's compass correction, forward and backward, and the names it goes by.

The order inside the autopilot (AP_Compass, checked against ArduCopter 4.6.3)::

    corrected = D · (s · (raw + OFS)) + MOT · u

Fields on the link are *corrected* fields of compass priority 1, 2, 3, in body
axes, mGauss, truncated to whole numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from magcomp.errors import ParameterFileError
from magcomp.model import CURRENT, THROTTLE, Correction, InForce, ParameterHistory

FloatArray = NDArray[np.float64]

SCALE_LIMIT = 1.5
"""COMPASS_SCALE is in force only between 1/1.5 and 1.5."""

OFFSETS_MAX_DEFAULT = 1800.0
"""Arming needs every |OFS| at or under COMPASS_OFFS_MAX."""

COMPASS_COUNT = 3

COMPENSATION_SWITCH = "COMPASS_MOTCT"

_AXES = ("X", "Y", "Z")
# All that act on a reading, in alphabetical order. Asked for by name: a log may hold any number of
# others.
_COMPASS_NAMES = tuple(
    sorted(
        [
            *(
                f"COMPASS_{kind}{number}_{axis}"
                for kind in ("OFS", "DIA", "ODI", "MOT")
                for number in ("", "2", "3")
                for axis in _AXES
            ),
            *(
                f"COMPASS_{kind}{number}"
                for kind in ("SCALE", "DEV_ID")
                for number in ("", "2", "3")
            ),
            "COMPASS_MOTCT",
            "COMPASS_PMOT_EN",
        ]
    )
)


class MotorCompensation(IntEnum):
    """COMPASS_MOTCT: one switch for all compasses, and what u is."""

    OFF = 0
    THROTTLE = 1
    CURRENT = 2


COMPENSATION_OF = {CURRENT: MotorCompensation.CURRENT, THROTTLE: MotorCompensation.THROTTLE}
"""COMPASS_MOTCT that makes the autopilot multiply by a control quantity."""

_REGRESSOR_OF = {switch: kind for kind, switch in COMPENSATION_OF.items()}


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


def suffix(compass: int) -> str:
    """Number in a parameter's name: compass 1 has none."""
    return "" if compass == 1 else str(compass)


def vector_names(kind: str, compass: int) -> tuple[str, str, str]:
    """Three names of a vector, for example COMPASS_MOT2_X, _Y, _Z.

    Parameters
    ----------
    kind
        ``"OFS"``, ``"DIA"``, ``"ODI"`` or ``"MOT"``.
    """
    x, y, z = (f"COMPASS_{kind}{suffix(compass)}_{axis}" for axis in _AXES)
    return x, y, z


def soft_iron_matrix(diagonal: ArrayLike, off_diagonal: ArrayLike) -> FloatArray:
    """D from COMPASS_DIA and COMPASS_ODI, shape (3, 3); the identity where DIA is all zero."""
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


def unseen_names(parameters: ParameterHistory, compass: int) -> tuple[str, ...]:
    """Parameters that act on a compass and were never reported, in the order of the firmware.

    Notes
    -----
    Every firmware has COMPASS_OFS, COMPASS_MOT and COMPASS_MOTCT. Those without soft iron have
    neither COMPASS_DIA nor COMPASS_ODI; one of them alone is a list with a gap.
    """
    soft_iron = (*vector_names("DIA", compass), *vector_names("ODI", compass))
    wanted = [*vector_names("OFS", compass), *vector_names("MOT", compass), COMPENSATION_SWITCH]
    if any(name in parameters.names for name in soft_iron):
        wanted += soft_iron
    return tuple(name for name in wanted if name not in parameters.names)


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
        **vector_parameters("MOT", compass, correction.motor),
    }


def calibration(values: Mapping[str, float], compass: int) -> Calibration:
    """Calibration of one compass; names not among ``values`` have the firmware's defaults."""

    def vector(kind: str) -> FloatArray:
        return np.array([values.get(name, 0.0) for name in vector_names(kind, compass)])

    scale = values.get(f"COMPASS_SCALE{suffix(compass)}", 1.0)
    kind = values.get("COMPASS_MOTCT", 0.0)
    compensation = MotorCompensation(int(kind)) if kind in (0.0, 1.0, 2.0) else MotorCompensation(0)
    off = compensation is MotorCompensation.OFF
    return Calibration(
        offset=vector("OFS"),
        soft_iron=soft_iron_matrix(vector("DIA"), vector("ODI")),
        scale=scale if 1 / SCALE_LIMIT <= scale <= SCALE_LIMIT else 1.0,
        motor=np.zeros(3) if off else vector("MOT"),
        compensation=compensation,
    )


def calibration_at(parameters: ParameterHistory, compass: int, time: float) -> Calibration:
    """Calibration of one compass in force at a time.

    Raises
    ------
    ParameterFileError
        Where a compass parameter of the log is not a finite number.
    """
    values = {}
    for name in _COMPASS_NAMES:
        if not parameters.of(name):
            continue
        value = parameters.at(name, time, 0.0)
        if not np.isfinite(value):
            raise ParameterFileError(
                f"{name} must be a finite number; instead the log holds {value} at {time:.1f} s"
            )
        values[name] = value
    return calibration(values, compass)


def calibration_changes(parameters: ParameterHistory) -> tuple[float, ...]:
    """Times at which any parameter that acts on a compass reading changed its value."""
    times: set[float] = set()
    for name in _COMPASS_NAMES:
        reports = parameters.of(name)
        times.update(
            later.time
            for earlier, later in itertools.pairwise(reports)
            if later.value != earlier.value
        )
    return tuple(sorted(times))


def correct(raw: ArrayLike, u: ArrayLike, calibration: Calibration) -> FloatArray:
    """Corrected field, mGauss, as the autopilot computes it.

    Parameters
    ----------
    raw
        Sensor field in body axes, mGauss, shape (..., 3).
    u
        Control quantity in the unit of ``calibration.compensation``, shape (...).
    """
    linear = calibration.scale * (np.asarray(raw, float) + calibration.offset)
    motor = np.multiply.outer(np.asarray(u, float), calibration.motor)
    return np.asarray(linear @ calibration.soft_iron.T + motor)


def uncorrect(corrected: ArrayLike, u: ArrayLike, calibration: Calibration) -> FloatArray:
    """Sensor field from a corrected one: the inverse of :func:`correct`."""
    motor = np.multiply.outer(np.asarray(u, float), calibration.motor)
    linear = np.linalg.solve(
        calibration.soft_iron, (np.asarray(corrected, float) - motor)[..., None]
    )
    return np.asarray(linear[..., 0] / calibration.scale - calibration.offset)
