"""When and where a simulated vehicle is: what every firmware's telemetry is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from magcomp.simulate.physics import Block

FloatArray = NDArray[np.float64]

_METRES_PER_DEGREE = 111_319.5


@dataclass(frozen=True, eq=False)
class Moment:
    """One step of the physics.

    Attributes
    ----------
    time, boot_s, unix_s
        Seconds since power-up, since boot and since 1970.
    block, step
        The physics, and which of its ten steps.
    home
        Latitude and longitude in degrees, metres above sea level.
    """

    time: float
    boot_s: float
    unix_s: float
    block: Block
    step: int
    home: tuple[float, float, float]

    @property
    def boot_ms(self) -> int:
        """Milliseconds since boot."""
        return round(self.boot_s * 1e3)

    @property
    def boot_us(self) -> int:
        """Microseconds since boot."""
        return round(self.boot_s * 1e6)

    @property
    def position(self) -> FloatArray:
        """Metres north, east and down from home, shape (3,)."""
        return np.asarray(self.block.motion.position[self.step])

    @property
    def velocity(self) -> FloatArray:
        """North, east and down, m/s, shape (3,)."""
        return np.asarray(self.block.motion.velocity[self.step])

    @property
    def throttle(self) -> float:
        """Thrust that the programme's pilot demands, 0 … 1."""
        return float(self.block.motion.throttle[self.step])

    def geodetic(self) -> tuple[int, int, float]:
        """Latitude and longitude in 1e-7 degrees, metres above sea level."""
        north, east, down = self.position
        latitude, longitude, altitude = self.home
        east_degree = _METRES_PER_DEGREE * np.cos(np.radians(latitude))
        return (
            round((latitude + north / _METRES_PER_DEGREE) * 1e7),
            round((longitude + east / east_degree) * 1e7),
            altitude - down,
        )
