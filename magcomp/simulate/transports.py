"""Where a simulated vehicle can be reached: UDP, TCP and a pseudo-terminal.

=====================  ============================================================
udpout:HOST:PORT       sends to a listening ground station, as real simulations do
udp:HOST:PORT          listens, and answers whoever spoke last (same as udpin:); udp:PORT
                       listens to this computer only
tcpin:HOST:PORT        listens for one ground station at a time
tcp:HOST:PORT          connects to a listening ground station
pty                    a pseudo-terminal, for programs that want a serial port
=====================  ============================================================
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
from collections.abc import Callable, Mapping
from typing import Protocol

from magcomp.errors import AddressError, LinkError

_CHUNK = 65536
_MOST_PENDING = 65536
_CONNECT_S = 5.0
_LOOPBACK = "127.0.0.1"
_LISTENING = ("udp", "udpin", "tcpin")


class Transport(Protocol):
    """Carries bytes between a vehicle and a ground station."""

    @property
    def reached_at(self) -> str:
        """What a ground station has to be told to reach the vehicle."""

    def wait(self, seconds: float) -> bytes:
        """Bytes that arrive within ``seconds``; returns at the first, or empty."""

    def send(self, frame: bytes) -> None:
        """Send one frame; it is lost where nobody listens."""

    def close(self) -> None:
        """Give everything back."""


class Udp:
    """UDP, one frame a datagram.

    Parameters
    ----------
    local
        Host and port to listen at.
    peer
        Whom to speak to, and to no other; None to wait until somebody speaks.
    """

    def __init__(self, local: tuple[str, int], peer: tuple[str, int] | None = None) -> None:
        self._peer = peer
        self._last: tuple[str, int] | None = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind(local)
            if peer is not None:
                self._socket.connect(peer)
        except OSError as error:
            self._socket.close()
            raise _unusable("UDP", local, error) from error

    @property
    def reached_at(self) -> str:
        """See :class:`Transport`."""
        if self._peer is not None:
            return f"udp:{self._peer[0]}:{self._peer[1]}"
        host, port = self._socket.getsockname()
        return f"udpout:{host}:{port}"

    def wait(self, seconds: float) -> bytes:
        """See :class:`Transport`."""
        ready, _, _ = select.select([self._socket], [], [], seconds)
        if not ready:
            return b""
        with contextlib.suppress(OSError):
            data, peer = self._socket.recvfrom(_CHUNK)
            self._last = peer
            return data
        return b""

    def send(self, frame: bytes) -> None:
        """See :class:`Transport`."""
        with contextlib.suppress(OSError):
            if self._peer is not None:
                self._socket.send(frame)
            elif self._last is not None:
                self._socket.sendto(frame, self._last)

    def close(self) -> None:
        """See :class:`Transport`."""
        self._socket.close()


class TcpServer:
    """Listens; a second ground station takes the first one's place."""

    def __init__(self, local: tuple[str, int]) -> None:
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._listener.bind(local)
        except OSError as error:
            self._listener.close()
            raise _unusable("TCP", local, error) from error
        self._listener.listen(1)
        self._stream: _Stream | None = None

    @property
    def reached_at(self) -> str:
        """See :class:`Transport`."""
        host, port = self._listener.getsockname()
        return f"tcp:{host}:{port}"

    def wait(self, seconds: float) -> bytes:
        """See :class:`Transport`."""
        watched: list[int] = [self._listener.fileno()]
        if self._stream is not None:
            watched.append(self._stream.fileno)
        ready, _, _ = select.select(watched, [], [], seconds)
        if self._listener.fileno() in ready:
            self._drop()
            connection, _ = self._listener.accept()
            self._stream = _Stream.of_socket(connection)
        elif self._stream is not None and ready:
            data = self._stream.read()
            if not data:
                self._drop()
            return data
        return b""

    def send(self, frame: bytes) -> None:
        """See :class:`Transport`."""
        if self._stream is not None and not self._stream.write(frame):
            self._drop()

    def close(self) -> None:
        """See :class:`Transport`."""
        self._drop()
        self._listener.close()

    def _drop(self) -> None:
        if self._stream is not None:
            self._stream.close()
            self._stream = None


class TcpClient:
    """Connects once; the vehicle is alone when the ground station hangs up."""

    def __init__(self, peer: tuple[str, int]) -> None:
        self._peer = peer
        try:
            connection = socket.create_connection(peer, timeout=_CONNECT_S)
        except OSError as error:
            raise _unusable("TCP", peer, error) from error
        self._stream = _Stream.of_socket(connection)
        self._alone = False

    @property
    def reached_at(self) -> str:
        """See :class:`Transport`."""
        return f"tcpin:{self._peer[0]}:{self._peer[1]}"

    def wait(self, seconds: float) -> bytes:
        """See :class:`Transport`."""
        watched = [] if self._alone else [self._stream.fileno]
        ready, _, _ = select.select(watched, [], [], seconds)
        if not ready:
            return b""
        data = self._stream.read()
        self._alone = not data
        return data

    def send(self, frame: bytes) -> None:
        """See :class:`Transport`."""
        if not self._alone:
            self._alone = not self._stream.write(frame)

    def close(self) -> None:
        """See :class:`Transport`."""
        self._stream.close()


class PseudoTerminal:
    """A serial port without a cable."""

    def __init__(self) -> None:
        # Only Unix has these modules.
        import pty  # noqa: PLC0415
        import tty  # noqa: PLC0415

        master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(master, False)
        self._stream = _Stream(master, lambda: os.close(master))

    @property
    def reached_at(self) -> str:
        """Path of the terminal."""
        return os.ttyname(self._slave)

    def wait(self, seconds: float) -> bytes:
        """See :class:`Transport`."""
        ready, _, _ = select.select([self._stream.fileno], [], [], seconds)
        return self._stream.read() if ready else b""

    def send(self, frame: bytes) -> None:
        """See :class:`Transport`."""
        self._stream.write(frame)

    def close(self) -> None:
        """See :class:`Transport`."""
        self._stream.close()
        os.close(self._slave)


class _Stream:
    """A descriptor without datagrams: what does not fit now waits, whole frames at a time."""

    def __init__(self, fileno: int, close: Callable[[], None]) -> None:
        self.fileno = fileno
        self.close = close
        self._pending = bytearray()

    @classmethod
    def of_socket(cls, connection: socket.socket) -> _Stream:
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return cls(connection.fileno(), connection.close)

    def read(self) -> bytes:
        """What is there; empty at the end of the stream."""
        try:
            return os.read(self.fileno, _CHUNK)
        except OSError:
            return b""

    def write(self, frame: bytes) -> bool:
        """Send a frame, or lose it where nobody reads; False once the stream is broken."""
        if len(self._pending) + len(frame) <= _MOST_PENDING:
            self._pending += frame
        try:
            written = os.write(self.fileno, self._pending)
        except BlockingIOError:
            return True
        except OSError:
            return False
        del self._pending[:written]
        return True


def open_transport(address: str) -> Transport:
    """Open what a connection string names.

    Raises
    ------
    AddressError
        When ``address`` is none of the forms at the top of this module.
    LinkError
        When the port is taken, or nobody is there.
    """
    scheme, _, rest = address.strip().partition(":")
    if scheme == "pty" and not rest:
        return PseudoTerminal()
    host, _, port = rest.rpartition(":")
    if scheme in _LISTENING and not host:
        host = _LOOPBACK  # whoever wants to be reached from elsewhere says so
    opener = _OPENERS.get(scheme)
    if opener is None or not port.isdecimal() or not 0 <= int(port) <= 65535:
        raise AddressError(
            "The simulated vehicle's address must look like udpout:127.0.0.1:14550, "
            f"udp:0.0.0.0:14550, tcpin:0.0.0.0:5760, tcp:127.0.0.1:5760 or pty; "
            f"instead received {address!r}"
        )
    return opener((host, int(port)))


_OPENERS: Mapping[str, Callable[[tuple[str, int]], Transport]] = {
    "udpout": lambda peer: Udp(("", 0), peer),
    "udp": Udp,
    "udpin": Udp,
    "tcpin": TcpServer,
    "tcp": TcpClient,
}


def _unusable(kind: str, place: tuple[str, int], error: OSError) -> LinkError:
    return LinkError(
        f"{kind} {place[0]}:{place[1]} must be free and reachable for the simulated vehicle; "
        f"instead received: {error.strerror or error}"
    )
