"""From an address to an open transport, and to a connection on it."""

from __future__ import annotations

from collections.abc import Sequence

from magcomp.link.address import (
    Address,
    Replay,
    SerialLine,
    UdpClient,
    UdpServer,
    parse_address,
)
from magcomp.link.clock import Clock, SystemClock
from magcomp.link.connection import Connection
from magcomp.link.framing import GROUND_STATION_SYSTEM
from magcomp.link.replay import ReplayTransport
from magcomp.link.serial_port import SerialTransport
from magcomp.link.sinks import FrameSink
from magcomp.link.tcp import TcpTransport
from magcomp.link.transport import Transport
from magcomp.link.udp import UdpTransport


def open_transport(address: Address, clock: Clock) -> Transport:
    """Open the transport an address names.

    Raises
    ------
    LinkError
        It cannot be opened; says why.
    LogError
        A log to replay that is none.
    """
    match address:
        case UdpServer() | UdpClient():
            return UdpTransport(address, clock)
        case SerialLine():
            return SerialTransport(address, clock)
        case Replay():
            return ReplayTransport(address, clock)
        case _:
            return TcpTransport(address, clock)


def connect(
    address: str | Address,
    *,
    baud: int | None = None,
    system: int | None = None,
    component: int | None = None,
    key: bytes | None = None,
    source_system: int = GROUND_STATION_SYSTEM,
    sinks: Sequence[FrameSink] = (),
    clock: Clock | None = None,
) -> Connection:
    """Open an address and start to listen.

    Parameters
    ----------
    address
        A connection string as in ``magcomp.link.address``, or what it was parsed into.
    baud
        For a serial port whose address does not say.
    system, component
        The vehicle to speak to; None takes the only system there is, and the component that
        autopilots have.
    key
        Signing key of 32 bytes, from ``read_signing_key``.
    source_system
        The number this ground station gives itself.
    sinks
        Recorders and buffers; the caller closes them.
    clock
        The computer's clocks unless given.

    Raises
    ------
    AddressError
        ``address`` is not a connection string.
    LinkError
        It cannot be opened.
    LogError
        It is a log to replay, and is none.
    """
    where = parse_address(address, baud=baud) if isinstance(address, str) else address
    time = clock or SystemClock()
    return Connection(
        where,
        lambda: open_transport(where, time),
        system=system,
        component=component,
        key=key,
        source_system=source_system,
        sinks=sinks,
    )
