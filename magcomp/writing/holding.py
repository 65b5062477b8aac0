"""What a vehicle holds of motor compensation, in a line."""

from __future__ import annotations

from collections.abc import Mapping

from magcomp import autopilots
from magcomp.errors import MagcompError
from magcomp.model import Vehicle


def holding(vehicle: Vehicle, values: Mapping[str, float]) -> str:
    """Name what acts on the vehicle's compasses.

    Parameters
    ----------
    vehicle
        With its compasses, as far as known.
    values
        Its calibration parameters, by name.

    Returns
    -------
    str
        A clause, such as ``"motor compensation by current for compass 1, none for compass 2"``.
    """
    autopilot = autopilots.of(vehicle)
    regressor = autopilot.regressor(values)
    if regressor is None:
        return "motor compensation off"
    slots = [compass.slot for compass in vehicle.compasses] or [1]
    acting = []
    for slot in slots:
        try:
            if autopilot.in_force(values, slot).correction.motor.any():
                acting.append(slot)
        except MagcompError:
            return f"motor compensation by {regressor}"
    idle = [slot for slot in slots if slot not in acting]
    parts = [f"motor compensation by {regressor}"]
    if acting:
        parts[0] += f" for {_named(acting)}"
    if idle:
        parts.append(f"none for {_named(idle)}")
    return ", ".join(parts)


def _named(slots: list[int]) -> str:
    *most, last = (str(slot) for slot in slots)
    if not most:
        return f"compass {last}"
    return f"compasses {', '.join(most)} and {last}"
