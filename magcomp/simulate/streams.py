"""Which messages the autopilot sends by itself, and when."""

from __future__ import annotations

from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

TELEMETRY: tuple[int, ...] = (
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
    mavlink.MAVLINK_MSG_ID_RAW_IMU,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU2,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU3,
    mavlink.MAVLINK_MSG_ID_SIMSTATE,
    mavlink.MAVLINK_MSG_ID_VFR_HUD,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
)
"""Messages that can be streamed, in the order in which one moment's are sent."""

GROUPS: Mapping[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: (
        mavlink.MAVLINK_MSG_ID_RAW_IMU,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU2,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU3,
    ),
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (mavlink.MAVLINK_MSG_ID_SYS_STATUS,),
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: (mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,),
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_SIMSTATE,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    ),
    mavlink.MAV_DATA_STREAM_ALL: TELEMETRY,
}
"""What REQUEST_DATA_STREAM means to ArduCopter."""

_LONGEST_MS = 60_000


class Schedule:
    """Interval and next due time of each streamed message.

    Parameters
    ----------
    telemetry
        Messages that can be streamed, in the order in which one moment's are sent.
    """

    def __init__(self, telemetry: tuple[int, ...] = TELEMETRY) -> None:
        self._telemetry = telemetry
        self._interval_ms: dict[int, int] = {}
        self._due_ms: dict[int, int] = {}
        self._next_ms: int | None = None

    def set(self, message: int, interval_us: float, now_ms: int) -> None:
        """Stream a message every ``interval_us``; 0 or less ends its stream."""
        if interval_us <= 0:
            self._interval_ms.pop(message, None)
            self._due_ms.pop(message, None)
        else:
            interval = int(min(max(interval_us / 1000.0, 1.0), _LONGEST_MS))
            self._interval_ms[message] = interval
            self._due_ms[message] = now_ms
        self._next_ms = min(self._due_ms.values(), default=None)

    def interval_us(self, message: int) -> int:
        """Interval of a message in microseconds; −1 where it is not streamed."""
        interval = self._interval_ms.get(message)
        return -1 if interval is None else 1000 * interval

    def due(self, now_ms: int) -> list[int]:
        """Messages to send now, each at most once; their next time is noted."""
        if self._next_ms is None or now_ms < self._next_ms:
            return []
        ready = [
            message
            for message in self._telemetry
            if self._due_ms.get(message, now_ms + 1) <= now_ms
        ]
        for message in ready:
            following = self._due_ms[message] + self._interval_ms[message]
            self._due_ms[message] = max(following, now_ms + 1)
        self._next_ms = min(self._due_ms.values())
        return ready
