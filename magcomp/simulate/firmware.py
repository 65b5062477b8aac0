"""What a simulated vehicle needs of its autopilot, whatever the make."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from magcomp.earth import EarthField
from magcomp.simulate.habits import Habits
from magcomp.simulate.moment import FloatArray, Moment
from magcomp.simulate.talker import Talker
from magcomp.simulate.truth import Truth


@dataclass(frozen=True, eq=False)
class Board:
    """What an autopilot is put into.

    Attributes
    ----------
    truth
        The vehicle.
    parameters
        What differs from the parameters the truth gives it.
    field
        The earth's field where it lives.
    rng
        Of its sensors' noise and its attitude's errors.
    system
        MAVLink system number.
    habits
        What it is and does besides.
    answers_errors
        Send PARAM_ERROR where the firmware is silent, as newer firmware does.
    """

    truth: Truth
    parameters: Mapping[str, float]
    field: EarthField
    rng: np.random.Generator
    system: int
    habits: Habits
    answers_errors: bool


class Firmware(Protocol):
    """An autopilot in a vehicle: feels the physics, speaks, remembers."""

    @property
    def talker(self) -> Talker:
        """Its side of the link."""
        ...

    @property
    def parameters(self) -> Mapping[str, float]:
        """What it holds, hidden ones too."""
        ...

    @property
    def heading_error(self) -> float:
        """How far its heading is off the true one, radians."""
        ...

    def truth(self) -> Mapping[str, Any]:
        """What the vehicle really is, in the form of the .json beside a recording of its make."""
        ...

    @property
    def spinning(self) -> tuple[int, ...]:
        """The motors that a motor test drives at this moment, counted from 1."""
        ...

    def tested(self) -> FloatArray | None:
        """Thrust of each motor, 0 … 1, shape (4,), while a motor test runs; else None."""
        ...

    def fly(self, mode: int) -> None:
        """Take a flight mode, by ArduCopter's number, and arm."""
        ...

    def sense(self, moment: Moment) -> None:
        """Feel one step of the physics; called at each."""
        ...

    def speak(self, moment: Moment) -> None:
        """Put what is to be said at a step into ``talker.outgoing``; called at each after boot."""
        ...

    def reboot(self, time: float) -> None:
        """Restart at ``time``, seconds since power-up: stored parameters are kept."""
        ...
