"""What UDP and TCP share: finding hosts, waiting, and saying why it failed."""

from __future__ import annotations

import errno
import select
import socket
from typing import Any

from magcomp.errors import LinkError
from magcomp.link.address import TcpClient, TcpServer, UdpClient, UdpServer

NetworkAddress = UdpServer | UdpClient | TcpClient | TcpServer


def wait_readable(sock: socket.socket, timeout: float) -> bool:
    """Wait until ``sock`` has something to read; a socket closed meanwhile counts as ready."""
    try:
        return bool(select.select([sock], [], [], timeout)[0])
    except (OSError, ValueError):
        return True


def wait_writable(sock: socket.socket, timeout: float) -> bool:
    """Wait until ``sock`` takes more bytes."""
    try:
        return bool(select.select([], [sock], [], timeout)[1])
    except (OSError, ValueError):
        return True


def resolve(
    address: NetworkAddress, kind: socket.SocketKind
) -> tuple[socket.AddressFamily, tuple[Any, ...]]:
    """Find the host of a network address: the socket family and what to bind or connect to.

    Raises
    ------
    LinkError
        No such host.
    """
    try:
        family, _, _, _, target = socket.getaddrinfo(address.host, address.port, type=kind)[0]
    except (OSError, UnicodeError) as error:
        raise LinkError(
            f"The host of {address} must exist; {address.host!r} cannot be found."
        ) from error
    return family, target


def cannot_open(address: NetworkAddress, error: OSError) -> LinkError:
    """Say in one sentence why a socket could not be opened."""
    if error.errno == errno.EADDRINUSE:
        reason = "its port is in use: close the other program or choose another port"
    elif error.errno == errno.EADDRNOTAVAIL:
        reason = (
            "this computer does not have that address: listen on 0.0.0.0, "
            "or speak to another computer with udpout: or tcp:"
        )
    elif error.errno == errno.EACCES:
        reason = "the system does not permit that port"
    elif isinstance(error, ConnectionRefusedError):
        reason = "nothing listens there"
    elif isinstance(error, TimeoutError):
        reason = "the host did not answer in time"
    else:
        reason = error.strerror or str(error)
    return LinkError(f"{address} cannot be opened because {reason}.")
