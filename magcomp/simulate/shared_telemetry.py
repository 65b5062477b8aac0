"""Messages that both firmwares fill alike, from what any vehicle knows of itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.simulate.flight import GRAVITY
from magcomp.simulate.moment import Moment

FloatArray = NDArray[np.float64]

ABSENT_VOLTAGE = 65535
"""Of a cell that a battery does not have."""


@dataclass(frozen=True, eq=False)
class Known(Moment):
    """A moment, and what the estimator makes of it.

    Attributes
    ----------
    attitude
        Estimated roll, pitch and yaw at that step, radians, shape (3,).
    """

    attitude: FloatArray


def cut(value: FloatArray) -> list[int]:
    """Cut towards zero and keep within 16 bits, as the firmware's conversion does."""
    return [min(max(int(each), -32768), 32767) for each in value.tolist()]


def imu_fields(view: Known, imu: int) -> list[int]:
    """Acceleration in milli-g and turn rates in mrad/s, as in RAW_IMU and SCALED_IMU."""
    accel = cut(view.block.accel[imu, view.step] * 1000.0 / GRAVITY)
    return accel + cut(view.block.gyro[imu, view.step] * 1000.0)


def servo_output_raw(view: Known, outputs: Sequence[int]) -> Any:
    """SERVO_OUTPUT_RAW of sixteen outputs, microseconds."""
    return mavlink.MAVLink_servo_output_raw_message(
        view.boot_us & 0xFFFFFFFF, 0, *outputs[:8], *outputs[8:]
    )


def vfr_hud(view: Known, *, airspeed: float | None, throttle: float) -> Any:
    """VFR_HUD; the airspeed is the ground speed where it is not given, the throttle 0 … 1."""
    north, east, down = view.velocity.tolist()
    ground_speed = float(np.hypot(north, east))
    return mavlink.MAVLink_vfr_hud_message(
        airspeed=ground_speed if airspeed is None else airspeed,
        groundspeed=ground_speed,
        heading=int(np.degrees(view.attitude[2]) % 360.0),
        throttle=int(throttle * 100.0),
        alt=view.geodetic()[2],
        climb=-down,
    )


def sys_status(
    sensors: tuple[int, int, int], load: int, voltage: float, centiamperes: int, percent: int
) -> Any:
    """SYS_STATUS: bits of the sensors present, enabled and healthy; load in permille, V, 10 mA."""
    return mavlink.MAVLink_sys_status_message(
        *sensors, load, round(voltage * 1e3), centiamperes, percent, *[0] * 6
    )


def _attitude(view: Known) -> Any:
    rates = view.block.gyro[0, view.step].tolist()
    return mavlink.MAVLink_attitude_message(view.boot_ms, *view.attitude.tolist(), *rates)


def _global_position_int(view: Known) -> Any:
    latitude, longitude, altitude = view.geodetic()
    return mavlink.MAVLink_global_position_int_message(
        view.boot_ms,
        latitude,
        longitude,
        round(altitude * 1e3),
        round((altitude - view.home[2]) * 1e3),
        *cut(view.velocity * 100.0),
        int(np.degrees(view.attitude[2]) % 360.0 * 100.0),
    )


def _local_position_ned(view: Known) -> Any:
    return mavlink.MAVLink_local_position_ned_message(
        view.boot_ms, *view.position.tolist(), *view.velocity.tolist()
    )


def _system_time(view: Known) -> Any:
    return mavlink.MAVLink_system_time_message(round(view.unix_s * 1e6), view.boot_ms)


BUILDERS: Mapping[int, Callable[[Known], Any]] = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE: _attitude,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _global_position_int,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: _local_position_ned,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: _system_time,
}
"""By message id."""
