"""The live vehicle: addresses, transports, the connection, its recorder and its replay."""

from magcomp.link.address import (
    Address,
    Replay,
    SerialLine,
    SerialPort,
    TcpClient,
    TcpServer,
    UdpClient,
    UdpServer,
    parse_address,
    serial_ports,
)
from magcomp.link.connection import Connection
from magcomp.link.events import (
    GapEnded,
    GapStarted,
    LinkEvent,
    SinkFailed,
    StrangerHeard,
    VehicleFound,
    VehicleRebooted,
)
from magcomp.link.framing import GROUND_STATION_SYSTEM
from magcomp.link.opening import connect
from magcomp.link.quality import Gap, LinkStatistics
from magcomp.link.recorder import Recorder
from magcomp.link.signing import is_read_by_others, read_signing_key
from magcomp.link.sinks import FrameSink
from magcomp.link.streams import DEFAULT_RATES, StreamReport

__all__ = [
    "DEFAULT_RATES",
    "GROUND_STATION_SYSTEM",
    "Address",
    "Connection",
    "FrameSink",
    "Gap",
    "GapEnded",
    "GapStarted",
    "LinkEvent",
    "LinkStatistics",
    "Recorder",
    "Replay",
    "SerialLine",
    "SerialPort",
    "SinkFailed",
    "StrangerHeard",
    "StreamReport",
    "TcpClient",
    "TcpServer",
    "UdpClient",
    "UdpServer",
    "VehicleFound",
    "VehicleRebooted",
    "connect",
    "is_read_by_others",
    "parse_address",
    "read_signing_key",
    "serial_ports",
]
