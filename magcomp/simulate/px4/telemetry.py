"""One function a message: what PX4 knows, put into MAVLink's fields and units.

docs/autopilots.md, PX4: link. SCALED_IMU, SCALED_IMU2 and SCALED_IMU3 are the
sensors as they are, HIGHRES_IMU the one compass that is used, corrected and less what the
estimator has learned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.simulate.flight import GRAVITY
from magcomp.simulate.motion import euler
from magcomp.simulate.shared_telemetry import (
    ABSENT_VOLTAGE,
    BUILDERS,
    Known,
    cut,
    imu_fields,
    servo_output_raw,
    sys_status,
    vfr_hud,
)
from magcomp.simulate.truth import MOTORS

FloatArray = NDArray[np.float64]

_MGAUSS = 1000.0
_OUTPUTS = 16
_DISARMED_US, _LOW_US, _SPAN_US = 900, 1000.0, 1000.0
_SENSORS = (35684397, 35749933, 840990783)
_LOAD = 300
_ESTIMATOR_FLAGS = 895
_TEMPERATURE = 2500
_EVERYTHING_NEW, _IMU_NEW = 7167, 63
_IN_AIR, _ON_GROUND = 2, 1
_PRESSURE_AT_SEA = 1013.25
_NO_ATTITUDE_TARGET = 0


@dataclass(frozen=True)
class Battery:
    """battery_status[0].

    Attributes
    ----------
    current, filtered
        A: what COMP is multiplied by, and what BATTERY_STATUS carries; −1 without a sensor.
    voltage
        V.
    left
        Part of the capacity, 0 … 1.
    """

    current: float
    filtered: float
    voltage: float
    left: float


@dataclass(frozen=True, eq=False)
class View(Known):
    """What PX4 knows at one step.

    Attributes
    ----------
    raw
        Last reading of each sensor in its own axes, gauss, shape (3, 3).
    field
        Of the compass that is used, corrected, in body axes, without bias, gauss, shape (3,).
    thrust
        Length of the thrust setpoint, 0 … 1.
    armed
        Whether the motors are.
    battery
        The first battery.
    """

    raw: FloatArray
    field: FloatArray
    thrust: float
    armed: bool
    battery: Battery


def build(message: int, view: View) -> Any:
    """Make one telemetry message."""
    return _BUILDERS[message](view)


def _mgauss(view: View, sensor: int) -> list[int]:
    return cut(view.raw[sensor] * _MGAUSS)


def _scaled_imu(view: View) -> Any:
    return mavlink.MAVLink_scaled_imu_message(
        view.boot_ms, *imu_fields(view, 0), *_mgauss(view, 0), _TEMPERATURE
    )


def _scaled_imu2(view: View) -> Any:
    nothing = [0] * 6  # one IMU
    return mavlink.MAVLink_scaled_imu2_message(
        view.boot_ms, *nothing, *_mgauss(view, 1), _TEMPERATURE
    )


def _scaled_imu3(view: View) -> Any:
    nothing = [0] * 6
    return mavlink.MAVLink_scaled_imu3_message(
        view.boot_ms, *nothing, *_mgauss(view, 2), _TEMPERATURE
    )


def _highres_imu(view: View) -> Any:
    altitude = view.geodetic()[2]
    return mavlink.MAVLink_highres_imu_message(
        time_usec=view.boot_us,
        **dict(zip(("xacc", "yacc", "zacc"), view.block.accel[0, view.step].tolist(), strict=True)),
        **dict(
            zip(("xgyro", "ygyro", "zgyro"), view.block.gyro[0, view.step].tolist(), strict=True)
        ),
        **dict(zip(("xmag", "ymag", "zmag"), view.field.tolist(), strict=True)),
        abs_pressure=_pressure(altitude),
        diff_pressure=0.0,
        pressure_alt=altitude,
        temperature=_TEMPERATURE / 100.0,
        fields_updated=_EVERYTHING_NEW if view.step == 0 else _IMU_NEW,
    )


def _quaternion(roll: float, pitch: float, yaw: float) -> list[float]:
    """From the earth's axes into the body's, w first."""
    (sr, sp, sy), (cr, cp, cy) = (
        each(0.5 * np.array([roll, pitch, yaw])).tolist() for each in (np.sin, np.cos)
    )
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]


def _attitude_quaternion(view: View) -> Any:
    rates = view.block.gyro[0, view.step].tolist()
    turn = _quaternion(*view.attitude.tolist())
    return mavlink.MAVLink_attitude_quaternion_message(view.boot_ms, *turn, *rates)


def _attitude_target(view: View) -> Any:
    return mavlink.MAVLink_attitude_target_message(
        view.boot_ms,
        _NO_ATTITUDE_TARGET,
        _quaternion(*view.attitude.tolist()),
        *view.block.rates[view.step].tolist(),
        view.thrust,
    )


def _hil_state_quaternion(view: View) -> Any:
    """The truth, as a PX4 in a simulator sends it (stream HIL_STATE_QUATERNION)."""
    turn = _quaternion(*euler(view.block.motion.earth_from_body[view.step]).tolist())
    latitude, longitude, altitude = view.geodetic()
    speed = cut(np.array([100.0 * np.linalg.norm(view.velocity)]))[0]
    return mavlink.MAVLink_hil_state_quaternion_message(
        view.boot_us,
        turn,
        *view.block.rates[view.step].tolist(),
        latitude,
        longitude,
        round(altitude * 1e3),
        *cut(view.velocity * 100.0),
        speed,
        speed,
        *cut(view.block.force[view.step] * 1000.0 / GRAVITY),
    )


def _outputs(view: View) -> list[float]:
    if not view.armed:
        return [float(_DISARMED_US)] * _OUTPUTS
    driven = (_LOW_US + _SPAN_US * view.block.demand[view.step]).tolist()
    return [*driven, *[float(_DISARMED_US)] * (_OUTPUTS - MOTORS)]


def _servo_output_raw(view: View) -> Any:
    outputs = [round(value) for value in _outputs(view)]
    return servo_output_raw(view, outputs)


def _actuator_output_status(view: View) -> Any:
    outputs = [*_outputs(view), *[0.0] * _OUTPUTS]
    return mavlink.MAVLink_actuator_output_status_message(view.boot_us, _OUTPUTS, outputs)


def _vfr_hud(view: View) -> Any:
    return vfr_hud(view, airspeed=0.0, throttle=view.thrust)


def _battery_status(view: View) -> Any:
    battery = view.battery
    voltages = [round(battery.voltage * 1e3)] + [ABSENT_VOLTAGE] * 9
    return mavlink.MAVLink_battery_status_message(
        id=0,
        battery_function=1,
        type=1,
        temperature=32767,
        voltages=voltages,
        current_battery=_centiamperes(battery),
        current_consumed=-1,
        energy_consumed=-1,
        battery_remaining=round(battery.left * 100.0),
        time_remaining=0,
        charge_state=1,
    )


def _sys_status(view: View) -> Any:
    battery = view.battery
    percent = round(battery.left * 100.0)
    return sys_status(_SENSORS, _LOAD, battery.voltage, _centiamperes(battery), percent)


def _centiamperes(battery: Battery) -> int:
    return -1 if battery.current < 0.0 else min(int(battery.filtered * 100.0), 32767)


def _gps_raw_int(view: View) -> Any:
    latitude, longitude, altitude = view.geodetic()
    north, east, _ = view.velocity.tolist()
    return mavlink.MAVLink_gps_raw_int_message(
        view.boot_us,
        mavlink.GPS_FIX_TYPE_3D_FIX,
        latitude,
        longitude,
        round(altitude * 1e3),
        0,
        0,
        round(100.0 * np.hypot(north, east)),
        round(100.0 * (np.degrees(np.arctan2(east, north)) % 360.0)) % 36000,
        14,
    )


def _altitude(view: View) -> Any:
    altitude = view.geodetic()[2]
    above = altitude - view.home[2]
    # Nothing measures how far the ground is.
    return mavlink.MAVLink_altitude_message(
        view.boot_us, altitude, altitude, above, above, math.nan, math.nan
    )


def _extended_sys_state(view: View) -> Any:
    landed = _IN_AIR if view.position[2] < -0.1 else _ON_GROUND
    return mavlink.MAVLink_extended_sys_state_message(0, landed)


def _scaled_pressure(view: View) -> Any:
    pressure = _pressure(view.geodetic()[2])
    return mavlink.MAVLink_scaled_pressure_message(view.boot_ms, pressure, 0.0, _TEMPERATURE)


def _pressure(altitude_m: float) -> float:
    """Of the standard atmosphere, hPa."""
    return float(_PRESSURE_AT_SEA * (1.0 - 2.25577e-5 * altitude_m) ** 5.2559)


def _estimator_status(view: View) -> Any:
    ratios = (0.01, 0.01, 0.01, 0.05, np.nan, 0.0)
    return mavlink.MAVLink_estimator_status_message(
        view.boot_us, _ESTIMATOR_FLAGS, *ratios, 0.3, 0.3
    )


def _ping(view: View) -> Any:
    return mavlink.MAVLink_ping_message(view.boot_us, 0, 0, 0)


_BUILDERS: Mapping[int, Callable[[View], Any]] = {
    **BUILDERS,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU: _scaled_imu,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU2: _scaled_imu2,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU3: _scaled_imu3,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: _highres_imu,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _attitude_quaternion,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: _attitude_target,
    mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION: _hil_state_quaternion,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: _servo_output_raw,
    mavlink.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: _actuator_output_status,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: _vfr_hud,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: _battery_status,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: _sys_status,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: _gps_raw_int,
    mavlink.MAVLINK_MSG_ID_ALTITUDE: _altitude,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _extended_sys_state,
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: _scaled_pressure,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: _estimator_status,
    mavlink.MAVLINK_MSG_ID_PING: _ping,
}
