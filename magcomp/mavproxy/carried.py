"""A link that another program holds, as a transport."""

from __future__ import annotations

import queue
from collections.abc import Callable

from magcomp.link.clock import Clock
from magcomp.link.transport import Peer

_WAITING = 20_000
"""Frames that may wait: minutes of telemetry."""


class CarriedTransport:
    """What another program receives comes in by ``put``, what is written goes out by ``send``.

    Parameters
    ----------
    send
        Puts bytes on the line; called in any thread.
    clock
        Tells when frames arrived.
    """

    peer: Peer = None

    def __init__(self, send: Callable[[bytes], object], clock: Clock) -> None:
        self.clock = clock
        self._send = send
        self._frames: queue.Queue[bytes] = queue.Queue(_WAITING)

    def put(self, frame: bytes) -> None:
        """Take a frame that arrived; never waits, and loses it where nobody reads."""
        try:
            self._frames.put_nowait(frame)
        except queue.Full:
            return

    def read(self, timeout: float) -> bytes:
        """See Transport.read."""
        try:
            return self._frames.get(timeout=timeout)
        except queue.Empty:
            return b""

    def write(self, data: bytes) -> None:
        """See Transport.write; where the other program cannot send, it is lost as on a radio."""
        try:
            self._send(data)
        except OSError:
            return

    def keep_to(self, peer: Peer) -> None:
        """There is one peer only."""

    def close(self) -> None:
        """The line is the other program's."""
