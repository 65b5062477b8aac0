"""The newest of each message of every sender, decoded only when somebody looks."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from magcomp.mavlink.header import message_id, payload, source
from magcomp.mavlink.heartbeat import is_armed
from magcomp.mavlink.messages import WANTED, Message, decode_frame
from magcomp.mavlink.parameters import decode_param_value, encoding, name_and_field
from magcomp.model import Vehicle

_SENSOR_COMPASS = 0x04  # MAV_SYS_STATUS_SENSOR_3D_MAG
_FIRST_COMPASS = (Message.RAW_IMU, Message.SCALED_IMU)  # which of them depends on the firmware
_OTHER_COMPASSES = {2: Message.SCALED_IMU2, 3: Message.SCALED_IMU3}
_STALE_US = 2_000_000
_MOST_SENDERS = 64
_MOST_PARAMETERS = 8_000
"""Firmwares have some 1500; who sends more names than this invents them."""
_MILLI_G = 9.80665e-3

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Now:
    """What a vehicle last said.

    Attributes
    ----------
    stamp_us
        When its newest message arrived, microseconds since 1970; 0 before the first.
    armed
        None before the first heartbeat.
    fields
        What the first, second and third compass message hold, mGauss, where they came within two
        seconds: what that means, the autopilot knows (``Autopilot.from_telemetry``).
    silent
        Compass numbers whose field came before, but no more.
    attitude
        Roll, pitch, yaw in radians.
    throttle, current, voltage
        0 … 1, A, V; None where absent.
    height_m, speed
        Above home, or above where it was switched on; over the ground in m/s.
    compass_trouble
        The autopilot says that its compass is not healthy.
    accel
        Specific force in body axes, m/s², of the first IMU.
    current_sensor
        False where it says that it has none; None before it says anything of a battery.
    """

    stamp_us: int
    armed: bool | None
    fields: Mapping[int, Vector]
    silent: tuple[int, ...]
    attitude: Vector | None
    throttle: float | None
    current: float | None
    voltage: float | None
    height_m: float | None
    speed: float | None
    compass_trouble: bool
    accel: Vector | None = None
    current_sensor: bool | None = None


class Latest:
    """Takes every frame of a link and keeps the newest of each kind."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._frames: dict[tuple[int, int], dict[int, tuple[int, bytes]]] = {}
        self._parameters: dict[tuple[int, int], dict[bytes, bytes]] = {}
        self._first_us = 0
        self._last_us = 0

    def add(self, unix_us: int, frame: bytes) -> None:
        """Take one whole frame that arrived at ``unix_us``."""
        sender, message = source(frame), message_id(frame)
        with self._lock:
            self._first_us = self._first_us or unix_us
            self._last_us = unix_us
            if message not in WANTED or not _is_of_interest(message, frame):
                return
            if sender not in self._frames:
                self._make_room()
            self._frames.setdefault(sender, {})[message] = (unix_us, frame)
            if message == Message.PARAM_VALUE:
                self._keep(self._parameters.setdefault(sender, {}), payload(frame))

    @staticmethod
    def _keep(known: dict[bytes, bytes], sent: bytes) -> None:
        """Take a parameter's value; a flood of names must cost no memory either."""
        name = name_and_field(sent)[0]
        if name in known or len(known) < _MOST_PARAMETERS:
            known[name] = sent

    def _make_room(self) -> None:
        """Forget who has been silent longest: a flood of senders must cost no memory."""
        while len(self._frames) >= _MOST_SENDERS:
            silent = min(
                self._frames, key=lambda each: max(at for at, _ in self._frames[each].values())
            )
            del self._frames[silent]
            self._parameters.pop(silent, None)

    @property
    def span_s(self) -> float:
        """Seconds from the first frame to the newest."""
        with self._lock:
            return max(self._last_us - self._first_us, 0) * 1e-6

    def parameters(self, vehicle: Vehicle) -> Mapping[str, float]:
        """Every parameter value the vehicle has reported, by name."""
        with self._lock:
            sent = list(self._parameters.get((vehicle.system, vehicle.component), {}).values())
        how = encoding(vehicle.autopilot, vehicle.capabilities)
        values = (decode_param_value(each, how) for each in sent)
        return {value.name: value.value for value in values}

    def heartbeat_us(self, vehicle: Vehicle) -> int:
        """When its newest heartbeat arrived, microseconds since 1970; 0 before the first."""
        with self._lock:
            kept = self._frames.get((vehicle.system, vehicle.component), {})
            return kept[Message.HEARTBEAT][0] if Message.HEARTBEAT in kept else 0

    def now(self, vehicle: Vehicle) -> Now:
        """Decode what the vehicle last said."""
        with self._lock:
            kept = dict(self._frames.get((vehicle.system, vehicle.component), {}))
        newest = max((stamp for stamp, _ in kept.values()), default=0)
        rows = {
            message: decode_frame(frame, message)
            for message, (stamp, frame) in kept.items()
            if message in (Message.HEARTBEAT, Message.SYS_STATUS) or newest - stamp < _STALE_US
        }
        heartbeat = rows.get(Message.HEARTBEAT)
        attitude = rows.get(Message.ATTITUDE)
        hud = rows.get(Message.VFR_HUD)
        first = next((message for message in _FIRST_COMPASS if message in kept), Message.RAW_IMU)
        messages = {1: first, **_OTHER_COMPASSES}
        fields = {
            number: _vector(rows[message], ("xmag", "ymag", "zmag"))
            for number, message in messages.items()
            if message in rows
        }
        return Now(
            stamp_us=newest,
            armed=None if heartbeat is None else is_armed(int(heartbeat["base_mode"])),
            # A compass the autopilot does not have is reported as exactly (0, 0, 0).
            fields={number: field for number, field in fields.items() if any(field)},
            silent=tuple(
                number
                for number, message in messages.items()
                if message in kept and message not in rows
            ),
            attitude=None if attitude is None else _vector(attitude, ("roll", "pitch", "yaw")),
            throttle=None if hud is None else float(hud["throttle"]) * 0.01,
            current=_current(rows),
            voltage=_voltage(rows),
            height_m=_height(rows),
            speed=None if hud is None else _finite(hud["groundspeed"]),
            compass_trouble=_compass_trouble(rows.get(Message.SYS_STATUS)),
            accel=_accel(rows),
            current_sensor=_current_sensor(rows),
        )


def _is_of_interest(message: int, frame: bytes) -> bool:
    """Leave out second batteries: the compensation multiplies by the first."""
    return message != Message.BATTERY_STATUS or int(decode_frame(frame, message)["id"]) == 0


def _vector(row: Any, names: tuple[str, str, str]) -> Vector:
    x, y, z = (float(row[name]) for name in names)
    return x, y, z


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _current(rows: Mapping[int, Any]) -> float | None:
    """Amperes of battery 0; both messages count in 10 mA and say −1 where there is no sensor."""
    for message in (Message.BATTERY_STATUS, Message.SYS_STATUS):
        row = rows.get(message)
        if row is not None and row["current_battery"] >= 0:
            return float(row["current_battery"]) * 0.01
    return None


def _current_sensor(rows: Mapping[int, Any]) -> bool | None:
    if not {Message.BATTERY_STATUS, Message.SYS_STATUS} & rows.keys():
        return None
    return _current(rows) is not None


def _voltage(rows: Mapping[int, Any]) -> float | None:
    row = rows.get(Message.SYS_STATUS)
    if row is None or row["voltage_battery"] in (0, 0xFFFF):
        return None
    return float(row["voltage_battery"]) * 1e-3


def _height(rows: Mapping[int, Any]) -> float | None:
    position = rows.get(Message.GLOBAL_POSITION_INT)
    return None if position is None else float(position["relative_alt"]) * 1e-3


def _accel(rows: Mapping[int, Any]) -> Vector | None:
    """ArduPilot and PX4 send thousandths of standard gravity in both messages."""
    for message in (Message.RAW_IMU, Message.SCALED_IMU):
        if message in rows:
            x, y, z = _vector(rows[message], ("xacc", "yacc", "zacc"))
            return (x * _MILLI_G, y * _MILLI_G, z * _MILLI_G) if any((x, y, z)) else None
    return None


def _compass_trouble(row: Any) -> bool:
    if row is None:
        return False
    enabled = int(row["onboard_control_sensors_enabled"]) & _SENSOR_COMPASS
    healthy = int(row["onboard_control_sensors_health"]) & _SENSOR_COMPASS
    return bool(enabled and not healthy)
