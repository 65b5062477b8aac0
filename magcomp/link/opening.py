"""From an address to an open transport."""

from __future__ import annotations

from magcomp.link.address import Address, Replay, SerialLine, UdpClient, UdpServer
from magcomp.link.clock import Clock
from magcomp.link.replay import ReplayTransport
from magcomp.link.serial_port import SerialTransport
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
