"""A fit brought up to date with what arrived since, cheaply enough for once a second.

Method, control quantity, lags and freedom are those of the last full analysis; the readings are
thinned. What it gives is for the eye: anything that is written comes from a full analysis.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from magcomp.align import controls, expected_earth, readings, to_undo
from magcomp.errors import MagcompError
from magcomp.fit import Problem, refit
from magcomp.model import Analysis, MotorFit, Recording

MOST_READINGS = 600
"""Readings of one compass a refresh looks at; evenly spread over the recording."""


def refresh(
    recording: Recording, last: Analysis, *, most: int = MOST_READINGS
) -> Mapping[int, MotorFit]:
    """Fits of the compasses of the last analysis on the recording as it is now.

    Parameters
    ----------
    recording
        What has arrived so far.
    last
        The last full analysis of the same vehicle.
    most
        Readings used of each compass.

    Returns
    -------
    mapping of compass to fit
        Without the compasses that cannot be fitted at the moment.
    """
    found = controls(recording)
    earth = expected_earth(recording)
    fits = {}
    for result in last.compasses:
        before = result.fit
        like = [c for c in found if c.kind == before.regressor]
        if not like:
            continue
        control = next((c for c in like if c.origin == before.origin), like[0])
        try:
            new = readings(recording, before.compass)
            problem = Problem(new, control, to_undo(recording, found), earth)
            # Fewer than ``new``: those in a gap of the control quantity are left out.
            count = len(problem.readings)
            keep = np.zeros(count, dtype=bool)
            keep[:: max(1, -(-count // most))] = True
            fits[before.compass] = refit(problem, before, keep)
        except MagcompError:
            continue
    return fits
