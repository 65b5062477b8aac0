"""MAVLink over a serial port: USB, telemetry radio, or a pseudo-terminal."""

from __future__ import annotations

import errno

import serial

from magcomp.errors import LinkError
from magcomp.link.address import SerialLine, serial_ports
from magcomp.link.clock import Clock
from magcomp.link.transport import Peer, TransportClosedError

_CHUNK = 65_536
_WRITE_TIMEOUT_S = 2.0


class SerialTransport:
    """A serial port, held exclusively.

    Raises
    ------
    LinkError
        No such port, no permission, or another program has it.
    """

    peer: Peer = None

    def __init__(self, address: SerialLine, clock: Clock) -> None:
        self.clock = clock
        self._address = address
        try:
            self._port = serial.Serial(
                address.device,
                address.baud,
                timeout=0.05,
                write_timeout=_WRITE_TIMEOUT_S,
                exclusive=True,
            )
        except (OSError, ValueError) as error:
            raise _cannot_open(address, error) from error

    def read(self, timeout: float) -> bytes:
        """See Transport.read."""
        try:
            if self._port.timeout != timeout:
                self._port.timeout = timeout
            data: bytes = self._port.read(1)
            waiting = min(self._port.in_waiting, _CHUNK)
            if data and waiting:
                data += self._port.read(waiting)
        except (OSError, TypeError) as error:  # pyserial: TypeError when closed meanwhile
            raise self._gone() from error
        return data

    def write(self, data: bytes) -> None:
        """See Transport.write."""
        try:
            self._port.write(data)
        except serial.SerialTimeoutException:
            return  # a stalled port loses bytes; the reader notices if it stays so
        except (OSError, TypeError) as error:
            raise self._gone() from error

    def keep_to(self, peer: Peer) -> None:
        """See Transport.keep_to: there is only one."""

    def close(self) -> None:
        """See Transport.close."""
        self._port.close()

    def _gone(self) -> TransportClosedError:
        return TransportClosedError(f"The serial port {self._address.device} was unplugged.")


def _cannot_open(address: SerialLine, error: Exception) -> LinkError:
    code = getattr(error, "errno", None)
    if code is None and error.__context__ is not None and error.__context__.args:
        code = error.__context__.args[0]  # pyserial hides the number of a refused setting here
    if code == errno.ENOENT:
        plugged = ", ".join(port.device for port in serial_ports()) or "none"
        reason = f"there is no such serial port (plugged in: {plugged})"
    elif code == errno.EACCES:
        reason = "you may not use it (on Linux, join the group dialout and log in again)"
    elif code in (errno.EBUSY, errno.EAGAIN):
        reason = "another program is using it"
    elif code == errno.ENOTTY:
        reason = "it is not a serial port"
    else:
        reason = str(error)
    return LinkError(f"{address.device} cannot be opened because {reason}.")
