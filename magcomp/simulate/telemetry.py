"""One function a message: what the autopilot knows, put into MAVLink's fields and units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

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

_IMU_TEMPERATURE = 3500
_SENSORS = (1_399_979_055, 1_130_470_447, 1_399_979_055)
_LOAD = 200
_EKF_FLAGS = 831


@dataclass(frozen=True, eq=False)
class Battery:
    """What the battery monitor said last; None where there is no monitor.

    Attributes
    ----------
    current, voltage
        A and V.
    used_ah, left
        Charge drawn, and the part of the capacity that is left, 0 … 1.
    """

    current: float
    voltage: float
    used_ah: float
    left: float


@dataclass(frozen=True, eq=False)
class View(Known):
    """What the autopilot knows at one step.

    Attributes
    ----------
    corrected
        Corrected field of each compass, mGauss, shape (3, 3).
    demand
        Thrust demand, 0 … 1; 0 where the motors are not armed.
    outputs
        Servo outputs of the motors, microseconds, shape (4,).
    battery
        The battery monitor.
    """

    corrected: FloatArray
    demand: float
    outputs: FloatArray
    battery: Battery | None


def build(message: int, view: View) -> Any | None:
    """Make one telemetry message; None where the vehicle has nothing to say in it."""
    return _BUILDERS[message](view)


def _centiamperes(battery: Battery) -> int:
    return min(int(battery.current * 100.0), 32767)


def _servo_output_raw(view: View) -> Any:
    outputs = [round(value) for value in view.outputs] + [0] * (16 - MOTORS)
    return servo_output_raw(view, outputs)


def _raw_imu(view: View) -> Any:
    mag = cut(view.corrected[0])
    return mavlink.MAVLink_raw_imu_message(
        view.boot_us, *imu_fields(view, 0), *mag, 0, _IMU_TEMPERATURE
    )


def _scaled_imu2(view: View) -> Any:
    mag = cut(view.corrected[1])
    return mavlink.MAVLink_scaled_imu2_message(
        view.boot_ms, *imu_fields(view, 1), *mag, _IMU_TEMPERATURE
    )


def _scaled_imu3(view: View) -> Any:
    # Two IMUs and three compasses, as on the boards people fly.
    mag = cut(view.corrected[2])
    return mavlink.MAVLink_scaled_imu3_message(view.boot_ms, *[0] * 6, *mag, 0)


def _simstate(view: View) -> Any:
    pose = view.block.motion.earth_from_body[view.step]
    latitude, longitude, _ = view.geodetic()
    return mavlink.MAVLink_simstate_message(
        *euler(pose).tolist(),
        *view.block.force[view.step].tolist(),
        *view.block.rates[view.step].tolist(),
        latitude,
        longitude,
    )


def _vfr_hud(view: View) -> Any:
    return vfr_hud(view, airspeed=None, throttle=view.demand)


def _battery_status(view: View) -> Any | None:
    battery = view.battery
    if battery is None:
        return None
    cell_voltages = [round(battery.voltage * 1e3)] + [ABSENT_VOLTAGE] * 9
    return mavlink.MAVLink_battery_status_message(
        id=0,
        battery_function=0,
        type=0,
        temperature=32767,
        voltages=cell_voltages,
        current_battery=_centiamperes(battery),
        current_consumed=int(battery.used_ah * 1e3),
        energy_consumed=int(battery.used_ah * battery.voltage * 36.0),
        battery_remaining=int(battery.left * 100.0),
        time_remaining=0,
        charge_state=1,
    )


def _sys_status(view: View) -> Any:
    battery = view.battery
    if battery is None:
        return sys_status(_SENSORS, _LOAD, 0.0, -1, -1)
    percent = int(battery.left * 100.0)
    return sys_status(_SENSORS, _LOAD, battery.voltage, _centiamperes(battery), percent)


def _ekf_status_report(view: View) -> Any:  # noqa: ARG001
    return mavlink.MAVLink_ekf_status_report_message(_EKF_FLAGS, 0.03, 0.01, 0.01, 0.03, 0.0)


_BUILDERS: Mapping[int, Callable[[View], Any | None]] = {
    **BUILDERS,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: _servo_output_raw,
    mavlink.MAVLINK_MSG_ID_RAW_IMU: _raw_imu,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU2: _scaled_imu2,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU3: _scaled_imu3,
    mavlink.MAVLINK_MSG_ID_SIMSTATE: _simstate,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: _vfr_hud,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: _battery_status,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: _sys_status,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: _ekf_status_report,
}
