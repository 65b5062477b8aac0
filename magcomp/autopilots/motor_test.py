"""How a firmware spins motors on the ground: one command a motor, with a time-out of its own.

docs/autopilots.md, ArduPilot: motor test, and PX4: motor test.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

Seven = tuple[float, float, float, float, float, float, float]


@dataclass(frozen=True)
class Command:
    """A command to the vehicle (COMMAND_LONG).

    Attributes
    ----------
    number
        MAV_CMD.
    values
        Its seven parameters.
    """

    number: int
    values: Seven


class MotorTest(Protocol):
    """What magcomp must know of a firmware's motor test."""

    @property
    def number(self) -> int:
        """MAV_CMD that it is asked for with."""
        ...

    @property
    def looks_armed(self) -> bool:
        """Whether the heartbeat says armed while a test runs."""
        ...

    @property
    def longest_s(self) -> float:
        """Longest time-out that the firmware grants, seconds."""
        ...

    @property
    def count_name(self) -> str:
        """Parameter that tells the number of motors; empty where only the outputs do."""
        ...

    @property
    def refused_hint(self) -> str:
        """What to look for where it refuses; a clause."""
        ...

    def spin(self, motor: int, share: float, seconds: float) -> Command:
        """Spin a motor, for so many seconds from the command's arrival and no longer.

        Parameters
        ----------
        motor
            From 1, in the firmware's own order.
        share
            Of the output's range, 0 … 1.
        seconds
            Its time-out; at most ``longest_s``.
        """
        ...

    def stop(self, motors: Sequence[int]) -> tuple[Command, ...]:
        """Stop motors that may be spinning, at once."""
        ...


class ArduPilotMotorTest:
    """MAV_CMD_DO_MOTOR_TEST: place, 0 for per cent, per cent, seconds, 0 for one motor alone."""

    number = 209
    looks_armed = True
    longest_s = 600.0
    count_name = ""
    refused_hint = "is it landed, the safety switch pressed, and its radio control calibrated?"

    def spin(self, motor: int, share: float, seconds: float) -> Command:
        """Older firmware takes whole per cent only.

        Examples
        --------
        >>> ArduPilotMotorTest().spin(2, 0.3, 1.0).values
        (2.0, 0.0, 30.0, 1.0, 0.0, 0.0, 0.0)
        """
        per_cent = float(round(100 * share))
        return Command(self.number, (float(motor), 0.0, per_cent, seconds, 0.0, 0.0, 0.0))

    def stop(self, motors: Sequence[int]) -> tuple[Command, ...]:
        """One test serves all motors: a time-out of 0 ends it."""
        return (self.spin(motors[0] if motors else 1, 0.0, 0.0),)


class Px4MotorTest:
    """MAV_CMD_ACTUATOR_TEST: value, seconds, and the motor's function in the fifth place."""

    number = 310
    looks_armed = False
    longest_s = 3.0
    count_name = "CA_ROTOR_COUNT"
    refused_hint = "is it disarmed, its safety off, and COM_MOT_TEST_EN 1?"

    def spin(self, motor: int, share: float, seconds: float) -> Command:
        """A value of 0 would spin it slowly.

        Examples
        --------
        >>> Px4MotorTest().spin(2, 0.3, 1.0).values
        (0.3, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0)
        """
        return Command(self.number, (share, seconds, 0.0, 0.0, float(motor), 0.0, 0.0))

    def stop(self, motors: Sequence[int]) -> tuple[Command, ...]:
        """Each motor is given back on its own."""
        return tuple(self.spin(motor, math.nan, 0.0) for motor in motors)
