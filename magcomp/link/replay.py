"""A .tlog played back as if a vehicle were there: a transport that cannot be answered."""

from __future__ import annotations

import mmap
import threading

from magcomp.errors import LogError
from magcomp.link.address import Replay
from magcomp.link.clock import Clock
from magcomp.link.transport import Peer, ReplayEndedError
from magcomp.mavlink.records import records

_LONGEST_PAUSE_S = 5.0


class ReplayTransport:
    """Gives a log's frames at the pace they were recorded, times ``address.speed``.

    Pauses of the log longer than five seconds are cut to five. Its clock shows the
    log's time, so that what is recorded from a replay has the log's stamps.

    Parameters
    ----------
    address
        The log and the speed.
    clock
        What the pace is measured with.

    Raises
    ------
    LogError
        The file cannot be read, or holds no frame.
    """

    peer: Peer = None

    def __init__(self, address: Replay, clock: Clock) -> None:
        self.clock: Clock = self
        self._pace = clock
        self._speed = address.speed
        self._closed = threading.Event()
        self._records = records(_read(address))
        self._next = next(self._records, None)
        if self._next is None:
            raise LogError(f"{address.path} must be a .tlog; it holds no MAVLink frame.")
        self._stamp_us = self._next[0]
        self._elapsed = 0.0
        self._due = clock.monotonic()

    def monotonic(self) -> float:
        """Seconds of log played so far, long pauses cut."""
        return self._elapsed

    def unix_us(self) -> int:
        """Stamp of the frame last given."""
        return self._stamp_us

    def read(self, timeout: float) -> bytes:
        """See Transport.read; gives one record at a time."""
        if self._next is None or self._closed.is_set():
            raise ReplayEndedError("The replayed log is over.")
        stamp_us, frame = self._next
        step = min(max(stamp_us - self._stamp_us, 0) * 1e-6, _LONGEST_PAUSE_S)
        wait = self._due + step / self._speed - self._pace.monotonic()
        if wait > timeout:
            self._closed.wait(timeout)
            return b""
        if wait > 0:
            self._closed.wait(wait)
        self._due += step / self._speed
        self._elapsed += step
        self._stamp_us = stamp_us
        self._next = next(self._records, None)
        return frame

    def write(self, data: bytes) -> None:
        """See Transport.write: a log takes no answer."""

    def keep_to(self, peer: Peer) -> None:
        """See Transport.keep_to: there is only one."""

    def close(self) -> None:
        """See Transport.close."""
        self._closed.set()


def _read(address: Replay) -> bytes | mmap.mmap:
    try:
        with address.path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        raise LogError(f"{address.path} cannot be read: {error.strerror}.") from error
    except ValueError as error:
        raise LogError(f"{address.path} must be a .tlog; it is empty.") from error
