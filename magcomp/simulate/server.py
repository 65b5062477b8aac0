"""A simulated vehicle in real time, or faster, on a real link: the only place with I/O."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable

from magcomp.errors import UsageError
from magcomp.mavlink.splitter import Splitter
from magcomp.simulate.faults import Faults, FaultyLink, Machine
from magcomp.simulate.transports import Transport, open_transport
from magcomp.simulate.vehicle import Vehicle

Clock = Callable[[], float]

_WAIT_S = 0.005
# A machine that cannot keep up must still hear the ground between two stretches of work.
_LONGEST_STRETCH_S = 0.2


def run(
    machine: Machine,
    transport: Transport,
    stop: threading.Event,
    *,
    speed: float = 1.0,
    clock: Clock = time.monotonic,
    begin: float = 0.0,
) -> None:
    """Let a vehicle live on a transport until it is stopped.

    Parameters
    ----------
    machine
        The vehicle, or a bad link to one.
    transport
        Where it is reached.
    stop
        Set from another thread to end.
    speed
        How many times faster than real time.
    clock
        Seconds.
    begin
        The machine's own time, seconds since power-up.
    """
    splitter = Splitter()
    start = clock()
    now = begin
    while not stop.is_set():
        now = min(begin + (clock() - start) * speed, now + _LONGEST_STRETCH_S)
        for frame in machine.advance(now):
            transport.send(frame.data)
        for data in splitter.push(transport.wait(_WAIT_S)):
            machine.receive(data, now)


def serve(
    address: str,
    vehicle: Vehicle,
    *,
    speed: float = 1.0,
    faults: Faults | None = None,
    announce: Callable[[str], None] = lambda _: None,
    stop: threading.Event | None = None,
    clock: Clock = time.monotonic,
) -> None:
    """Offer a simulated vehicle at an address until it is stopped.

    Parameters
    ----------
    address
        See :mod:`magcomp.simulate.transports`.
    vehicle
        Freshly switched on, or as an earlier call left it.
    speed
        How many times faster than real time.
    faults
        What goes wrong on the link.
    announce
        Told once, when the vehicle is ready, what a ground station has to be given.
    stop
        Set from another thread to end; Ctrl-C ends as well.
    clock
        Seconds.

    Raises
    ------
    UsageError
        For an impossible speed.
    AddressError, LinkError
        See :func:`magcomp.simulate.transports.open_transport`.
    """
    if not 0.0 < speed < math.inf:
        raise UsageError(
            f"The simulated vehicle's speed must be greater than 0; instead received {speed:g}"
        )
    machine = vehicle if faults is None else FaultyLink(vehicle, faults, vehicle.truth.seed)
    with contextlib.closing(open_transport(address)) as transport:
        announce(transport.reached_at)
        run(
            machine,
            transport,
            stop or threading.Event(),
            speed=speed,
            clock=clock,
            begin=vehicle.time,
        )
