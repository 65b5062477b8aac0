"""A simulated vehicle on a UDP port, in a thread, for tests of everything that is live."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from magcomp.simulate import Faults, FaultyLink, Machine, Vehicle, run, scenario
from magcomp.simulate.transports import open_transport

PATIENCE_S = 300.0
RATES = {
    **dict.fromkeys(("RAW_IMU", "SCALED_IMU2", "SCALED_IMU3", "BATTERY_STATUS"), 10.0),
    "ATTITUDE": 20.0,
    "VFR_HUD": 5.0,
    "SYS_STATUS": 2.0,
    "GLOBAL_POSITION_INT": 2.0,
}
"""A third of the usual: enough for a fit, and less to simulate."""

AFTERWARDS = 1.0
"""Speed of a vehicle that has landed: what it says in vain would only cost time."""


@dataclass(frozen=True)
class Flown:
    """A vehicle that lives.

    Attributes
    ----------
    address
        What a ground station has to be given.
    vehicle
        To look into: its parameters, its truth.
    """

    address: str
    vehicle: Vehicle


class Haste:
    """A clock that runs fast while a vehicle carries out its programme."""

    def __init__(self, vehicle: Vehicle, speed: float) -> None:
        self._vehicle, self._speed = vehicle, speed
        self._slower = speed if vehicle.program_over else min(speed, AFTERWARDS)
        self._looked, self._now = time.monotonic(), 0.0

    def __call__(self) -> float:
        looked = time.monotonic()
        speed = self._slower if self._vehicle.program_over else self._speed
        self._now += (looked - self._looked) * speed
        self._looked = looked
        return self._now


@contextlib.contextmanager
def alive(
    program: str = "flight",
    *,
    seed: int = 4,
    speed: float = 10.0,
    faults: Faults | None = None,
    wrap: Callable[[Machine], Machine] = lambda machine: machine,
    vehicle: Vehicle | None = None,
    port: int | None = None,
    **options: object,
) -> Iterator[Flown]:
    """Let a vehicle live while the block runs; ``options`` are those of `Vehicle`."""
    vehicle = vehicle or Vehicle(scenario(program, seed), **{"wait_for_ground": True, **options})
    machine = wrap(vehicle if faults is None else FaultyLink(vehicle, faults))
    port, stop = port or free_port(), threading.Event()
    with contextlib.closing(open_transport(f"udpout:127.0.0.1:{port}")) as transport:
        thread = threading.Thread(
            target=run,
            args=(machine, transport, stop),
            kwargs={"clock": Haste(vehicle, speed), "begin": vehicle.time},
        )
        thread.start()
        try:
            yield Flown(f"udp:127.0.0.1:{port}", vehicle)
        finally:
            stop.set()
            thread.join()


def landed(*, seed: int = 4, **options: object) -> Vehicle:
    """A vehicle whose programme is over: disarmed, and so it stays."""
    vehicle = Vehicle(scenario("sweep", seed), **options)
    vehicle.advance(vehicle.duration_s + 5.0)
    return vehicle


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


_VALUES = {"MOT": -1.5, "OFS": 40.0, "DIA": 1.0, "ODI": 0.015625}

COMPENSATION = {
    **{
        f"COMPASS_{kind}{'' if compass == 1 else compass}_{axis}": value + 0.125 * compass
        for compass in (1, 2, 3)
        for kind, value in _VALUES.items()
        for axis in "XYZ"
    },
    "COMPASS_MOTCT": 2.0,
}
"""A whole calibration of three compasses: 36 values and the switch, each exact as float32."""


def held(vehicle: Vehicle) -> dict[str, float]:
    """What the vehicle holds of `COMPENSATION`'s names."""
    return {name: vehicle.parameters[name] for name in COMPENSATION}
