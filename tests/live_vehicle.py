"""A simulated vehicle on a UDP port, in a thread, for tests of everything that is live."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

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
    """A clock that runs fast while a vehicle flies for somebody, and waits for who reads.

    It stands while the reader has not taken what was sent: a vehicle in lock-step with its reader
    loses nothing on a busy machine. One that flies for the ground is no faster than ours until
    its readings are asked for, so that it does not fly away while it is found.
    """

    def __init__(self, vehicle: Vehicle, port: int, speed: float, *, for_ground: bool) -> None:
        self._vehicle, self._speed, self._for_ground = vehicle, speed, for_ground
        self._slower = speed if vehicle.program_over else min(speed, AFTERWARDS)
        self._reader = Reader(port)
        self._looked, self._now = time.monotonic(), 0.0

    def __call__(self) -> float:
        looked = time.monotonic()
        hurries = self._is_read() and not self._vehicle.program_over
        if not self._reader.lags():
            self._now += (looked - self._looked) * (self._speed if hurries else self._slower)
        self._looked = looked
        return self._now

    def _is_read(self) -> bool:
        talker = self._vehicle.firmware.talker
        asked_for = any(talker.schedule.interval_us(message) > 0 for message in talker.telemetry)
        return asked_for or not self._for_ground


class Reader:
    """Who listens at a UDP port of this computer, as far as the system tells."""

    _TABLE = Path("/proc/net/udp")

    def __init__(self, port: int) -> None:
        self._local = f"0100007F:{port:04X}"

    def lags(self) -> bool:
        """Whether something waits there to be read; False where the system does not tell."""
        if not self._TABLE.exists():
            return False
        rows = (row.split() for row in self._TABLE.read_text(encoding="ascii").splitlines()[1:])
        queues = [row[4] for row in rows if row[1] == self._local]
        return any(int(queue.partition(":")[2], 16) for queue in queues)


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
    options = {"wait_for_ground": True, **options}
    vehicle = vehicle or Vehicle(scenario(program, seed), **options)
    machine = wrap(vehicle if faults is None else FaultyLink(vehicle, faults))
    port, stop = port or free_port(), threading.Event()
    haste = Haste(vehicle, port, speed, for_ground=bool(options["wait_for_ground"]))
    with contextlib.closing(open_transport(f"udpout:127.0.0.1:{port}")) as transport:
        thread = threading.Thread(
            target=run,
            args=(machine, transport, stop),
            kwargs={"clock": haste, "begin": vehicle.time},
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
