"""MAVLink over TCP, connecting (tcp:) or listening for one peer (tcpin:)."""

from __future__ import annotations

import socket

from magcomp.link.address import TcpClient, TcpServer
from magcomp.link.clock import Clock
from magcomp.link.sockets import cannot_open, resolve, wait_readable, wait_writable
from magcomp.link.transport import Peer, TransportClosedError

_CHUNK = 65_536
_CONNECT_TIMEOUT_S = 3.0
_WRITE_TIMEOUT_S = 2.0


class TcpTransport:
    """A TCP stream. The listening kind takes one peer, and the next after that one leaves.

    Raises
    ------
    LinkError
        Nothing listens there, the port is in use, or the host cannot be found.
    """

    peer: Peer = None

    def __init__(self, address: TcpClient | TcpServer, clock: Clock) -> None:
        self.clock = clock
        self._address = address
        self._listener: socket.socket | None = None
        self._stream: socket.socket | None = None
        family, target = resolve(address, socket.SOCK_STREAM)
        sock = socket.socket(family, socket.SOCK_STREAM)
        try:
            if isinstance(address, TcpServer):
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                sock.bind(target)
                sock.listen(1)
                sock.setblocking(False)
                self._listener = sock
            else:
                sock.settimeout(_CONNECT_TIMEOUT_S)
                sock.connect(target)
                self._adopt(sock)
        except OSError as error:
            sock.close()
            raise cannot_open(address, error) from error

    def read(self, timeout: float) -> bytes:
        """See Transport.read."""
        if self._stream is None:
            self._accept(timeout)
            return b""
        wait_readable(self._stream, timeout)
        try:
            data = self._stream.recv(_CHUNK)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._gone() from error
        if not data:
            raise self._gone()
        return data

    def write(self, data: bytes) -> None:
        """See Transport.write."""
        stream = self._stream
        if stream is None:
            return  # nobody has connected yet
        remaining = memoryview(data)
        while remaining:
            try:
                remaining = remaining[stream.send(remaining) :]
            except BlockingIOError:
                # A frame cut short would spoil the stream, so a peer that takes no more is gone.
                if not wait_writable(stream, _WRITE_TIMEOUT_S):
                    raise self._gone() from None
            except OSError as error:
                raise self._gone() from error

    def keep_to(self, peer: Peer) -> None:
        """See Transport.keep_to: there is only one."""

    def close(self) -> None:
        """See Transport.close."""
        for sock in (self._stream, self._listener):
            if sock is not None:
                sock.close()

    def _accept(self, timeout: float) -> None:
        if self._listener is None or not wait_readable(self._listener, timeout):
            return
        try:
            stream, _ = self._listener.accept()
        except BlockingIOError:
            return
        except OSError as error:
            raise self._gone() from error
        self._adopt(stream)

    def _adopt(self, stream: socket.socket) -> None:
        stream.setblocking(False)
        stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._stream = stream

    def _gone(self) -> TransportClosedError:
        return TransportClosedError(f"The other end of {self._address} closed the connection.")
