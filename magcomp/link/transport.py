"""What every way to a vehicle looks like: bytes in, bytes out, close."""

from __future__ import annotations

from typing import Protocol

from magcomp.errors import LinkError
from magcomp.link.clock import Clock


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
    answers
        Whether what is written can reach a vehicle (false for a replay).
    """

    clock: Clock
    answers: bool

    def read(self, timeout: float) -> bytes:
        """Whatever has arrived, after at most ``timeout`` seconds; empty where nothing has.

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

    def close(self) -> None:
        """Give the port back. Closing twice is harmless."""
        ...
