"""What a sweep says and hears, and its translation from and to MAVLink."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.autopilots.motor_test import Command
from magcomp.mavlink.commands import command_long
from magcomp.writing.messages import Heartbeat, Peer

_ACCEPTED = int(mavlink.MAV_RESULT_ACCEPTED)
_UNDER_WAY = int(mavlink.MAV_RESULT_IN_PROGRESS)
_RESULTS = {
    1: "for the moment it does not",
    2: "it is denied",
    3: "the firmware does not know the command",
    4: "it failed",
}
_M_PER_DEGREE = 111_319.5


@dataclass(frozen=True)
class Attitude:
    """How the vehicle stands and turns.

    Attributes
    ----------
    roll, pitch
        Radians.
    yaw_rate
        About its own axis, by the gyro, rad/s: the heading itself follows the compass.
    seconds
        Since the autopilot started.
    """

    roll: float
    pitch: float
    yaw_rate: float
    seconds: float


@dataclass(frozen=True)
class Position:
    """Where it is.

    Attributes
    ----------
    latitude, longitude
        Degrees.
    up
        Metres above where it was switched on.
    """

    latitude: float
    longitude: float
    up: float

    def distance(self, other: Position) -> float:
        """Metres to a place nearby."""
        north = (other.latitude - self.latitude) * _M_PER_DEGREE
        east = math.remainder(other.longitude - self.longitude, 360.0) * _M_PER_DEGREE
        east *= math.cos(math.radians(self.latitude))
        return math.hypot(north, east, other.up - self.up)


@dataclass(frozen=True)
class Current:
    """Battery current, A."""

    amperes: float


@dataclass(frozen=True)
class Landed:
    """The autopilot says that it stands on the ground, or flies."""

    aloft: bool


@dataclass(frozen=True)
class Answer:
    """What became of a command.

    Attributes
    ----------
    number
        MAV_CMD.
    refusal
        In a clause; empty where it was accepted.
    """

    number: int
    refusal: str


@dataclass(frozen=True)
class Said:
    """A line of text."""

    text: str


Incoming = Heartbeat | Attitude | Position | Current | Landed | Answer | Said


def decode(message: Any, peer: Peer) -> Incoming | None:
    """Translate a pymavlink message; None where it is not the peer's or tells nothing here."""
    if (message.get_srcSystem(), message.get_srcComponent()) != (peer.system, peer.component):
        return None
    decoder = _DECODERS.get(message.get_type())
    return None if decoder is None else decoder(message)


def encode(command: Command, peer: Peer) -> mavlink.MAVLink_message:
    """Translate to a pymavlink message for the peer."""
    return command_long((peer.system, peer.component), command.number, *command.values)


def _heartbeat(message: Any) -> Incoming:
    return Heartbeat(bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED))


def _attitude(message: Any) -> Incoming | None:
    values = (message.roll, message.pitch, message.yawspeed)
    if not all(map(math.isfinite, values)):
        return None
    return Attitude(*values, message.time_boot_ms / 1000.0)


def _position(message: Any) -> Incoming:
    return Position(message.lat * 1e-7, message.lon * 1e-7, message.relative_alt / 1000.0)


def _battery(message: Any) -> Incoming | None:
    if message.id != 0 or message.current_battery < 0:
        return None
    return Current(message.current_battery / 100.0)


def _landed_state(message: Any) -> Incoming:
    aloft = (
        mavlink.MAV_LANDED_STATE_IN_AIR,
        mavlink.MAV_LANDED_STATE_TAKEOFF,
        mavlink.MAV_LANDED_STATE_LANDING,
    )
    return Landed(message.landed_state in aloft)


def _answer(message: Any) -> Incoming:
    if message.result in (_ACCEPTED, _UNDER_WAY):
        return Answer(message.command, "")
    refusal = _RESULTS.get(message.result, f"it answers {message.result}")
    return Answer(message.command, refusal)


def _said(message: Any) -> Incoming:
    return Said(str(message.text))


_DECODERS: Mapping[str, Callable[[Any], Incoming | None]] = {
    "HEARTBEAT": _heartbeat,
    "ATTITUDE": _attitude,
    "GLOBAL_POSITION_INT": _position,
    "BATTERY_STATUS": _battery,
    "EXTENDED_SYS_STATE": _landed_state,
    "COMMAND_ACK": _answer,
    "STATUSTEXT": _said,
}
