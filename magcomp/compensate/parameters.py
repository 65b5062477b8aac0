"""A correction from the autopilot's own parameters."""

from __future__ import annotations

from collections.abc import Mapping

from magcomp.autopilot import ardupilot
from magcomp.model import CURRENT, THROTTLE, Correction, InForce

_REGRESSORS = {
    ardupilot.MotorCompensation.OFF: None,
    ardupilot.MotorCompensation.THROTTLE: THROTTLE,
    ardupilot.MotorCompensation.CURRENT: CURRENT,
}


def from_parameters(values: Mapping[str, float], compass: int) -> InForce:
    """What ArduPilot does to one compass with given parameters.

    Parameters
    ----------
    values
        Name to value; names that are missing have the firmware's defaults.
    compass
        1, 2 or 3.
    """
    calibration = ardupilot.calibration(values, compass)
    correction = Correction(
        offset=calibration.offset,
        soft_iron=calibration.scale * calibration.soft_iron,
        motor=calibration.motor,
    )
    return InForce(correction, _REGRESSORS[calibration.compensation])
