"""The parameter protocol's vocabulary, and its translation from and to MAVLink.

The machines of this package speak these small frozen messages; `decode` and
`encode` are the only places that know pymavlink.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.mavlink.commands import command_long
from magcomp.mavlink.header import payload
from magcomp.mavlink.heartbeat import is_armed
from magcomp.mavlink.parameters import (
    NAME_SIZE,
    REAL32,
    Encoding,
    ParamValue,
    as_float,
    decode_param_value,
    encode_value,
    encoding,
)
from magcomp.mavlink.version import unique_id
from magcomp.model import Vehicle

_DENIED = re.compile(r"Param write denied \((\w{1,16})\)")
_PARAM_ERRORS = {
    1: "the vehicle does not know it",
    2: "the vehicle refuses the value",
    3: "the vehicle does not permit it",
    4: "the vehicle has no such component",
    5: "it is read-only",
}


@dataclass(frozen=True)
class ParamRefused:
    """The vehicle says a read or a write failed: STATUSTEXT, or PARAM_ERROR where it exists."""

    name: str
    reason: str


@dataclass(frozen=True)
class Heartbeat:
    """The autopilot lives, and is armed or not."""

    armed: bool


@dataclass(frozen=True)
class BootTime:
    """Seconds since the autopilot started, as any of its messages says."""

    seconds: float


@dataclass(frozen=True)
class Pong:
    """The answer to a `Ping`: its token, and seconds since the autopilot started."""

    token: int
    seconds: float


@dataclass(frozen=True)
class OwnNumber:
    """The flight controller's own number, empty where it has none; see ``Vehicle.uid``."""

    uid: str


@dataclass(frozen=True)
class Heard:
    """The vehicle said something else."""


Incoming = ParamValue | ParamRefused | Heartbeat | BootTime | Pong | OwnNumber | Heard


@dataclass(frozen=True)
class ReadAll:
    """Ask for the whole list (PARAM_REQUEST_LIST)."""


@dataclass(frozen=True)
class ReadIndex:
    """Ask for one parameter of the list (PARAM_REQUEST_READ)."""

    index: int


@dataclass(frozen=True)
class ReadName:
    """Ask for one parameter by its name (PARAM_REQUEST_READ)."""

    name: str


@dataclass(frozen=True)
class SetValue:
    """Write one parameter (PARAM_SET)."""

    name: str
    value: float
    type: int = REAL32


@dataclass(frozen=True)
class Ping:
    """Ask for nothing but an answer (TIMESYNC): all that was sent before arrives before it."""

    token: int


@dataclass(frozen=True)
class AskOwnNumber:
    """Ask for the flight controller's own number (AUTOPILOT_VERSION)."""


Outgoing = ReadAll | ReadIndex | ReadName | SetValue | Ping | AskOwnNumber


@dataclass(frozen=True)
class Peer:
    """The autopilot at the other end.

    Attributes
    ----------
    system, component
        Its MAVLink identity; everything else on the link is ignored.
    encoding
        How its parameters travel.
    """

    system: int
    component: int
    encoding: Encoding = Encoding.CAST

    @classmethod
    def of(cls, vehicle: Vehicle) -> Peer:
        """Peer that a vehicle is."""
        how = encoding(vehicle.autopilot, vehicle.capabilities)
        return cls(vehicle.system, vehicle.component, how)


def decode(message: Any, peer: Peer) -> Incoming | None:
    """Translate a pymavlink message; None where it is not the peer's or is damaged."""
    if (message.get_srcSystem(), message.get_srcComponent()) != (peer.system, peer.component):
        return None
    kind = message.get_type()
    if kind == "BAD_DATA":
        return None
    if kind in _DECODERS:
        return _DECODERS[kind](message, peer)
    boot_ms = getattr(message, "time_boot_ms", None)
    return Heard() if boot_ms is None else BootTime(boot_ms / 1000.0)


def encode(message: Outgoing, peer: Peer) -> mavlink.MAVLink_message:
    """Translate to a pymavlink message for the peer."""
    to = (peer.system, peer.component)
    match message:
        case ReadAll():
            return mavlink.MAVLink_param_request_list_message(*to)
        case ReadIndex(index):
            return mavlink.MAVLink_param_request_read_message(*to, b"", index)
        case ReadName(name):
            return mavlink.MAVLink_param_request_read_message(*to, _padded(name), -1)
        case SetValue(name, value, kind):
            sent = as_float(encode_value(value, kind, peer.encoding))
            return mavlink.MAVLink_param_set_message(*to, _padded(name), sent, kind)
        case Ping(token):
            return mavlink.MAVLink_timesync_message(0, token)
        case AskOwnNumber():
            version = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
            return command_long(to, mavlink.MAV_CMD_REQUEST_MESSAGE, version)


def _param_value(message: Any, peer: Peer) -> Incoming:
    return decode_param_value(payload(bytes(message.get_msgbuf())), peer.encoding)


def _heartbeat(message: Any, _: Peer) -> Incoming:
    return Heartbeat(is_armed(message.base_mode))


def _status_text(message: Any, _: Peer) -> Incoming:
    denied = _DENIED.search(str(message.text))
    return ParamRefused(denied[1], "it is read-only") if denied else Heard()


def _param_error(message: Any, _: Peer) -> Incoming:
    reason = _PARAM_ERRORS.get(message.error, f"the vehicle answers error {message.error}")
    return ParamRefused(_name(message), reason)


def _timesync(message: Any, _: Peer) -> Incoming:
    return Pong(message.ts1, message.tc1 * 1e-9) if message.tc1 > 0 else Heard()


def _own_number(message: Any, _: Peer) -> Incoming:
    return OwnNumber(unique_id(bytes(message.uid2), message.uid))


_DECODERS: Mapping[str, Callable[[Any, Peer], Incoming]] = {
    "PARAM_VALUE": _param_value,
    "HEARTBEAT": _heartbeat,
    "STATUSTEXT": _status_text,
    "PARAM_ERROR": _param_error,
    "TIMESYNC": _timesync,
    "AUTOPILOT_VERSION": _own_number,
}


def _name(message: Any) -> str:
    return str(message.param_id).rstrip("\x00")


def _padded(name: str) -> bytes:
    return name.encode("ascii")[:NAME_SIZE]
