"""The words in which a firmware is described: what a name is, a reading, a lag, an output."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from magcomp.model import Correction, FloatArray


class Kind(IntEnum):
    """What a compass parameter is, in the order in which a table shows them."""

    SWITCH = 0
    MOTOR = 1
    OFFSET = 2
    DIAGONAL = 3
    OFF_DIAGONAL = 4
    SCALE = 5
    PER_MOTOR = 6
    DEVICE = 7
    SETTING = 8

    @property
    def is_value(self) -> bool:
        """A calibration value: written, and not a switch."""
        return Kind.MOTOR <= self <= Kind.PER_MOTOR


@dataclass(frozen=True)
class ParameterName:
    """A compass parameter's name, taken apart.

    Attributes
    ----------
    kind
        What it is.
    compass
        1, 2, …; 0 where it serves all compasses.
    vector
        The name without its axis.
    axis
        ``"X"``, ``"Y"`` or ``"Z"``; empty where it is no part of a vector.
    """

    kind: Kind
    compass: int
    vector: str
    axis: str = ""


@dataclass(frozen=True)
class FieldMeaning:
    """What a source's compass readings are.

    Attributes
    ----------
    truncated
        Cut towards zero to whole mGauss.
    applied_later_s
        The firmware corrects a reading with a control quantity this much older than what
        disturbed it, seconds.
    """

    truncated: bool
    applied_later_s: float


@dataclass(frozen=True)
class LagPrior:
    """What is known of a lag before a recording is looked at, seconds.

    Attributes
    ----------
    mean, width
        Expected value, and its standard error.
    """

    mean: float
    width: float


@dataclass(frozen=True)
class LagPriors:
    """Lags of the field behind the attitude and of the control quantity behind the field."""

    field: LagPrior
    regressor: LagPrior


@dataclass(frozen=True)
class ThrustCurve:
    """How a firmware turns thrust demand into a motor's duty.

    Attributes
    ----------
    expo
        −1 … 1: thrust = (1 − expo) · c + expo · c².
    spin_min, spin_max
        Duty at c = 0 and c = 1.
    """

    expo: float
    spin_min: float
    spin_max: float

    def thrust(self, duty: FloatArray) -> FloatArray:
        """Thrust demand 0 … 1 of motors with a duty, any shape.

        Examples
        --------
        >>> ThrustCurve(expo=0.0, spin_min=0.1, spin_max=0.9).thrust(np.array([0.1, 0.5, 0.9]))
        array([0. , 0.5, 1. ])
        """
        curve = np.clip((duty - self.spin_min) / (self.spin_max - self.spin_min), 0.0, 1.0)
        return np.asarray((1 - self.expo) * curve + self.expo * curve**2)


@dataclass(frozen=True)
class MotorOutputs:
    """Which servo outputs drive motors, and what they mean.

    Attributes
    ----------
    channels
        Indices into the outputs.
    low, high
        Microseconds of duty 0 and 1.
    curve
        From thrust demand to duty; None where unknown.
    numbers
        The motor that each channel drives, as the firmware counts them, from 1.
    pushers
        Indices of the outputs that drive a plane forward.
    named
        Whether parameters say so; else these are the channels that usually do.
    """

    channels: tuple[int, ...]
    low: float
    high: float
    curve: ThrustCurve | None
    numbers: tuple[int, ...] = ()
    pushers: tuple[int, ...] = ()
    named: bool = False


@dataclass(frozen=True)
class MotorLaw:
    """How a firmware corrects motor by motor: Σ vector · (duty · volts) to the power of exponent.

    Attributes
    ----------
    numbers
        The motors it has vectors for.
    most_exponent
        The largest exponent that it takes.
    """

    numbers: tuple[int, ...]
    most_exponent: float


@dataclass(frozen=True, eq=False)
class Leeway:
    """How a firmware that cannot take a correction over as it is should miss it.

    Attributes
    ----------
    likely
        What to come near then: the most probable correction where the calibration in force may
        well be right.
    turning
        What it costs: a deviation d of the 12 parameters of :func:`magcomp.model.pack` turns the
        heading by d · turning · d, mean square in radians² over all headings and the control
        quantities flown, shape (12, 12).
    """

    likely: Correction
    turning: FloatArray
