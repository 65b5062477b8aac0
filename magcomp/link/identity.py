"""Who is on the link: autopilots found by their heartbeats, then asked for the rest."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.link.framing import Message
from magcomp.model import Vehicle
from magcomp.sources.vehicles import AUTOPILOTS, KINDS

_DEVICE_ID_NAMES = {
    "ardupilot": ("COMPASS_DEV_ID", "COMPASS_DEV_ID2", "COMPASS_DEV_ID3"),
    "px4": ("CAL_MAG0_ID", "CAL_MAG1_ID", "CAL_MAG2_ID"),
}
_BANNER = re.compile(r"\bV(\d+\.\d+\.\d+)")
_RETRY_S = 0.4
_TRIES = 8


@dataclass(frozen=True)
class Heartbeat:
    """What an autopilot's HEARTBEAT says of it.

    Attributes
    ----------
    system, component
        MAVLink identity.
    autopilot
        ``"ardupilot"`` or ``"px4"``.
    kind
        As in Vehicle.
    """

    system: int
    component: int
    autopilot: str
    kind: str


def read_heartbeat(message: Message) -> Heartbeat | None:
    """Read an autopilot's heartbeat; None for ground stations, gimbals and the like."""
    autopilot = AUTOPILOTS.get(message.autopilot)
    if autopilot is None or message.type == mavlink.MAV_TYPE_GCS:
        return None
    return Heartbeat(
        message.get_srcSystem(),
        message.get_srcComponent(),
        autopilot,
        KINDS.get(message.type, "unknown"),
    )


class Identification:
    """Learns a vehicle's firmware, board and compasses, asking for what does not come by itself.

    Asking is PARAM_REQUEST_READ and MAV_CMD_REQUEST_MESSAGE only. ArduPilot does not
    answer for parameters it does not have, so after eight tries the rest stays unknown.
    """

    def __init__(self, heartbeat: Heartbeat) -> None:
        self._heartbeat = heartbeat
        self._firmware = ""
        self._board = ""
        self._version_known = False
        self._device_ids: dict[str, int] = {}
        self._tries = 0
        self._next_try = 0.0

    @property
    def vehicle(self) -> Vehicle:
        """Everything known so far."""
        names = _DEVICE_ID_NAMES[self._heartbeat.autopilot]
        ids = (self._device_ids.get(name, 0) for name in names)
        return Vehicle(
            autopilot=self._heartbeat.autopilot,
            kind=self._heartbeat.kind,
            system=self._heartbeat.system,
            component=self._heartbeat.component,
            firmware=self._firmware,
            device_ids=tuple(number for number in ids if number),
            board=self._board,
        )

    def complete(self, now: float) -> bool:
        """Tell whether everything is known, or further asking is hopeless."""
        if self._tries >= _TRIES and now >= self._next_try:
            return True
        return self._version_known and not self._missing_ids()

    def heard(self, message: Message) -> None:
        """Learn from any message of the vehicle."""
        kind = message.get_type()
        if kind == "AUTOPILOT_VERSION":
            self._version_known = True
            self._firmware = firmware_version(message.flight_sw_version) or self._firmware
            # ArduPilot: APJ board id in the upper half.
            self._board = f"board {message.board_version >> 16}" if message.board_version else ""
        elif kind == "STATUSTEXT" and not self._firmware:
            banner = _BANNER.search(message.text)
            self._firmware = banner[1] if banner else ""
        elif kind == "PARAM_VALUE" and message.param_id in self._known_names():
            self._device_ids[message.param_id] = _integer_value(message, self._heartbeat.autopilot)

    def due(self, now: float) -> list[Message]:
        """Questions to send now."""
        if now < self._next_try or self._tries >= _TRIES or self.complete(now):
            return []
        self._tries += 1
        self._next_try = now + _RETRY_S
        to = (self._heartbeat.system, self._heartbeat.component)
        questions = [
            mavlink.MAVLink_param_request_read_message(*to, name.encode(), -1)
            for name in self._missing_ids()
        ]
        if not self._version_known:
            questions.append(
                command(
                    to,
                    mavlink.MAV_CMD_REQUEST_MESSAGE,
                    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
                )
            )
        return questions

    def _known_names(self) -> tuple[str, ...]:
        return _DEVICE_ID_NAMES[self._heartbeat.autopilot]

    def _missing_ids(self) -> list[str]:
        return [name for name in self._known_names() if name not in self._device_ids]


def command(to: tuple[int, int], number: int, *parameters: float) -> Message:
    """Make a COMMAND_LONG; parameters left out are 0."""
    padded = (*parameters, *(0.0,) * (7 - len(parameters)))
    return mavlink.MAVLink_command_long_message(*to, number, 0, *padded)


def firmware_version(packed: int) -> str:
    """Unpack AUTOPILOT_VERSION.flight_sw_version: major, minor, patch, type; a byte each."""
    if not packed:
        return ""
    return f"{packed >> 24 & 255}.{packed >> 16 & 255}.{packed >> 8 & 255}"


def _integer_value(message: Message, autopilot: str) -> int:
    """Read an integer parameter: a float by ArduPilot, the same four bytes by PX4."""
    if autopilot == "px4":
        return int.from_bytes(struct.pack("<f", message.param_value), "little", signed=True)
    value = message.param_value
    return round(value) if abs(value) < 2**32 else 0
