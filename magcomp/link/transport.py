"""What every way to a vehicle looks like: bytes in, bytes out, close."""

from __future__ import annotations

from typing import Protocol

from magcomp.errors import LinkError
from magcomp.link.clock import Clock

Peer = tuple[object, ...] | None
"""Who is at the other end of a socket, as the system tells it."""


class TransportClosedError(LinkError):
    """The other end went away; opening the address again may help."""


class ReplayEndedError(LinkError):
    """A replayed log came to its end; opening it again would start it over."""


class Transport(Protocol):
    """One open way to a vehicle.

    One thread may read while another writes.

    Attributes
    ----------
    clock
        Tells when the bytes last read arrived.
    peer
        Who sent the bytes last read, where several can; None where only one can.
    """

    clock: Clock
    peer: Peer

    def read(self, timeout: float) -> bytes:
        """What one peer has sent, after at most ``timeout`` seconds; empty where nothing has come.

        Raises
        ------
        TransportClosedError
            The other end is gone.
        ReplayEndedError
            A replayed log is over.
        """
        ...

    def write(self, data: bytes) -> None:
        """Send ``data``, or lose it where nobody listens, as radio does.

        Raises
        ------
        TransportClosedError
            The other end is gone.
        """
        ...

    def keep_to(self, peer: Peer) -> None:
        """Send to this peer only, from now on; None sends to whoever speaks."""
        ...

    def close(self) -> None:
        """Give the port back. Closing twice is harmless."""
        ...
