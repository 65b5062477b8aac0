"""Connection strings, as users type them for MAVProxy and pymavlink.

====================  ==============================================================
udp:HOST:PORT         listen on HOST:PORT and answer whoever speaks (same as udpin:)
udp:PORT              the same for this computer only; 0.0.0.0 as HOST for the network
HOST:PORT, :PORT      the same as udp:HOST:PORT and udp:PORT; HOST must be in numbers
udpout:HOST:PORT      speak first to HOST:PORT
tcp:HOST:PORT         connect to HOST:PORT
tcpin:HOST:PORT       listen on HOST:PORT for one connection; tcpin:PORT as with udp:
/dev/ttyACM0[,BAUD]   serial port, 115200 baud unless said otherwise
COM7[,BAUD]           the same on Windows
FLIGHT.tlog[,10x]     replay of a recorded log, at real time or faster
====================  ==============================================================
"""

from __future__ import annotations

import ipaddress
import math
import re
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from serial.tools import list_ports

from magcomp.errors import AddressError

DEFAULT_BAUD = 115_200
_BAUD_RANGE = range(300, 20_000_001)
_WINDOWS_PORT = re.compile(r"(?:\\\\\.\\)?COM\d{1,3}", re.IGNORECASE)
_REPLAY_SPEED = re.compile(r"(\d+(?:\.\d+)?)x", re.IGNORECASE)

EXAMPLES = (
    "udp:0.0.0.0:14550",
    "udpout:192.168.1.10:14550",
    "tcp:127.0.0.1:5760",
    "/dev/ttyACM0",
    "/dev/ttyUSB0,57600",
    "COM7,57600",
    "flight.tlog",
)


@dataclass(frozen=True)
class UdpServer:
    """Listens on a UDP port and answers whoever speaks (``udp:``, ``udpin:``)."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"udp:{_join(self.host, self.port)}"

    @property
    def meaning(self) -> str:
        """What is done there, in words."""
        return f"listen for UDP {_reach(self.host)}, and answer who speaks"


@dataclass(frozen=True)
class UdpClient:
    """Speaks first to a UDP port (``udpout:``)."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"udpout:{_join(self.host, self.port)}"

    @property
    def meaning(self) -> str:
        """What is done there, in words."""
        return "speak first, by UDP"


@dataclass(frozen=True)
class TcpClient:
    """Connects to a TCP port (``tcp:``)."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"tcp:{_join(self.host, self.port)}"

    @property
    def meaning(self) -> str:
        """What is done there, in words."""
        return "connect by TCP"


@dataclass(frozen=True)
class TcpServer:
    """Listens on a TCP port for one peer at a time (``tcpin:``)."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"tcpin:{_join(self.host, self.port)}"

    @property
    def meaning(self) -> str:
        """What is done there, in words."""
        return f"listen for one TCP connection {_reach(self.host)}"


@dataclass(frozen=True)
class SerialLine:
    """A serial port; baud is without effect on USB devices."""

    device: str
    baud: int = DEFAULT_BAUD

    def __str__(self) -> str:
        return f"{self.device},{self.baud}"


@dataclass(frozen=True)
class Replay:
    """A .tlog played back; ``speed`` 1 is real time, infinity is as fast as it can be read."""

    path: Path
    speed: float = 1.0

    def __str__(self) -> str:
        return str(self.path) if self.speed == 1.0 else f"{self.path},{self.speed:g}x"


@dataclass(frozen=True)
class Carried:
    """A link that another program holds and hands on; nobody types it."""

    program: str

    def __str__(self) -> str:
        return self.program


Address = UdpServer | UdpClient | TcpClient | TcpServer | SerialLine | Replay

_NETWORK: dict[str, type[UdpServer | UdpClient | TcpClient | TcpServer]] = {
    "udp": UdpServer,
    "udpin": UdpServer,
    "udpout": UdpClient,
    "tcp": TcpClient,
    "tcpin": TcpServer,
}


_LISTENING = (UdpServer, TcpServer)
_IPV6 = 6
LOOPBACK = "127.0.0.1"
"""Where a listening address without a host is: nobody elsewhere may speak to it unasked."""


@dataclass(frozen=True)
class SerialPort:
    """A serial port of this computer and what is plugged into it."""

    device: str
    description: str


def parse_address(text: str, *, baud: int | None = None, speed: float | None = None) -> Address:
    """Read a connection string.

    Parameters
    ----------
    text
        As in the table at the top of this module.
    baud
        Baud rate where ``text`` names a serial port without one (``--baud``).
    speed
        Replay speed where ``text`` names a log without one; 1 is real time.

    Raises
    ------
    AddressError
        When ``text`` is none of these. Nothing is guessed; the message shows examples.
    """
    text = text.strip()
    full = f"udp:{text}" if _without_scheme(text) else text
    scheme, colon, rest = full.partition(":")
    if colon and scheme.lower() in _NETWORK:
        _refuse_baud(text, baud)
        kind = _NETWORK[scheme.lower()]
        if kind in _LISTENING and _digits(rest.removeprefix(":")):
            rest = f"{LOOPBACK}:{rest.removeprefix(':')}"
        return kind(*_host_and_port(rest, text))
    name, comma, option = text.rpartition(",")
    if not comma:
        name, option = text, ""
    if name.lower().endswith(".tlog"):
        _refuse_baud(text, baud)
        return Replay(Path(name), _replay_speed(option, text) if comma else _checked_speed(speed))
    if _WINDOWS_PORT.fullmatch(name) or re.fullmatch(r"/dev/\S+", name):
        return SerialLine(name, _baud(option, text) if comma else _checked_baud(baud, text))
    if Path(name).suffix.lower() in (".bin", ".ulg", ".log"):
        raise AddressError(
            f"A log to replay must be a .tlog; instead received {text!r}. "
            "Other logs can be read with `magcomp fit`."
        )
    raise _not_an_address(text)


def serial_ports() -> tuple[SerialPort, ...]:
    """List this computer's serial ports, those with a USB device first."""
    ports = sorted(list_ports.comports(), key=lambda port: (port.vid is None, port.device))
    return tuple(
        SerialPort(port.device, " ".join(filter(None, (port.manufacturer, port.product))))
        if port.product
        else SerialPort(port.device, "" if port.description == "n/a" else port.description)
        for port in ports
    )


def _without_scheme(text: str) -> bool:
    """Whether this is [HOST]:PORT and no more; a name as HOST could be a misspelt scheme."""
    host, colon, port = text.rpartition(":")
    return bool(colon) and _digits(port) and (not host or _is_numeric(host))


def _is_numeric(host: str) -> bool:
    inner = host[1:-1] if host.startswith("[") and host.endswith("]") else host
    try:
        found = ipaddress.ip_address(inner)
    except ValueError:
        return False
    return (found.version == _IPV6) == (inner is not host)


def _reach(host: str) -> str:
    """Who can speak to a listener there."""
    if not _is_numeric(_bracketed(host)):
        return f"at {host}"
    found = ipaddress.ip_address(host)
    if found.is_loopback:
        return "from this computer only"
    return "from the whole network" if found.is_unspecified else f"at {host}"


def _not_an_address(text: str) -> AddressError:
    scheme, colon, rest = text.partition(":")
    near = get_close_matches(scheme.lower(), _NETWORK, n=1) if colon else []
    guess = f" Did you mean '{near[0]}:{rest}'?" if near and near[0] != scheme.lower() else ""
    return AddressError(
        f"An address must look like one of {', '.join(EXAMPLES)}; instead received {text!r}.{guess}"
    )


def _join(host: str, port: int) -> str:
    return f"{_bracketed(host)}:{port}"


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _host_and_port(rest: str, text: str) -> tuple[str, int]:
    host, _, port = rest.rpartition(":")
    if host.startswith("[") and host.endswith("]"):
        host = host[1:-1]
    elif ":" in host:
        raise _not_an_address(text)
    if not host or re.search(r"[\s/,\[\]]", host):
        raise _not_an_address(text)
    if not _digits(port) or not 1 <= int(port) <= 65_535:
        raise AddressError(
            f"The port in {text!r} must be a number from 1 to 65535; instead received {port!r}. "
            f"Addresses look like {EXAMPLES[0]} or {EXAMPLES[2]}."
        )
    return host, int(port)


def _digits(text: str) -> bool:
    return re.fullmatch(r"[0-9]{1,9}", text) is not None


def _baud(option: str, text: str) -> int:
    if not _digits(option):
        raise AddressError(
            f"The baud rate in {text!r} must be a number such as 57600; "
            f"instead received {option!r}."
        )
    return _checked_baud(int(option), text)


def _checked_baud(baud: int | None, text: str) -> int:
    if baud is None:
        return DEFAULT_BAUD
    if baud not in _BAUD_RANGE:
        raise AddressError(
            f"The baud rate of {text!r} must be from {_BAUD_RANGE.start} to "
            f"{_BAUD_RANGE.stop - 1}; instead received {baud}."
        )
    return baud


def _refuse_baud(text: str, baud: int | None) -> None:
    if baud is not None:
        raise AddressError(
            f"A baud rate must come with a serial port; instead received {baud} with {text!r}."
        )


def _replay_speed(option: str, text: str) -> float:
    match = _REPLAY_SPEED.fullmatch(option)
    if match is None:
        raise AddressError(
            f"The replay speed in {text!r} must look like 10x; instead received {option!r}."
        )
    return _checked_speed(float(match[1]))


def _checked_speed(speed: float | None) -> float:
    if speed is None:
        return 1.0
    if math.isnan(speed) or speed <= 0:
        raise AddressError(f"A replay speed must be above 0; instead received {speed:g}.")
    return speed
