"""What a simulation knows about itself, for experiments and demonstrations only.

Nothing that fits may import this: the answers are in here. A Recording holds none of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20.ardupilotmega import MAVLINK_MSG_ID_SIMSTATE

from magcomp.errors import MissingDataError
from magcomp.mavlink.messages import WANTED
from magcomp.model import Series
from magcomp.sources.assemble import decode_vehicle
from magcomp.sources.quantities import columns, parameters
from magcomp.sources.source import mapped
from magcomp.sources.vehicles import Choice


@dataclass(frozen=True, eq=False)
class Truth:
    """True motion of a simulated vehicle, on the time axis of its Recording.

    Attributes
    ----------
    attitude
        True roll, pitch, yaw in radians, shape (n, 3).
    position
        True latitude and longitude in degrees, shape (n, 2).
    parameters
        Last values of the SIM_* parameters.
    """

    attitude: Series
    position: Series
    parameters: Mapping[str, float]


def read_truth(
    path: str | Path, *, system: int | None = None, component: int | None = None
) -> Truth:
    """Read SIMSTATE and the SIM_* parameters of a simulated vehicle's telemetry log.

    SIMSTATE carries no time of its own and gets that of its place between stamped messages.

    Raises
    ------
    LogError, ChooseVehicleError
        As :func:`magcomp.sources.tlog.read_tlog`.
    MissingDataError
        The log holds no SIMSTATE: it is not a simulation's.
    """
    with mapped(path) as data:
        decoded = decode_vehicle(
            data, str(path), Choice(system, component), WANTED | {MAVLINK_MSG_ID_SIMSTATE}
        )
    if MAVLINK_MSG_ID_SIMSTATE not in decoded.messages:
        raise MissingDataError(
            f"Log {path} must be a simulation's to know the truth; instead received no SIMSTATE."
        )
    time, table = decoded.messages[MAVLINK_MSG_ID_SIMSTATE]
    attitude = columns(table, "roll", "pitch", "yaw")
    sound = np.isfinite(attitude).all(axis=1)
    changes = parameters(decoded.messages, decoded.who.autopilot, simulation=True)
    return Truth(
        attitude=Series(time[sound], attitude[sound]),
        position=Series(time[sound], columns(table, "lat", "lng")[sound] * 1e-7),
        parameters={change.name: change.value for change in changes},
    )
