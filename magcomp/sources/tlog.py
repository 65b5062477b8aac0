"""Read a MAVLink telemetry log (.tlog)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from magcomp.mavlink.frames import scan
from magcomp.mavlink.messages import crc_extra
from magcomp.model import Recording
from magcomp.sources.assemble import recording_from_bytes
from magcomp.sources.source import mapped
from magcomp.sources.vehicles import Choice


def read_tlog(
    path: str | Path,
    *,
    system: int | None = None,
    component: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Read what a vehicle said about its compasses, motors, attitude and parameters.

    Parameters
    ----------
    path
        A telemetry log of MAVLink 1, MAVLink 2 or both.
    system, component
        The vehicle's MAVLink system, or None where the log holds only one, and its autopilot's
        component, or None for the usual one.
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
        The log holds several vehicles and none is chosen, or the chosen one is not in it.
    """
    with mapped(path) as data:
        return recording_from_bytes(data, str(path), Choice(system, component), progress)


def read_chosen(path: Path, choice: Choice, progress: Callable[[float], None] | None) -> Recording:
    """:func:`read_tlog` as the table of formats calls it."""
    return read_tlog(path, system=choice.system, component=choice.component, progress=progress)


def recognises(head: bytes) -> bool:
    """Tell from first bytes whether a file is a telemetry log: a sound record is among them."""
    octets = np.frombuffer(head, dtype=np.uint8)
    return scan(octets, frozenset(), crc_extra()).verified > 0
