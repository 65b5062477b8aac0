"""PX4's actuator test: what MAV_CMD_ACTUATOR_TEST does to the motors. No messages, no clock.

The rules (docs/autopilots.md, PX4: motor test):

- Denied while armed, and where COM_MOT_TEST_EN is 0. The heartbeat stays disarmed.
- Each motor is asked for on its own; one time-out, begun anew with each command, serves them all,
  and it is cut at 3 s.
- 0 s gives a motor back; NaN lets it stand still.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from magcomp.simulate.truth import MOTORS

FloatArray = NDArray[np.float64]

_LONGEST_S = 3.0


class ActuatorTest:
    """The state of an actuator test.

    Attributes
    ----------
    thrust
        What each motor is asked for, 0 … 1, shape (4,).
    """

    def __init__(self) -> None:
        self.thrust = np.zeros(MOTORS)
        self._ends_s = -math.inf

    @property
    def running(self) -> bool:
        """Whether a motor is driven."""
        return bool(self.thrust.any())

    def command(self, motor: int, value: float, seconds: float, now_s: float) -> bool:
        """Take a command; whether it is one."""
        if not 1 <= motor <= MOTORS or not (math.isnan(value) or -1.0 <= value <= 1.0):
            return False
        stands_still = math.isnan(value) or value < 0.0 or seconds <= 0.0
        self.thrust = self.thrust.copy()
        self.thrust[motor - 1] = 0.0 if stands_still else value
        if seconds > 0.0:
            self._ends_s = now_s + min(seconds, _LONGEST_S)
        return True

    def advance(self, now_s: float) -> None:
        """Let time pass; called every 10 ms."""
        if self.running and now_s >= self._ends_s:
            self.thrust = np.zeros(MOTORS)
