"""How to make an ArduPilot vehicle record what a log lacks: by its card, and by the link."""

from __future__ import annotations

_ALL_CURRENTS = (
    "make battery 0 the sum of all (the BATT_MONITOR that sums selected monitors), and record again"
)
LOG_BITS = {
    "compass": "set the COMPASS bit of LOG_BITMASK and COMPASS_ENABLE to 1, and record again",
    "more readings": "record longer",
    "control": (
        "set the CURRENT and CTUN bits of LOG_BITMASK and give the log as the vehicle wrote it"
    ),
    "current": "set up a current sensor (BATT_MONITOR) and set the CURRENT bit of LOG_BITMASK",
    "all currents": _ALL_CURRENTS,
    "attitude": "set the ATTITUDE bit of LOG_BITMASK, and record again",
    "parameters": "give the whole log, which has them at its beginning",
    "position": "set the GPS bit of LOG_BITMASK, and record where satellites are seen",
}
LINK_MESSAGES = {
    "compass": "ask for RAW_IMU, SCALED_IMU2 or SCALED_IMU3 at 10 Hz, with COMPASS_ENABLE 1",
    "more readings": "record longer, or ask for RAW_IMU, SCALED_IMU2 or SCALED_IMU3 at 10 Hz",
    "control": "was the vehicle ever armed, and does the link carry BATTERY_STATUS or VFR_HUD?",
    "current": "set up a current sensor (BATT_MONITOR) and ask for BATTERY_STATUS at 10 Hz",
    "all currents": _ALL_CURRENTS,
    "attitude": "ask for ATTITUDE at 20 Hz",
    "parameters": "let the ground station read all parameters while it records",
    "position": "ask for GLOBAL_POSITION_INT, and record where satellites are seen",
}
