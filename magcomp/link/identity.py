"""Who is on the link: autopilots found by their heartbeats, then asked for the rest."""

from __future__ import annotations

import re

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp import autopilots
from magcomp.link.framing import Message
from magcomp.mavlink.commands import command_long
from magcomp.mavlink.header import payload
from magcomp.mavlink.heartbeat import Identity, identify
from magcomp.mavlink.parameters import decode_param_value, encoding
from magcomp.mavlink.version import board_name, firmware_version, unique_id
from magcomp.model import Vehicle

_BANNER = re.compile(r"\bV(\d+\.\d+\.\d+)")
_RETRY_S = 0.4
_TRIES = 8
_MOST_TRIES = 40


def read_heartbeat(message: Message) -> Identity | None:
    """Read an autopilot's heartbeat; None for ground stations, gimbals and the like."""
    return identify(
        message.get_srcSystem(), message.get_srcComponent(), message.type, message.autopilot
    )


class Identification:
    """Learns a vehicle's firmware, board and compasses, asking for what does not come by itself.

    Asking is PARAM_REQUEST_READ and MAV_CMD_REQUEST_MESSAGE only. ArduPilot does not
    answer for parameters it does not have, so after eight tries nobody waits for the rest; a link
    that loses much may bring it later.
    """

    def __init__(self, heartbeat: Identity) -> None:
        self._heartbeat = heartbeat
        self._firmware = ""
        self._board = ""
        self._uid = ""
        self._version_known = False
        self._capabilities = 0
        self._device_ids: dict[str, bytes] = {}
        self._tries = 0
        self._next_try = 0.0

    @property
    def vehicle(self) -> Vehicle:
        """Everything known so far."""
        how = encoding(self._heartbeat.autopilot, self._capabilities)
        values = {
            name: _whole(decode_param_value(sent, how).value)
            for name, sent in self._device_ids.items()
        }
        return Vehicle(
            autopilot=self._heartbeat.autopilot,
            kind=self._heartbeat.kind,
            system=self._heartbeat.system,
            component=self._heartbeat.component,
            firmware=self._firmware,
            compasses=autopilots.named(self._heartbeat.autopilot).compasses(values),
            board=self._board,
            capabilities=self._capabilities,
            uid=self._uid,
        )

    def complete(self, now: float) -> bool:
        """Tell whether everything is known, or has been asked for often enough."""
        asked_enough = self._tries >= _TRIES and now >= self._next_try
        return self._is_all_known() or asked_enough or self._tries > _TRIES

    def heard(self, message: Message) -> None:
        """Learn from any message of the vehicle."""
        kind = message.get_type()
        if kind == "AUTOPILOT_VERSION":
            self._version_known = True
            self._capabilities = message.capabilities
            self._firmware = firmware_version(message.flight_sw_version) or self._firmware
            self._uid = unique_id(bytes(message.uid2), message.uid)
            self._board = board_name(message.board_version)
        elif kind == "STATUSTEXT" and not self._firmware:
            banner = _BANNER.search(message.text)
            self._firmware = banner[1] if banner else ""
        elif kind == "PARAM_VALUE" and message.param_id in self._known_names():
            # Decoded when somebody asks: how it travels may become known later.
            self._device_ids[message.param_id] = payload(bytes(message.get_msgbuf()))

    def due(self, now: float) -> list[Message]:
        """Questions to send now."""
        if now < self._next_try or self._tries >= _MOST_TRIES or self._is_all_known():
            return []
        self._tries += 1
        self._next_try = now + _RETRY_S
        to = (self._heartbeat.system, self._heartbeat.component)
        questions = [
            mavlink.MAVLink_param_request_read_message(*to, name.encode(), -1)
            for name in self._missing_ids()
        ]
        if not self._version_known:
            version = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
            questions.append(command_long(to, mavlink.MAV_CMD_REQUEST_MESSAGE, version))
        return questions

    def _is_all_known(self) -> bool:
        return self._version_known and not self._missing_ids()

    def _known_names(self) -> tuple[str, ...]:
        return autopilots.named(self._heartbeat.autopilot).device_id_names

    def _missing_ids(self) -> list[str]:
        return [name for name in self._known_names() if name not in self._device_ids]


def _whole(value: float) -> int:
    """A device id from a parameter's value; 0 where it cannot be one."""
    return round(value) if abs(value) < 2**32 else 0
