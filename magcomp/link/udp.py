"""MAVLink over UDP, listening (udp:, udpin:) or speaking first (udpout:)."""

from __future__ import annotations

import errno
import socket

from magcomp.link.address import UdpClient, UdpServer
from magcomp.link.clock import Clock
from magcomp.link.sockets import cannot_open, resolve, wait_readable
from magcomp.link.transport import Peer, TransportClosedError

_DATAGRAM = 65_535
_MOST_PEERS = 32
_PEER_SILENCE_S = 10.0
_RECEIVE_BUFFER = 1 << 20


class UdpTransport:
    """A UDP socket that answers whoever spoke within the last ten seconds, until told whom.

    Several peers are normal: two vehicles, a vehicle that came back on another port after a
    reboot, or a stranger. The latest is answered even when silent for longer.

    Raises
    ------
    LinkError
        The port is in use, or the host cannot be found.
    """

    peer: Peer = None

    def __init__(self, address: UdpServer | UdpClient, clock: Clock) -> None:
        self.clock = clock
        self._peers: dict[tuple[object, ...], float] = {}
        self._kept_to: Peer = None
        self._waiting: tuple[Peer, bytes] | None = None
        self._listening = isinstance(address, UdpServer)
        family, target = resolve(address, socket.SOCK_DGRAM)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            if self._listening:
                self._socket.bind(target)
            else:
                self._socket.connect(target)
        except OSError as error:
            self._socket.close()
            raise cannot_open(address, error) from error

    @property
    def port(self) -> int:
        """The local port, as the system gave it."""
        return int(self._socket.getsockname()[1])

    def read(self, timeout: float) -> bytes:
        """See Transport.read."""
        data = bytearray()
        if self._waiting is not None:
            (self.peer, first), self._waiting = self._waiting, None
            data += first
        else:
            wait_readable(self._socket, timeout)
        while len(data) < _DATAGRAM:
            try:
                datagram, peer = self._socket.recvfrom(_DATAGRAM)
            except BlockingIOError:
                break
            except (ConnectionRefusedError, ConnectionResetError):
                continue  # an earlier datagram of ours found nobody listening yet
            except OSError as error:
                raise TransportClosedError(f"The UDP socket failed: {error.strerror}.") from error
            if self._listening:
                self._remember(peer)
                if data and peer != self.peer:
                    self._waiting = (peer, datagram)
                    break
                self.peer = peer
            data += datagram
        return bytes(data)

    def _remember(self, peer: tuple[object, ...]) -> None:
        self._peers.pop(peer, None)
        self._peers[peer] = self.clock.monotonic()
        while len(self._peers) > _MOST_PEERS:
            del self._peers[next(iter(self._peers))]

    def keep_to(self, peer: Peer) -> None:
        """See Transport.keep_to."""
        self._kept_to = peer

    def write(self, data: bytes) -> None:
        """See Transport.write."""
        try:
            if not self._listening:
                self._send_first(data)
                return
            if self._kept_to is not None:
                self._socket.sendto(data, self._kept_to)
                return
            recent = self.clock.monotonic() - _PEER_SILENCE_S
            for index, (peer, heard) in enumerate(reversed(list(self._peers.items()))):
                if index == 0 or heard >= recent:
                    self._socket.sendto(data, peer)
        except (BlockingIOError, ConnectionRefusedError, ConnectionResetError):
            return  # lost on the way, as on the air
        except OSError as error:
            if error.errno in (errno.ENETUNREACH, errno.EHOSTUNREACH, errno.ENETDOWN):
                return
            raise TransportClosedError(f"The UDP socket failed: {error.strerror}.") from error

    def _send_first(self, data: bytes) -> None:
        try:
            self._socket.send(data)
        except (ConnectionRefusedError, ConnectionResetError):
            # The system reports an earlier datagram's fate and has not sent this one.
            self._socket.send(data)

    def close(self) -> None:
        """See Transport.close."""
        self._socket.close()
