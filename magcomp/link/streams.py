"""Asks a vehicle for message rates, and for the old ones back. No input or output happens here.

Rules
-----
1. First each message's present interval is asked for (MAV_CMD_GET_MESSAGE_INTERVAL), so
   that it can be restored; who does not answer gets its default back.
2. Intervals are set one at a time: COMMAND_ACK names the command, not the message.
3. A refusal or silence falls back to REQUEST_DATA_STREAM for the group the message is
   in. Nobody acknowledges that one, so it is sent twice; the measured rates tell.
4. A vehicle that rebooted, or a link opened again, is asked anew.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp import autopilots
from magcomp.errors import UsageError
from magcomp.link.framing import (
    GROUND_STATION_COMPONENT,
    GROUND_STATION_SYSTEM,
    Message,
)
from magcomp.mavlink.commands import command_long, every
from magcomp.model import Vehicle

DEFAULT_RATES: Mapping[str, float] = MappingProxyType(
    {
        "RAW_IMU": 50.0,
        "SCALED_IMU2": 50.0,
        "SCALED_IMU3": 50.0,
        "ATTITUDE": 50.0,
        "VFR_HUD": 20.0,
        "BATTERY_STATUS": 10.0,
        "SERVO_OUTPUT_RAW": 10.0,
        "SYS_STATUS": 2.0,
        "GLOBAL_POSITION_INT": 2.0,
    }
)
"""Hz of what a fit needs. Compasses are read at 10 Hz; faster streams tell when."""

_GROUPS = {
    "RAW_IMU": mavlink.MAV_DATA_STREAM_RAW_SENSORS,
    "SCALED_IMU": mavlink.MAV_DATA_STREAM_RAW_SENSORS,
    "SCALED_IMU2": mavlink.MAV_DATA_STREAM_RAW_SENSORS,
    "SCALED_IMU3": mavlink.MAV_DATA_STREAM_RAW_SENSORS,
    "SYS_STATUS": mavlink.MAV_DATA_STREAM_EXTENDED_STATUS,
    "SERVO_OUTPUT_RAW": mavlink.MAV_DATA_STREAM_RC_CHANNELS,
    "GLOBAL_POSITION_INT": mavlink.MAV_DATA_STREAM_POSITION,
    "ATTITUDE": mavlink.MAV_DATA_STREAM_EXTRA1,
    "VFR_HUD": mavlink.MAV_DATA_STREAM_EXTRA2,
    "BATTERY_STATUS": mavlink.MAV_DATA_STREAM_EXTRA3,
    # A simulation's truth, which demonstrations compare with; no fit ever sees it.
    "SIMSTATE": mavlink.MAV_DATA_STREAM_EXTRA1,
    "HIL_STATE_QUATERNION": mavlink.MAV_DATA_STREAM_EXTRA1,
}
"""ArduPilot's stream groups of the messages that can be asked for."""

_IDS = {
    message.msgname: number
    for number, message in mavlink.mavlink_map.items()
    if message.msgname in _GROUPS
}
_FIRST_COMPASS = "RAW_IMU"
_FRAME_OVERHEAD = 12
_USABLE_SHARE = 0.7
_LEAST_HZ = 1.0
_TIMEOUT_S = 0.6
_TRIES = 5
_STREAM_REPEATS = 2


class How(Enum):
    """The way a message's rate was asked for."""

    PENDING = "pending"
    INTERVAL = "interval"
    STREAM = "stream"


@dataclass(frozen=True)
class StreamReport:
    """How each message was asked for.

    Attributes
    ----------
    requested
        Message name to Hz.
    how
        Message name to the way that worked, or the last tried.
    previous_us
        Message name to the interval in µs found before; -1 was off. Unanswered names are missing.
    complete
        Every request was answered, or given up.
    """

    requested: Mapping[str, float]
    how: Mapping[str, How]
    previous_us: Mapping[str, int]
    complete: bool


def as_sent_by(vehicle: Vehicle, rates: Mapping[str, float]) -> Mapping[str, float]:
    """The same rates, for the message in which this vehicle sends its first compass."""
    first = autopilots.of(vehicle).first_compass_message
    return {first if name == _FIRST_COMPASS else name: rate for name, rate in rates.items()}


def affordable(rates: Mapping[str, float], bytes_per_s: float) -> Mapping[str, float]:
    """Slow all ``rates`` alike until they fit a line of ``bytes_per_s``.

    No rate goes below 1 Hz, or below what was asked where that is less.
    """
    need = sum(
        rate * (mavlink.mavlink_map[_IDS[name]].unpacker.size + _FRAME_OVERHEAD)
        for name, rate in rates.items()
    )
    share = min(1.0, _USABLE_SHARE * bytes_per_s / need) if need else 1.0
    return {name: max(rate * share, min(rate, _LEAST_HZ)) for name, rate in rates.items()}


@dataclass
class _Question:
    """A command on its way: what it is about, tries so far, and when to try again."""

    name: str
    tries: int = 0
    next_try: float = -math.inf


class StreamControl:
    """Brings one vehicle's message rates to what is wanted, and back.

    Parameters
    ----------
    to
        System and component of the vehicle.
    source_system
        The number this ground station gives itself.
    """

    def __init__(self, to: tuple[int, int], source_system: int = GROUND_STATION_SYSTEM) -> None:
        self._to = to
        self._us = source_system
        self._wanted: dict[str, float] = {}
        self._how: dict[str, How] = {}
        self._previous_us: dict[str, int] = {}
        self._previous_hz: dict[str, float] = {}
        self._restoring = False
        self._asking: dict[str, _Question] = {}
        self._setting: list[_Question] = []
        self._streams: list[_Question] = []

    @property
    def idle(self) -> bool:
        """Nothing is on its way."""
        return not (self._asking or self._setting or self._streams)

    @property
    def wanted(self) -> Mapping[str, float]:
        """Message name to the Hz that shall come; empty once the old rates are given back."""
        return {} if self._restoring else self._wanted

    @property
    def report(self) -> StreamReport:
        """How things stand."""
        return StreamReport(
            MappingProxyType(dict(self._wanted)),
            MappingProxyType(dict(self._how)),
            MappingProxyType(dict(self._previous_us)),
            self.idle,
        )

    def request(self, rates: Mapping[str, float], measured: Mapping[str, float]) -> None:
        """Want ``rates`` (message name to Hz) from now on.

        ``measured`` are the rates seen before, to go back to where intervals are unknown.

        Raises
        ------
        UsageError
            A message that magcomp does not stream, or a rate that is not above 0.
        """
        for name, rate in rates.items():
            if name not in _IDS or not rate > 0:
                raise UsageError(
                    f"A stream must be one of {', '.join(_IDS)} at a rate above 0; "
                    f"instead received {name} at {rate:g} Hz."
                )
        for name in rates:
            if name not in self._previous_us and not self._restoring:
                self._asking[name] = _Question(name)
                self._previous_hz.setdefault(name, measured.get(name, 0.0))
        self._restoring = False
        self._wanted.update(rates)
        self.repeat()

    def repeat(self) -> None:
        """Ask anew for what is wanted, because the vehicle may have forgotten it."""
        if self._restoring:
            return
        self._how = dict.fromkeys(self._wanted, How.PENDING)
        self._setting = [_Question(name) for name in self._wanted]
        self._streams = []

    def restore(self) -> None:
        """Give every message its previous interval back."""
        self._restoring = True
        self._asking.clear()
        self._streams = [_Question(name) for name, how in self._how.items() if how is How.STREAM]
        self._setting = [
            _Question(name) for name, how in self._how.items() if how is not How.STREAM
        ]

    def heard(self, message: Message) -> None:
        """Take an answer of the vehicle."""
        kind = message.get_type()
        if kind == "MESSAGE_INTERVAL":
            self._take_interval(message)
        elif kind == "COMMAND_ACK" and _is_for(self._us, message):
            self._take_ack(message)

    def due(self, now: float) -> list[Message]:
        """Questions and commands to send now."""
        out = []
        for question in list(self._asking.values()):
            if self._spent(question, now, _TRIES):
                del self._asking[question.name]
            elif _try_now(question, now):
                out.append(self._get(question.name))
        if not self._asking:
            out += self._due_settings(now)
        out += self._due_streams(now)
        return out

    def _due_settings(self, now: float) -> list[Message]:
        while self._setting:
            question = self._setting[0]
            if not self._spent(question, now, _TRIES):
                return [self._set(question.name)] if _try_now(question, now) else []
            self._fall_back()
        return []

    def _due_streams(self, now: float) -> list[Message]:
        out = []
        for question in list(self._streams):
            if self._spent(question, now, _STREAM_REPEATS):
                self._streams.remove(question)
            elif _try_now(question, now):
                out.append(self._stream(question.name))
        return out

    def _fall_back(self) -> None:
        question = self._setting.pop(0)
        if not self._restoring:
            self._how[question.name] = How.STREAM
            self._streams.append(_Question(question.name))

    @staticmethod
    def _spent(question: _Question, now: float, tries: int) -> bool:
        return question.tries >= tries and now >= question.next_try

    def _take_interval(self, message: Message) -> None:
        for name in list(self._asking):
            if _IDS[name] == message.message_id:
                del self._asking[name]
                if message.interval_us != 0:  # 0: the vehicle does not know
                    self._previous_us[name] = message.interval_us

    def _take_ack(self, message: Message) -> None:
        if message.command == mavlink.MAV_CMD_GET_MESSAGE_INTERVAL:
            if message.result not in (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS):
                self._asking.clear()
        elif message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL and self._setting:
            if self._setting[0].tries == 0 or message.result == mavlink.MAV_RESULT_IN_PROGRESS:
                return
            if message.result == mavlink.MAV_RESULT_ACCEPTED:
                self._how[self._setting.pop(0).name] = How.INTERVAL
            elif message.result != mavlink.MAV_RESULT_TEMPORARILY_REJECTED:
                self._fall_back()

    def _get(self, name: str) -> Message:
        return command_long(self._to, mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, _IDS[name])

    def _set(self, name: str) -> Message:
        if self._restoring:
            interval = float(self._previous_us.get(name, 0))  # 0: the vehicle's default
        else:
            interval = 1e6 / self._wanted[name]
        return every(self._to, _IDS[name], interval)

    def _stream(self, name: str) -> Message:
        rate = self._previous_hz[name] if self._restoring else self._wanted[name]
        hz = math.ceil(rate - 0.5) if self._restoring else math.ceil(rate)
        return mavlink.MAVLink_request_data_stream_message(
            *self._to, _GROUPS[name], hz, 1 if hz > 0 else 0
        )


def _try_now(question: _Question, now: float) -> bool:
    if now < question.next_try:
        return False
    question.tries += 1
    question.next_try = now + _TIMEOUT_S
    return True


def _is_for(us: int, message: Message) -> bool:
    """Tell whether an acknowledgement is ours; 0 is from firmware that does not say."""
    return message.target_system in (0, us) and message.target_component in (
        0,
        GROUND_STATION_COMPONENT,
    )
