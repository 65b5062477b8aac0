"""The earth's field a recording should show."""

from __future__ import annotations

import numpy as np

from magcomp import autopilots
from magcomp.earth import EarthField, expected_field
from magcomp.errors import MissingDataError
from magcomp.geometry import gravity_direction
from magcomp.model import Recording, interpolate


def expected_earth(recording: Recording) -> EarthField:
    """Expected field at the recording's own position and date.

    Without a position the field is one like the readings themselves: their median strength and
    vertical part, declination 0.

    Raises
    ------
    MissingDataError
        Where position and compass, or position and attitude, are missing.
    """
    if has_position(recording) and recording.position is not None:
        latitude, longitude, altitude = np.median(recording.position.value, axis=0)
        return expected_field(latitude, longitude, altitude, recording.start_unix_s)
    if not recording.field or recording.attitude is None:
        raise MissingDataError(
            f"{recording.source} must hold a compass and the attitude; instead one is missing"
        )
    compass = min(recording.field)
    time, value = recording.field[compass].time, recording.field[compass].value
    if compass in recording.raw_compasses:
        present = autopilots.of(recording).in_force(recording.parameters.latest, compass)
        value = present.correction.apply(value, np.zeros(len(value)))
    attitude = interpolate(recording.attitude, time)
    down = gravity_direction(attitude[:, 0], attitude[:, 1])
    strength = float(np.median(np.linalg.norm(value, axis=1)))
    if not strength > 0.0:
        raise MissingDataError(
            f"{recording.source} must hold a field that is not zero, or a position; instead "
            f"compass {compass} reads zero throughout: check its wiring"
        )
    vertical = float(np.median(np.einsum("ij,ij->i", value, down)))
    return EarthField(strength, float(np.arcsin(np.clip(vertical / strength, -1.0, 1.0))), 0.0)


def has_position(recording: Recording) -> bool:
    """Whether the recording says where it was made."""
    return recording.position is not None and len(recording.position) > 0
