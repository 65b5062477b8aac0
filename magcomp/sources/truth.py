"""What a simulation knows about itself, for experiments and demonstrations only.

Nothing that fits may import this: the answers are in here. A Recording holds none of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20.ardupilotmega import (
    MAVLINK_MSG_ID_HIL_STATE_QUATERNION,
    MAVLINK_MSG_ID_SIMSTATE,
)

from magcomp.errors import MissingDataError
from magcomp.geometry import angles_of
from magcomp.mavlink.messages import WANTED, Table
from magcomp.model import FloatArray, Series
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
    """Read the true motion and the SIM_* parameters of a simulated vehicle's telemetry log.

    ArduPilot's simulations say it in SIMSTATE, PX4's in HIL_STATE_QUATERNION. Each gets the time of
    its place between stamped messages.

    Raises
    ------
    LogError, ChooseVehicleError
        As :func:`magcomp.sources.tlog.read_tlog`.
    MissingDataError
        The log holds neither: it is not a simulation's.
    """
    with mapped(path) as data:
        decoded = decode_vehicle(
            data, str(path), Choice(system, component), WANTED | _TELLERS.keys()
        )
    told = next((message for message in _TELLERS if message in decoded.messages), None)
    if told is None:
        raise MissingDataError(
            f"Log {path} must be a simulation's to know the truth; instead received neither "
            "SIMSTATE nor HIL_STATE_QUATERNION."
        )
    time, table = decoded.messages[told]
    attitude, place = _TELLERS[told](table)
    sound = np.isfinite(attitude).all(axis=1)
    changes = parameters(decoded.messages, decoded.who.autopilot, simulation=True)
    return Truth(
        attitude=Series(time[sound], attitude[sound]),
        position=Series(time[sound], place[sound] * 1e-7),
        parameters={change.name: change.value for change in changes},
    )


def _simstate(table: Table) -> tuple[FloatArray, FloatArray]:
    return columns(table, "roll", "pitch", "yaw"), columns(table, "lat", "lng")


def _hil_state_quaternion(table: Table) -> tuple[FloatArray, FloatArray]:
    return angles_of(table["attitude_quaternion"]), columns(table, "lat", "lon")


_TELLERS = {
    MAVLINK_MSG_ID_SIMSTATE: _simstate,
    MAVLINK_MSG_ID_HIL_STATE_QUATERNION: _hil_state_quaternion,
}
"""True attitude in radians and position in degrees · 1e7, by the message that tells them."""
