"""What a recording's .json says about its vehicle, and what parameters leave of heading error.

Everything here is computed from the truth and from parameters alone, the way the
autopilot would use them (docs/autopilots.md, ArduPilot: correction); nothing of
magcomp's fits or judges is used.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from magcomp.autopilots import ardupilot
from magcomp.earth import expected_field
from magcomp.geometry import body_from_earth, heading, wrap_angle

FIXTURES = Path(__file__).parents[1] / "sitl_fixtures"
REAL = Path(__file__).parents[2] / "shared" / "real"

TILT_RAD = np.radians(20.0)
TILTS = ((0.0, 0.0), (TILT_RAD, 0.0), (-TILT_RAD, 0.0), (0.0, TILT_RAD), (0.0, -TILT_RAD))
YAWS = np.radians(np.arange(0.0, 360.0, 2.0))

FULL_THROTTLE_A, IDLE_A = 120.0, 0.6
"""sweep_throttle_only: unseen current = 120 A · throttle + 0.6 (recordings README)."""

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Truth:
    """A vehicle as it really was: raw = D⁻¹ · (field + interference · amperes) − OFS."""

    interference: FloatArray
    offset: Mapping[int, FloatArray]
    soft_iron: Mapping[int, FloatArray]
    earth: FloatArray
    declination: float

    def raw(self, compass: int, field: FloatArray, amperes: float) -> FloatArray:
        """What the sensor says of body-axes fields, mGauss, shape (n, 3)."""
        disturbed = field + amperes * self.interference
        return disturbed @ np.linalg.inv(self.soft_iron[compass]).T - self.offset[compass]


def of_document(document: Mapping, unix_s: float) -> Truth:
    """The truth of a .json of sitl_fixtures/ or of magcomp.simulate."""
    earth = expected_field(*document["home"], unix_s)
    compasses = dict(enumerate(document["compass"], start=1))
    return Truth(
        interference=np.array(document["mot_mgauss_per_amp"]),
        offset={n: np.array(c["ofs"]) for n, c in compasses.items()},
        soft_iron={n: ardupilot.soft_iron_matrix(c["dia"], c["odi"]) for n, c in compasses.items()},
        earth=earth.ned,
        declination=earth.declination,
    )


def of_fixture(name: str, unix_s: float) -> Truth:
    """The truth of a recording in sitl_fixtures/."""
    return of_document(json.loads((FIXTURES / f"{name}.json").read_text()), unix_s)


def unseen_current(throttle: float) -> float:
    """Amperes that flow in sweep_throttle_only, which has no battery monitor."""
    return FULL_THROTTLE_A * throttle + IDLE_A


def heading_error_deg(
    truth: Truth, parameters: Mapping[str, float], compass: int, amperes: float, u: float
) -> float:
    """Largest heading error over all yaws, level and tilted 20° four ways, degrees.

    Parameters
    ----------
    parameters
        Names and values as they would be in the autopilot.
    amperes, u
        The current that flows, and what the autopilot multiplies COMPASS_MOT by.
    """
    calibration = ardupilot.calibration(parameters, compass)
    worst = 0.0
    for roll, pitch in TILTS:
        field = body_from_earth(roll, pitch, YAWS) @ truth.earth
        raw = truth.raw(compass, field, amperes)
        corrected = ardupilot.correct(raw, np.full(len(raw), u), calibration)
        found = heading(corrected, roll, pitch, truth.declination)
        worst = max(worst, float(np.abs(wrap_angle(found - YAWS)).max()))
    return float(np.degrees(worst))
