"""The parameter protocol's vocabulary, and its translation from and to MAVLink.

The machines of this package speak these small frozen messages; `decode` and
`encode` are the only places that know pymavlink.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.model import Vehicle

REAL32 = 9
"""MAV_PARAM_TYPE_REAL32."""

NO_INDEX = 65535
"""Index of a PARAM_VALUE that is no part of the list (−1 as uint16)."""

_ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED
_NAME_LENGTH = 16
# How PX4 packs an integer of each MAV_PARAM_TYPE into the four bytes of the float field.
_INTEGER_LAYOUT = {1: "<Bxxx", 2: "<bxxx", 3: "<Hxx", 4: "<hxx", 5: "<I", 6: "<i"}
_DENIED = re.compile(r"Param write denied \((\w{1,16})\)")
_PARAM_ERRORS = {
    1: "the vehicle does not know it",
    2: "the vehicle refuses the value",
    3: "the vehicle does not permit it",
    4: "the vehicle has no such component",
    5: "it is read-only",
}


@dataclass(frozen=True)
class ParamValue:
    """What a parameter is on the vehicle: part of the list, an answer, or an echo of a write."""

    name: str
    value: float
    type: int = REAL32
    count: int = 0
    index: int = NO_INDEX


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
class Heard:
    """The vehicle said something else."""


Incoming = ParamValue | ParamRefused | Heartbeat | BootTime | Heard


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


Outgoing = ReadAll | ReadIndex | ReadName | SetValue


@dataclass(frozen=True)
class Peer:
    """The autopilot at the other end.

    Attributes
    ----------
    system, component
        Its MAVLink identity; everything else on the link is ignored.
    bytewise
        Whether integers travel as bytes inside the float field (PX4) or as floats (ArduPilot).
    """

    system: int
    component: int
    bytewise: bool = False

    @classmethod
    def of(cls, vehicle: Vehicle) -> Peer:
        """Peer that a vehicle is."""
        return cls(vehicle.system, vehicle.component, vehicle.autopilot == "px4")


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
            sent = _to_bytes(value, kind) if peer.bytewise else value
            return mavlink.MAVLink_param_set_message(*to, _padded(name), sent, kind)


def fits(value: float, kind: int) -> bool:
    """Whether a parameter of a MAV_PARAM_TYPE can hold a value exactly."""
    layout = _INTEGER_LAYOUT.get(kind)
    if layout is None:
        return math.isfinite(value)
    try:
        struct.pack(layout, int(value))
    except (struct.error, ValueError, OverflowError):
        return False
    return int(value) == value


def _param_value(message: Any, peer: Peer) -> Incoming:
    value = float(message.param_value)
    if peer.bytewise and message.param_type in _INTEGER_LAYOUT:
        packed = struct.pack("<f", value)
        value = float(struct.unpack(_INTEGER_LAYOUT[message.param_type], packed)[0])
    return ParamValue(
        _name(message), value, message.param_type, message.param_count, message.param_index
    )


def _heartbeat(message: Any, _: Peer) -> Incoming:
    return Heartbeat(bool(message.base_mode & _ARMED))


def _status_text(message: Any, _: Peer) -> Incoming:
    denied = _DENIED.search(str(message.text))
    return ParamRefused(denied[1], "it is read-only") if denied else Heard()


def _param_error(message: Any, _: Peer) -> Incoming:
    reason = _PARAM_ERRORS.get(message.error, f"the vehicle answers error {message.error}")
    return ParamRefused(_name(message), reason)


_DECODERS: Mapping[str, Callable[[Any, Peer], Incoming]] = {
    "PARAM_VALUE": _param_value,
    "HEARTBEAT": _heartbeat,
    "STATUSTEXT": _status_text,
    "PARAM_ERROR": _param_error,
}


def _name(message: Any) -> str:
    return str(message.param_id).rstrip("\x00")


def _padded(name: str) -> bytes:
    return name.encode("ascii")[:_NAME_LENGTH]


def _to_bytes(value: float, kind: int) -> float:
    if kind not in _INTEGER_LAYOUT:
        return value
    return float(struct.unpack("<f", struct.pack(_INTEGER_LAYOUT[kind], int(value)))[0])
