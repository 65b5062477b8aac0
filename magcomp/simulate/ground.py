"""The least a ground station does, so that a vehicle has somebody to talk to without a link."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.mavlink.commands import command_long, every

GROUND_SYSTEM, GROUND_COMPONENT = 255, 190

DEFAULT_RATES: Mapping[int, float] = {
    mavlink.MAVLINK_MSG_ID_RAW_IMU: 10.0,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU2: 10.0,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU3: 10.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 10.0,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 10.0,
    mavlink.MAVLINK_MSG_ID_SIMSTATE: 10.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 4.0,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 4.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 2.0,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 2.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 0.8,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: 0.8,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 0.4,
}
"""Hertz at which the recordings in sitl_fixtures/ were made."""

PX4_RATES: Mapping[int, float] = {
    mavlink.MAVLINK_MSG_ID_SCALED_IMU: 15.0,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU2: 15.0,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU3: 15.0,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: 15.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 25.0,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 10.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 10.0,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 10.0,
    mavlink.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: 5.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 2.0,
}
"""Hertz that a PX4 was asked for when its telemetry was recorded; it sends the rest unasked."""


class Asker:
    """Makes the frames a ground station sends.

    Parameters
    ----------
    target
        System number of the vehicle.
    """

    def __init__(self, target: int = 1) -> None:
        self._target = target
        self._codec: Any = mavlink.MAVLink(
            None, srcSystem=GROUND_SYSTEM, srcComponent=GROUND_COMPONENT
        )

    def pack(self, message: Any) -> bytes:
        """Frame a message."""
        data = bytes(message.pack(self._codec))
        self._codec.seq = (self._codec.seq + 1) % 256
        return data

    def heartbeat(self) -> bytes:
        """A ground station's HEARTBEAT."""
        return self.pack(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3
            )
        )

    def parameter_list(self) -> bytes:
        """PARAM_REQUEST_LIST."""
        return self.pack(mavlink.MAVLink_param_request_list_message(self._target, 1))

    def command(self, number: int, *values: float) -> bytes:
        """COMMAND_LONG with its first parameters; the rest are 0."""
        return self.pack(command_long((self._target, 1), number, *values))

    def rate(self, message: int, hertz: float) -> bytes:
        """SET_MESSAGE_INTERVAL; 0 Hz ends the stream."""
        interval = 1e6 / hertz if hertz > 0 else -1
        return self.pack(every((self._target, 1), message, interval))
