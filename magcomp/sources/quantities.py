"""The quantities of a Recording from the columns of its messages, in the model's units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from magcomp.mavlink.heartbeat import is_armed
from magcomp.mavlink.messages import Message, Table, text
from magcomp.mavlink.parameters import decode_values, encoding
from magcomp.mavlink.version import board_name, firmware_version, number_in_line, unique_id
from magcomp.model import FloatArray, ParameterChange, Series

STANDARD_GRAVITY = 9.80665
OUTPUTS = 16

_ABSENT_CURRENT = -1
_ABSENT_UINT16 = 0xFFFF
_SHORTEST_US, _LONGEST_US = 800.0, 2200.0
_A_MESSAGE = 4
_CONTROLLERS = (
    Message.ESC_TELEMETRY_1_TO_4,
    Message.ESC_TELEMETRY_5_TO_8,
    Message.ESC_TELEMETRY_9_TO_12,
)
_FULL_THROTTLE = 100
_FIX_3D = 3
_NEITHER, _HOVERS = 0, 3
"""EXTENDED_SYS_STATE.vtol_state of a vehicle that has no two phases, and of one that hovers."""

_SIMULATION_PREFIX = "SIM_"

# "ArduCopter V4.6.3 (92b0cd78)", "APM:Copter V3.4-dev (bdddfae5)"
_BANNER = re.compile(r"^(?:Ardu|APM:)\w+ V(\d+\.\d+(?:\.\d+)?[\w.-]*)")


class Timed(NamedTuple):
    """A message's columns in order of time; both shape (n,)."""

    time: FloatArray
    table: Table


Messages = Mapping[int, Timed]


def columns(table: Table, *names: str) -> FloatArray:
    """Some fields side by side, shape (n, number of names)."""
    result = np.empty((len(table), len(names)))
    # A signalling NaN becomes a quiet one, and no warning.
    with np.errstate(invalid="ignore"):
        for index, name in enumerate(names):
            result[:, index] = table[name]
    return result


def field(messages: Messages) -> dict[int, Series]:
    """Each compass's field in mGauss by compass number; (0, 0, 0) means that none was read."""
    first = Message.RAW_IMU if Message.RAW_IMU in messages else Message.SCALED_IMU
    found = {}
    for compass, message in enumerate((first, Message.SCALED_IMU2, Message.SCALED_IMU3), start=1):
        if message in messages:
            time, table = messages[message]
            value = columns(table, "xmag", "ymag", "zmag")
            series = _series(time, value, (value != 0).any(axis=1))
            if series is not None:
                found[compass] = series
    return found


def gyro(messages: Messages) -> Series | None:
    """Body rates in rad/s from mrad/s."""
    return _first_imu(messages, ("xgyro", "ygyro", "zgyro"), 1e-3)


def accel(messages: Messages) -> Series | None:
    """Specific force in m/s² from thousandths of standard gravity."""
    return _first_imu(messages, ("xacc", "yacc", "zacc"), STANDARD_GRAVITY / 1000)


def attitude(messages: Messages) -> Series | None:
    """Roll, pitch, yaw in radians; rows that are not finite are left out."""
    if Message.ATTITUDE not in messages:
        return None
    time, table = messages[Message.ATTITUDE]
    value = columns(table, "roll", "pitch", "yaw")
    return _series(time, value, np.isfinite(value).all(axis=1))


def throttle(messages: Messages) -> Series | None:
    """Thrust demand 0 … 1 from whole per cent; more than 100 % means that it is not known."""
    if Message.VFR_HUD not in messages:
        return None
    time, table = messages[Message.VFR_HUD]
    percent = table["throttle"]
    return _series(time, percent / float(_FULL_THROTTLE), percent <= _FULL_THROTTLE)


def current(messages: Messages) -> Series | None:
    """Amperes of the first battery from units of 10 mA."""
    return _fuller(
        _first_battery(messages, "current_battery"), _system_status(messages, "current_battery")
    )


def other_currents(messages: Messages) -> dict[int, Series]:
    """Amperes of each battery beside the first, by its number; empty where there is no first.

    A battery that is alone under another number is the first one.
    """
    if Message.BATTERY_STATUS not in messages:
        return {}
    time, table = messages[Message.BATTERY_STATUS]
    numbers = table["id"]
    if not (numbers == 0).any():
        return {}
    found = {}
    for number in np.flatnonzero(np.bincount(numbers))[1:].tolist():
        rows = np.flatnonzero(numbers == number)
        amperes = table["current_battery"][rows]
        series = _series(time[rows], amperes / 100.0, amperes != _ABSENT_CURRENT)
        if series is not None:
            found[number] = series
    return found


def armed(table: Table) -> FloatArray:
    """1 armed, 0 disarmed for each heartbeat, shape (n,)."""
    state = np.array([is_armed(mode) for mode in range(256)], dtype=np.float64)
    return np.asarray(state[table["base_mode"]])


def forward(messages: Messages) -> Series | None:
    """1 where a VTOL flies on its wings or is in transition; None of any other vehicle.

    It is told about once a second: a row whose next one differs counts as on the way already.
    """
    if Message.EXTENDED_SYS_STATE not in messages:
        return None
    time, table = messages[Message.EXTENDED_SYS_STATE]
    rows = table["vtol_state"] != _NEITHER
    away = table["vtol_state"][rows] != _HOVERS
    away[:-1] |= away[1:]
    return Series(time[rows], away.astype(np.float64)) if rows.any() else None


def voltage(messages: Messages) -> Series | None:
    """Volts of the first battery from millivolts."""
    return _fuller(_cell_sum(messages), _system_status(messages, "voltage_battery"))


def outputs(messages: Messages) -> Series | None:
    """Servo outputs in microseconds, shape (n, 16); MAVLink 1 has the first eight."""
    whole = None
    if Message.SERVO_OUTPUT_RAW in messages:
        time, table = messages[Message.SERVO_OUTPUT_RAW]
        value = columns(table, *(f"servo{n}_raw" for n in range(1, OUTPUTS + 1)))
        value[value == _ABSENT_UINT16] = 0
        whole = _series(time, value, table["port"] == 0)
    return _fuller(_actuator_outputs(messages), whole)


def _actuator_outputs(messages: Messages) -> Series | None:
    """The same as PX4 tells them, not rounded; rows that are no widths of pulses are left out."""
    if Message.ACTUATOR_OUTPUT_STATUS not in messages:
        return None
    time, table = messages[Message.ACTUATOR_OUTPUT_STATUS]
    with np.errstate(invalid="ignore"):
        value = np.array(table["actuator"][:, :OUTPUTS], dtype=np.float64)
    pulses = (value >= _SHORTEST_US) & (value <= _LONGEST_US)
    value[~pulses] = 0.0
    return _series(time, value, pulses.any(axis=1))


def esc_currents(messages: Messages) -> dict[int, Series]:
    """Current of each speed controller, A from 10 mA, by its output, counted from 0."""
    found = {}
    for place, message in enumerate(_CONTROLLERS):
        if message not in messages:
            continue
        time, table = messages[message]
        for column in range(_A_MESSAGE):
            amperes = table["current"][:, column] / 100.0
            if amperes.any():
                found[_A_MESSAGE * place + column] = Series(time, amperes)
    return found


def position(messages: Messages) -> Series | None:
    """Latitude and longitude in degrees, altitude in m, of the estimate or else of the GPS."""
    if Message.GLOBAL_POSITION_INT in messages:
        time, table = messages[Message.GLOBAL_POSITION_INT]
        known = (table["lat"] != 0) | (table["lon"] != 0)
        series = _series(time, _degrees_and_metres(table), known)
        if series is not None:
            return series
    if Message.GPS_RAW_INT not in messages:
        return None
    time, table = messages[Message.GPS_RAW_INT]
    return _series(time, _degrees_and_metres(table), table["fix_type"] >= _FIX_3D)


def parameters(messages: Messages, autopilot: str, simulation: bool) -> list[ParameterChange]:
    """Every value reported, in order of time. Not finite ones stay: they are refused by name.

    Parameters
    ----------
    messages
        One vehicle's messages.
    autopilot
        As in ``Vehicle.autopilot``.
    simulation
        True for the SIM_* parameters alone, False for all others.
    """
    if Message.PARAM_VALUE not in messages:
        return []
    time, table = messages[Message.PARAM_VALUE]
    simulated = _begin_with(table["param_id"], _SIMULATION_PREFIX)
    rows = simulated if simulation else ~simulated
    if not rows.all():
        time, table = time[rows], table[rows]
    how = encoding(autopilot, capabilities(messages))
    value = decode_values(table["param_value"], table["param_type"], how)
    each = zip(time.tolist(), text(table["param_id"]), value.tolist(), strict=True)
    # Nothing here is a Python call for each of a log's thousand parameters.
    return list(map(tuple.__new__, repeat(ParameterChange), each))


def _begin_with(names: NDArray[np.bytes_], prefix: str) -> NDArray[np.bool_]:
    """Which of some names of a fixed width begin so, shape (n,)."""
    wanted = np.frombuffer(prefix.encode("ascii"), np.uint8)
    letters = np.ascontiguousarray(names).view(np.uint8).reshape(len(names), -1)
    return np.asarray((letters[:, : len(wanted)] == wanted).all(axis=1))


def holds_whole_list(messages: Messages) -> bool:
    """Whether every place of the vehicle's parameter list was reported."""
    if Message.PARAM_VALUE not in messages:
        return False
    table = messages[Message.PARAM_VALUE].table
    listed = table[table["param_index"] < table["param_count"]]
    if not len(listed):
        return False
    count = listed["param_count"][-1]
    places = np.unique(listed["param_index"][listed["param_count"] == count])
    return len(places) == int(count)


def capabilities(messages: Messages) -> int:
    """AUTOPILOT_VERSION.capabilities as last reported; 0 where it was not."""
    if Message.AUTOPILOT_VERSION not in messages:
        return 0
    return int(messages[Message.AUTOPILOT_VERSION].table["capabilities"][-1])


def board(messages: Messages) -> str:
    """The kind of flight controller; empty where it was not reported."""
    if Message.AUTOPILOT_VERSION not in messages:
        return ""
    return board_name(int(messages[Message.AUTOPILOT_VERSION].table["board_version"][-1]))


def uid(messages: Messages) -> str:
    """The flight controller's own number in hexadecimal; empty where it was not reported."""
    if Message.AUTOPILOT_VERSION in messages:
        row = messages[Message.AUTOPILOT_VERSION].table[-1]
        if number := unique_id(row["uid2"].tobytes(), int(row["uid"])):
            return number
    if Message.STATUSTEXT in messages:
        for line in reversed(text(messages[Message.STATUSTEXT].table["text"])):
            if number := number_in_line(line):
                return number
    return ""


def firmware(messages: Messages) -> str:
    """Version such as "4.6.3" as last reported; empty where it was not."""
    if Message.AUTOPILOT_VERSION in messages:
        packed = messages[Message.AUTOPILOT_VERSION].table["flight_sw_version"][-1]
        if version := firmware_version(int(packed)):
            return version
    if Message.STATUSTEXT in messages:
        for line in reversed(text(messages[Message.STATUSTEXT].table["text"])):
            banner = _BANNER.match(line)
            if banner:
                return banner.group(1)
    return ""


def unix_offset(messages: Messages) -> float:
    """Unix time of time zero by the vehicle's own calendar; NaN where it has none."""
    if Message.SYSTEM_TIME not in messages:
        return float("nan")
    time, table = messages[Message.SYSTEM_TIME]
    known = table["time_unix_usec"] > 0
    if not known.any():
        return float("nan")
    return float(np.median(table["time_unix_usec"][known] / 1e6 - time[known]))


def _series(time: FloatArray, value: FloatArray, rows: Any) -> Series | None:
    if rows.all() and len(rows):
        return Series(time, value)
    return Series(time[rows], value[rows]) if rows.any() else None


def _first_imu(messages: Messages, names: tuple[str, ...], unit: float) -> Series | None:
    for message in (Message.RAW_IMU, Message.SCALED_IMU):
        if message in messages:
            time, table = messages[message]
            return Series(time, columns(table, *names) * unit)
    return None


def _degrees_and_metres(table: Table) -> FloatArray:
    return columns(table, "lat", "lon", "alt") * (1e-7, 1e-7, 1e-3)


def _first_battery(messages: Messages, name: str) -> Series | None:
    if Message.BATTERY_STATUS not in messages:
        return None
    time, table = messages[Message.BATTERY_STATUS]
    rows = _is_first(table) & (table[name] != _ABSENT_CURRENT)
    return _series(time, table[name] / 100.0, rows)


def _is_first(table: Table) -> NDArray[np.bool_]:
    """Battery 0, or the only one there is: a simulation's may have another number."""
    first = table["id"] == 0
    if not first.any() and len(table) and (table["id"] == table["id"][0]).all():
        first[:] = True
    return np.asarray(first)


def _system_status(messages: Messages, name: str) -> Series | None:
    if Message.SYS_STATUS not in messages:
        return None
    time, table = messages[Message.SYS_STATUS]
    if name == "current_battery":
        return _series(time, table[name] / 100.0, table[name] != _ABSENT_CURRENT)
    return _series(time, table[name] / 1000.0, table[name] != _ABSENT_UINT16)


def _cell_sum(messages: Messages) -> Series | None:
    if Message.BATTERY_STATUS not in messages:
        return None
    time, table = messages[Message.BATTERY_STATUS]
    cells: NDArray[Any] = table["voltages"]
    present = cells != _ABSENT_UINT16
    total = np.where(present, cells, 0).sum(axis=1) + table["voltages_ext"].sum(axis=1)
    return _series(time, total / 1000.0, _is_first(table) & present.any(axis=1))


def _fuller(first: Series | None, second: Series | None) -> Series | None:
    """The series with more rows; the first where both have as many."""
    if first is None or second is None:
        return first or second
    return first if len(first) >= len(second) else second
