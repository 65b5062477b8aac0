"""What would be written to a vehicle, and the vehicle it belongs to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from magcomp.model.recording import Vehicle


@dataclass(frozen=True)
class ParameterSet:
    """Names and float32 values for one vehicle.

    Attributes
    ----------
    values
        Parameter name to value; each value is exactly representable as float32.
    vehicle
        Whose parameters these are; None where a file does not say.
    comments
        Lines for people that stand at the head of a file, without comment signs.
    warnings
        Sentences on what a file leaves in doubt, without a full stop.
    """

    values: Mapping[str, float]
    vehicle: Vehicle | None = None
    comments: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
