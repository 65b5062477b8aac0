"""The three compasses of a simulated PX4: two in the flight controller, one outside and turned."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from magcomp.autopilots.px4_correction import MGAUSS, Calibration, Compensation, sensor_calibration
from magcomp.autopilots.px4_rotation import sensor_to_body
from magcomp.earth import EarthField
from magcomp.model import Correction
from magcomp.simulate.truth import Truth

FloatArray = NDArray[np.float64]

DEVICE_IDS = (197388, 197644, 197902)
"""Of firmware in simulation: two internal compasses and an external one."""

EXTERNAL_ROTATION = 10.0
"""CAL_MAGn_ROT of the last: rolled by 180°, then yawed by 90°."""

NOISE = 0.004
"""Of one reading, gauss."""

_CURRENTS = (0.0, 50.0)
"""Over which a correction is to hold, A."""

_OUTSIDE = {"CAL_MAG0_ROT": EXTERNAL_ROTATION}


@lru_cache
def rotation_of(number: int) -> FloatArray:
    """How compass 1, 2 or 3 is mounted: from its axes into the vehicle's, shape (3, 3)."""
    return sensor_to_body(_OUTSIDE if number == len(DEVICE_IDS) else {}, 1)


def readings(truth: Truth, field: FloatArray, rng: np.random.Generator) -> FloatArray:
    """What the sensors say, gauss, in their own axes, shape (n, 3, 3): one row a compass.

    Parameters
    ----------
    field
        In body axes, with the interference, mGauss, shape (n, 3).
    """
    exactly = [
        compass.raw(field) @ rotation_of(number) / MGAUSS
        for number, compass in enumerate(truth.compasses, start=1)
    ]
    said = np.stack(exactly, axis=1)
    return np.asarray(said + rng.normal(scale=NOISE, size=said.shape))


def exact(truth: Truth, number: int) -> Calibration:
    """The calibration that undoes a compass and the motors exactly, for P in kiloampere."""
    return _calibration(truth, number, -truth.interference)


def started(truth: Truth, number: int) -> Calibration:
    """The calibration that a compass has when the vehicle is switched on."""
    motor = np.zeros(3) if truth.start_motor is None else truth.start_motor
    if truth.calibrated:
        return _calibration(truth, number, motor)
    plain = Correction(truth.start_offset, np.eye(3), motor)
    return sensor_calibration(plain, rotation_of(number), Compensation.CURRENT_0)


def _calibration(truth: Truth, number: int, motor: FloatArray) -> Calibration:
    compass = truth.compasses[number - 1]
    whole = Correction(compass.offset, compass.soft_iron, motor)
    return sensor_calibration(whole, rotation_of(number), Compensation.CURRENT_0)


def as_json(truth: Truth, earth: EarthField) -> dict[str, Any]:
    """The truth in the form of the .json beside a PX4 recording."""
    compasses = []
    for number, device in enumerate(DEVICE_IDS, start=1):
        found = exact(truth, number)
        compasses.append(
            {
                "device_id": device,
                "exact_COMP": found.motor.tolist(),
                "exact_OFF": found.offset.tolist(),
                "exact_SCALE": found.scale.tolist(),
                "exact_ODIAG": found.off_diagonal.tolist(),
                "rotation_sensor_to_body": rotation_of(number).tolist(),
                "noise_gauss": NOISE,
            }
        )
    return {
        **truth.as_json(),
        "interference_follows": "current",
        "current_A": list(_CURRENTS),
        "earth_ned_gauss": (earth.ned / MGAUSS).tolist(),
        "declination_deg": float(np.degrees(earth.declination)),
        "magnetometers": compasses,
    }
