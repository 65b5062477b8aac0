from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.simulate import Machine, Vehicle, scenario
from magcomp.simulate.ground import Asker


class Ground:
    """A ground station with a virtual clock: says something, lets time pass, hears the answers."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.time = 0.0
        self.asker = Asker()
        self._codec = mavlink.MAVLink(None)

    def say(self, message: Any) -> None:
        self.machine.receive(self.asker.pack(message), self.time)

    def wait(self, seconds: float) -> list[Any]:
        self.time += seconds
        return [self._codec.decode(bytearray(f.data)) for f in self.machine.advance(self.time)]

    def hear(self, kind: str, seconds: float) -> list[Any]:
        return [m for m in self.wait(seconds) if m.get_type() == kind]

    def ask(self, message: Any, kind: str, seconds: float = 0.1) -> list[Any]:
        self.say(message)
        return self.hear(kind, seconds)

    def command(self, number: int, *values: float) -> list[Any]:
        """Send a command; everything heard within a tenth of a second."""
        self.machine.receive(self.asker.command(number, *values), self.time)
        return self.wait(0.1)

    def set(self, name: str, value: float) -> list[tuple[str, float, int]]:
        message = mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, 9)
        return [
            (m.param_id, m.param_value, m.param_index) for m in self.ask(message, "PARAM_VALUE")
        ]

    def read(self, name: str) -> list[Any]:
        message = mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1)
        return self.ask(message, "PARAM_VALUE")


@pytest.fixture
def on_ground() -> Callable[..., Ground]:
    """Makes a ground station that talks to a fresh vehicle lying still and disarmed."""

    def make(program: str = "sweep", seed: int = 1, **options: Any) -> Ground:
        vehicle = Vehicle(scenario(program, seed), wait_for_ground=False, **options)
        ground = Ground(vehicle)
        ground.wait(1.0)
        return ground

    return make
