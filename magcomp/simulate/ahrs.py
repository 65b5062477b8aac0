"""The autopilot's own belief about its attitude.

Roll and pitch are the truth with a slowly wandering tilt error. Heading is
gyro and corrected compass fused, so that an interference the autopilot does not
know turns its heading, as in the air.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from magcomp import geometry
from magcomp.simulate.motion import euler, rotation

FloatArray = NDArray[np.float64]

_TILT_ERROR = np.radians(0.15)
_TILT_KEEP = np.exp(-0.1 / 20.0)
_HEADING_GAIN = 0.05
_LEAST_LEVEL_FIELD = 0.2
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Ahrs:
    """Errors of the estimated attitude.

    Attributes
    ----------
    tilt
        Small rotation about north and east, radians, shape (2,).
    heading_error
        Estimated less true heading, radians; None until the first reading.
    """

    tilt: FloatArray
    heading_error: float | None = None

    def attitude(self, earth_from_body: FloatArray) -> FloatArray:
        """Estimated roll, pitch and yaw, radians, shape (n, 3)."""
        estimate = euler(self._tilted @ earth_from_body)
        estimate[..., 2] = geometry.wrap_angle(estimate[..., 2] + (self.heading_error or 0.0))
        return estimate

    @cached_property
    def _tilted(self) -> FloatArray:
        """The tilt error as a rotation, (3, 3)."""
        north, east = self.tilt
        angle = float(np.hypot(north, east))
        axis = np.array([north / angle, east / angle, 0.0]) if angle else _UP
        return rotation(axis, np.asarray(angle))

    def updated(
        self,
        corrected: FloatArray,
        earth_from_body: FloatArray,
        declination: float,
        rng: np.random.Generator,
    ) -> Ahrs:
        """Belief after one compass reading.

        Parameters
        ----------
        corrected
            The reading of the first compass, mGauss, shape (3,).
        earth_from_body
            True attitude when it was made, shape (3, 3).
        declination
            Radians.
        """
        tilt = self.tilt * _TILT_KEEP
        tilt = tilt + rng.normal(scale=_TILT_ERROR * np.sqrt(1 - _TILT_KEEP**2), size=2)
        roll, pitch, yaw = self.attitude(earth_from_body)
        level = geometry.level_matrix(roll, pitch) @ corrected
        if np.hypot(level[0], level[1]) < _LEAST_LEVEL_FIELD * np.linalg.norm(level):
            return replace(self, tilt=tilt)
        measured = geometry.heading(corrected, roll, pitch, declination)
        innovation = float(geometry.wrap_angle(measured - yaw))
        if self.heading_error is None:
            return Ahrs(tilt, innovation)
        error = float(geometry.wrap_angle(self.heading_error + _HEADING_GAIN * innovation))
        return Ahrs(tilt, error)
