"""Where logs are, for a pilot whose file is not there or is no log."""

from __future__ import annotations

from magcomp import autopilots

_GROUND_STATIONS = (
    r"Mission Planner in Documents\Mission Planner\logs",
    "QGroundControl in Documents/QGroundControl/Telemetry",
    "MAVProxy as mav.tlog in the folder it was started in",
)


def where_logs_are() -> str:
    """A sentence on where ground stations and autopilots keep their logs."""
    vehicles = (f"{each.title} on its card in {each.log_folder}" for each in autopilots.ALL)
    *first, last = (*_GROUND_STATIONS, *vehicles)
    return f"Logs are kept by {', by '.join(first)}, and by {last}"
