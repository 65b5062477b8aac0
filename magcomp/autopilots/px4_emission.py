"""Parameters that bring a wanted calibration into force in spite of the firmware's dead zones.

docs/autopilots.md, PX4: in force, and PX4: what is written.

PX4 goes on with its old OFF, SCALE or ODIAG where the new one differs too little from it, and
after a start with 0, 1 or 0 where the stored one differs too little from these. So a value that
would not be noticed is either left at what is in force or moved past the zone, whichever turns
the heading less, so that the same is in force whether the vehicle is restarted or not. COMP then
makes up for what the offset misses at the current or thrust of ordinary flight.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from magcomp.autopilots.px4_correction import AT_START, SHAPE_ZONE, Calibration, behind
from magcomp.model import FloatArray

_PAST = 1.02
"""A float32 has to come to lie beyond the zone too."""

_TILT = math.sin(math.radians(20.0))
"""How much of an error along gravity reaches the heading of a vehicle tilted as in flight."""

_STEPS = (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0)


def noticed(
    wanted: Calibration, present: Calibration, zone: float, rotation: FloatArray
) -> Calibration:
    """The calibration nearest to a wanted one that comes into force as it is.

    Parameters
    ----------
    wanted
        What was fitted, in the sensor's axes.
    present
        What is in force now.
    zone
        Length up to which a change of OFF is not taken over, gauss.
    rotation
        From the sensor's axes into the vehicle's, shape (3, 3).
    """
    ones, zeros = AT_START.scale, AT_START.off_diagonal
    scale = _nearest(wanted.scale, (present.scale, ones), SHAPE_ZONE, np.eye(3))
    off_diagonal = _nearest(
        wanted.off_diagonal, (present.off_diagonal, zeros), SHAPE_ZONE, np.eye(3)
    )
    level = np.diag([1.0, 1.0, _TILT]) @ rotation
    aim = wanted.offset
    if float(np.linalg.norm(aim - present.offset)) <= zone:
        # Two estimates of one offset, and so near to each other neither is known to be better.
        aim = (aim + present.offset) / 2
    offset = _nearest(aim, (present.offset, AT_START.offset), zone, level)
    shaped = replace(wanted, offset=offset, scale=scale, off_diagonal=off_diagonal)
    # COMP is in front of the soft iron: what it does to the corrected field has to stay.
    return replace(shaped, motor=behind(shaped, wanted.soft_iron @ wanted.motor))


def _nearest(
    wanted: FloatArray, befores: Iterable[FloatArray], zone: float, weight: FloatArray
) -> FloatArray:
    """The vector that is taken over whichever was in force before, at the least cost."""
    befores = tuple(befores)
    for candidates in (_near(wanted, befores, zone, weight), _around(wanted, zone)):
        sound = [
            candidate
            for candidate in candidates
            if all(_is_taken(candidate, before, zone) for before in befores)
        ]
        if sound:
            break
    return min(sound, key=lambda each: float(np.linalg.norm(weight @ (each - wanted))))


def _is_taken(vector: FloatArray, before: FloatArray, zone: float) -> bool:
    return np.array_equal(vector, before) or float(np.linalg.norm(vector - before)) > zone * 1.01


def _near(
    wanted: FloatArray, befores: tuple[FloatArray, ...], zone: float, weight: FloatArray
) -> Iterator[FloatArray]:
    yield wanted
    yield from befores
    cheap = np.linalg.svd(weight)[2][-1]
    for before in befores:
        away = wanted - before
        length = float(np.linalg.norm(away))
        if length:
            yield before + away * (_PAST * zone / length)
        along = float(cheap @ away)
        square = (_PAST * zone) ** 2 - length**2 + along**2
        if square >= 0.0:
            yield wanted + cheap * (-along + math.sqrt(square))
            yield wanted + cheap * (-along - math.sqrt(square))


def _around(wanted: FloatArray, zone: float) -> Iterator[FloatArray]:
    """Where the zones around two vectors meet, farther away; some are beyond both."""
    for steps in itertools.product(_STEPS, repeat=3):
        yield wanted + np.array(steps) * zone
