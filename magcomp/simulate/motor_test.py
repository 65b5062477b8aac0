"""ArduCopter's motor test: what MAV_CMD_DO_MOTOR_TEST does to the outputs. No messages, no clock.

The rules (docs/autopilots.md, ArduPilot: motor test):

- A test begins only on the ground. While one runs, the heartbeat says armed and failsafes are off.
- A command during a test changes it, and begins its time anew.
- A motor that was spun keeps its output until the whole test ends: so several spin together.
- Outputs are driven once a turn of the main loop: of commands that come together, the last counts.
- Motors are counted in the order of the frame's test, clockwise from the front right.
- A count above 1 goes on to the next motor after half the time again with all of them still.
- The end, or a disarming, stops all motors and leaves the vehicle disarmed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from magcomp.simulate.truth import MOTORS

FloatArray = NDArray[np.float64]

_TEST_ORDER = (1, 3, 4, 2)
"""Place in the test's order of motors 1 front right, 2 rear left, 3 front left, 4 rear right."""

_PER_CENT, _PWM = 0, 1
_LONGEST_S = 600.0
_LEAST_PWM, _MOST_PWM = 800.0, 2200.0
_PAUSE = 1.5


class MotorTest:
    """The state of a motor test.

    Parameters
    ----------
    low, high
        MOT_PWM_MIN and MOT_PWM_MAX, microseconds.

    Attributes
    ----------
    running
        Whether a test runs.
    outputs
        What each motor is driven with, microseconds, shape (4,).
    """

    def __init__(self, low: float, high: float) -> None:
        self._low, self._high = low, high
        self.running = False
        self.outputs = np.full(MOTORS, low)
        self._began_s = self._timeout_s = 0.0
        self._place = self._count = self._type = 0
        self._value = 0.0

    def command(self, values: tuple[float, float, float, float, float], now_s: float) -> None:
        """Begin or change the test: place, type of throttle, throttle, time-out and count."""
        place, kind, self._value, timeout_s, count = values
        self._place, self._type, self._count = int(place), int(kind), max(int(count), 1)
        self._began_s, self._timeout_s = now_s, min(timeout_s, _LONGEST_S)
        self.running = True

    def stop(self) -> None:
        """End it; all motors stand still."""
        self.running = False
        self.outputs = np.full(MOTORS, self._low)

    def advance(self, now_s: float) -> None:
        """Let time pass; called every 10 ms."""
        if not self.running:
            return
        elapsed = now_s - self._began_s
        if elapsed < self._timeout_s:
            self._drive()
        elif self._count <= 1:
            self.stop()
        elif elapsed < _PAUSE * self._timeout_s:
            self.outputs = np.full(MOTORS, self._low)
        else:
            self._place, self._count, self._began_s = self._place + 1, self._count - 1, now_s

    def _drive(self) -> None:
        pwm = 0.0
        if self._type == _PER_CENT and self._value <= 100.0:
            pwm = float(int(self._low + (self._high - self._low) * self._value / 100.0))
        elif self._type == _PWM:
            pwm = float(int(self._value))
        if not _LEAST_PWM <= pwm <= _MOST_PWM:
            self.stop()
        elif self._place in _TEST_ORDER:
            self.outputs = self.outputs.copy()
            self.outputs[_TEST_ORDER.index(self._place)] = pwm
