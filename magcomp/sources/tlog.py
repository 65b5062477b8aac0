"""Read a MAVLink telemetry log (.tlog)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from magcomp.model import Recording
from magcomp.sources.assemble import recording_from_bytes
from magcomp.sources.source import mapped


def read_tlog(
    path: str | Path,
    *,
    system: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Read what a vehicle said about its compasses, motors, attitude and parameters.

    Parameters
    ----------
    path
        A telemetry log of MAVLink 1, MAVLink 2 or both.
    system
        The vehicle's MAVLink system, or None where the log holds only one.
    progress
        Called with the read fraction, 0 to 1.

    Returns
    -------
    Recording
        Of the autopilot; what it does not hold is None or empty. SIM_* parameters and
        SIMSTATE are left out (see :mod:`magcomp.sources.truth`).

    Raises
    ------
    LogError
        The file cannot be read, holds no MAVLink frame, or no autopilot's heartbeat.
    ChooseVehicleError
        The log holds several vehicles and ``system`` is None, or ``system`` is not in it.
    """
    with mapped(path) as data:
        return recording_from_bytes(data, str(path), system, progress)
