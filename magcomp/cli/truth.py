"""What parameters really leave of heading error, where a simulation's truth is known.

For demonstrations: nothing here is ever seen by a fit.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from magcomp.earth import expected_field
from magcomp.errors import InputError
from magcomp.geometry import body_from_earth
from magcomp.judge import largest_shift
from magcomp.judge.heading_error import attitudes
from magcomp.model import Correction, symmetric


class KnownTruth:
    """A simulated vehicle's interference and calibrations, read from the file beside its log.

    Raises
    ------
    InputError
        Where the file is missing or not of this form.
    """

    def __init__(self, path: Path) -> None:
        try:
            document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            self._interference = np.array(document["mot_mgauss_per_amp"], float)
            self._home = tuple(float(part) for part in document["home"])
            self._compasses = [
                (np.array(c["ofs"], float), symmetric(np.array([*c["dia"], *c["odi"]], float)))
                for c in document["compass"]
            ]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"{path} must be the truth of a simulated vehicle; instead received: {error}"
            ) from error

    def heading_error_deg(
        self, in_force: Correction, compass: int, amperes: float, unix_s: float
    ) -> float:
        """Largest heading error over all yaws, level and tilted by 20°, degrees.

        Parameters
        ----------
        in_force
            What the autopilot does, compensating by current.
        compass
            1, 2 or 3.
        amperes
            The current that flows.
        unix_s
            When, for the earth's field.

        Notes
        -----
        The sensor reads D⁻¹ · (field + interference · amperes) − OFS with the true D and OFS
        (docs/method.md, Equation 3).
        """
        latitude, longitude, altitude = self._home
        earth = expected_field(latitude, longitude, altitude, unix_s)
        roll, pitch, yaw = attitudes()
        field = body_from_earth(roll, pitch, yaw) @ np.array(
            [earth.horizontal, 0.0, earth.vertical]
        )
        offset, soft_iron = self._compasses[compass - 1]
        raw = (field + amperes * self._interference) @ np.linalg.inv(soft_iron).T - offset
        corrected = in_force.apply(raw, np.full(len(raw), amperes))
        return largest_shift(corrected, field, roll, pitch)
