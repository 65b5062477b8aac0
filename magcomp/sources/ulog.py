"""Read a PX4 log (.ulg)."""

from __future__ import annotations

import math
import re
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from magcomp import autopilots
from magcomp.errors import LogError
from magcomp.mavlink.heartbeat import KINDS
from magcomp.mavlink.version import firmware_version, unique_id
from magcomp.model import ParameterChange, ParameterHistory, ReadReport, Recording, Vehicle
from magcomp.sources.source import mapped
from magcomp.sources.ulog_compasses import Compasses
from magcomp.sources.ulog_file import MICROSECOND, UlogFile, read_ulog_file
from magcomp.sources.ulog_quantities import Quantities

_MAGIC = b"ULog\x01\x12\x35"
_AUTOPILOT = "px4"
_SYSTEM_NAMES = ("MAV_SYS_ID", "MAV_COMP_ID", "MAV_TYPE")
_ROTARY = 1
_ATTITUDE = "vehicle_attitude"

TOPICS = (
    "actuator_armed",
    "actuator_controls_0",
    "actuator_motors",
    "actuator_outputs",
    "battery_status",
    "esc_status",
    "sensor_combined",
    "sensor_gps",
    "sensor_mag",
    "vehicle_acceleration",
    "vehicle_angular_velocity",
    _ATTITUDE,
    "vehicle_global_position",
    "vehicle_gps_position",
    "vehicle_magnetometer",
    "vehicle_status",
    "vehicle_thrust_setpoint",
)

# "[logger] /fs/microsd/log/2026-03-09/11_02_35.ulg" names the file by the vehicle's calendar.
_NAMED_BY_DATE = re.compile(r"/(\d{4})-(\d\d)-(\d\d)/(\d\d)_(\d\d)_(\d\d)\w*\.ulg")
_EARLIEST_UNIX_S = 1.0e9


def recognises(head: bytes) -> bool:
    """Tell from first bytes whether a file is a PX4 log."""
    return head.startswith(_MAGIC)


def read_ulog(path: str | Path) -> Recording:
    """Read what a vehicle logged of its compasses, motors, attitude and parameters.

    Parameters
    ----------
    path
        A log of PX4.

    Returns
    -------
    Recording
        Compass n + 1 is that of the calibration slot n, whichever topic instance it has.
        ``raw_compasses`` names those whose field is the sensor's own, turned into body axes; that
        of the others is the corrected one.

    Raises
    ------
    LogError
        The file cannot be read, or holds no message that is used here.
    """
    with mapped(path) as data:
        octets = data.tobytes()
    log = read_ulog_file(octets, str(path), TOPICS)
    if not log.topics:
        raise LogError(
            f"Log {path} must hold messages of a vehicle; instead received a PX4 log without one "
            "of those needed: was logging stopped at once?"
        )
    zero = min(log.start, *(int(topic.columns["timestamp"][0]) for topic in log.topics.values()))
    last = max(int(topic.columns["timestamp"][-1]) for topic in log.topics.values())
    parameters = _parameters(log, zero)
    values = parameters.latest
    version = firmware_version(log.number("ver_sw_release"))
    quantities = Quantities(log, zero, version, values)
    armed = quantities.armed()
    compasses = Compasses(log, zero, parameters, armed).fields()
    batteries = quantities.currents()
    battery = quantities.battery(batteries)
    attitude = quantities.attitude()
    return Recording(
        source=str(path),
        vehicle=_vehicle(log, values, version),
        start_unix_s=_start(log, quantities.start_unix_s(), zero),
        duration_s=(last - zero) * MICROSECOND,
        field={number: each.field for number, each in compasses.items()},
        parameters=parameters,
        report=ReadReport(
            size=len(octets), frames=sum(map(len, log.topics.values())), used=quantities.rows()
        ),
        attitude=attitude,
        attitude_source="" if attitude is None else _ATTITUDE,
        gyro=quantities.gyro(),
        accel=quantities.accel(),
        throttle=quantities.throttle(),
        current=batteries.get(battery),
        voltage=quantities.voltage(battery),
        outputs=quantities.outputs(),
        position=quantities.position(),
        armed=armed,
        format="ulog",
        battery=battery,
        esc_currents=quantities.esc_currents(),
        forward=quantities.forward(),
        other_currents={n: each for n, each in batteries.items() if n != battery},
        raw_compasses=frozenset(n for n, each in compasses.items() if each.raw),
    )


def _parameters(log: UlogFile, zero: int) -> ParameterHistory:
    """The values at the beginning at time 0, and each one set later."""
    initial = (ParameterChange(0.0, name, value) for name, value in log.initial.items())
    later = (
        ParameterChange(max(time - zero, 0) * MICROSECOND, name, value)
        for time, name, value in log.changed
    )
    return ParameterHistory((*initial, *later), whole=bool(log.initial))


def _vehicle(log: UlogFile, values: dict[str, float], version: str) -> Vehicle:
    system, component, kind = (_whole(values.get(name, 0.0)) for name in _SYSTEM_NAMES)
    status = log.topic("vehicle_status", "vehicle_type")
    if KINDS.get(kind, "unknown") == "unknown" and status is not None:
        rotary = bool(np.median(status.number("vehicle_type")) == _ROTARY)
        named = "copter" if rotary else "unknown"
    else:
        named = KINDS.get(kind, "unknown")
    return Vehicle(
        autopilot=_AUTOPILOT,
        kind=named,
        system=system or 1,
        component=component or 1,
        firmware=version,
        compasses=autopilots.named(_AUTOPILOT).compasses(values),
        board=str(log.info.get("ver_hw", "")),
        uid=_uid(str(log.info.get("sys_uuid", ""))),
    )


def _whole(value: float) -> int:
    return int(value) if math.isfinite(value) else 0


def _uid(text: str) -> str:
    try:
        return unique_id(bytes.fromhex(text), 0)
    except ValueError:
        return ""


def _start(log: UlogFile, by_satellite: float, zero: int) -> float:
    """Unix time of time zero by satellite, else as the file was named on the vehicle."""
    if np.isfinite(by_satellite):
        return by_satellite
    for message in log.messages:
        if date := _NAMED_BY_DATE.search(message):
            return _unix_s(*(int(part) for part in date.groups()))
    booted = log.number("boot_time_utc_us")
    return (booted + zero) * MICROSECOND if booted else float("nan")


def _unix_s(year: int, month: int, day: int, hour: int, minute: int, second: int) -> float:
    try:
        start = datetime(year, month, day, hour, minute, second, tzinfo=UTC).timestamp()
    except ValueError:
        return float("nan")
    return start if start > _EARLIEST_UNIX_S else float("nan")
