"""A correction from the autopilot's own parameters."""

from __future__ import annotations

from collections.abc import Mapping

from magcomp.autopilots import ardupilot
from magcomp.model import InForce


def from_parameters(values: Mapping[str, float], compass: int) -> InForce:
    """What ArduPilot does to one compass with given parameters.

    Parameters
    ----------
    values
        Name to value; names that are missing have the firmware's defaults.
    compass
        1, 2 or 3.
    """
    return ardupilot.in_force(ardupilot.calibration(values, compass))
