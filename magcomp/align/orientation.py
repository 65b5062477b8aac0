"""A compass that is mounted otherwise than its orientation says, told by gravity.

Whatever a compass is mounted like, its readings keep their strength. Their part along gravity is
the earth's only in the right axes, so of the 24 turns by right angles the one that holds it
constant, offsets and motors aside, is how the compass stands (docs/method.md, The judge).
"""

from __future__ import annotations

import numpy as np

from magcomp import autopilots
from magcomp.autopilots.rotations import ROTATIONS, named, number_of, right_angles, turn
from magcomp.earth import EarthField
from magcomp.model import FloatArray, Recording, Samples

_MOST_ROWS = 1500
_PLAINLY_BETTER = 0.6
_ALMOST_AS_GOOD = 1.25
_MATTERS_SHARE = 0.05


def orientation_complaint(recording: Recording, samples: Samples, earth: EarthField) -> str:
    """In words, that a compass stands otherwise than its orientation says; empty where it does not.

    Parameters
    ----------
    recording
        Whose parameters say how the compass is mounted.
    samples
        Of the compass, in the axes that its orientation gives.
    earth
        The field expected.
    """
    found = right_turn(samples, earth)
    if found is None:
        return ""
    autopilot = autopilots.of(recording)
    name = autopilot.orientation_name(samples.compass)
    said = f"compass {samples.compass} is not mounted as its orientation says: "
    mounted = next(
        (c for c in autopilot.compasses(recording.parameters.latest) if c.slot == samples.compass),
        None,
    )
    now = 0 if mounted is None or mounted.orientation is None else mounted.orientation
    angles = ROTATIONS.get(now, (0, 0, 0))
    wanted = number_of(right_angles()[found] @ turn(*angles))
    cure = f"set {name} to {wanted} ({named(wanted)})" if wanted is not None else f"check {name}"
    return (
        f"{said}turned by {named(found)}, its readings fit gravity; {cure}, or the board's own "
        "orientation where the compass is on it, and calibrate the compass anew"
    )


def right_turn(samples: Samples, earth: EarthField) -> int | None:
    """The number of the turn that makes the readings fit gravity; None where no one does."""
    every = max(1, len(samples.time) // _MOST_ROWS)
    few = samples.where(np.arange(len(samples.time)) % every == 0)
    down = few.down
    known = np.concatenate([down, *(down * part[:, None] for part in few.u.T)], axis=1)
    left = {
        number: _left(known, np.einsum("ij,ij->i", down, few.raw @ turned.T) - earth.vertical)
        for number, turned in right_angles().items()
    }
    best = min(left, key=lambda number: left[number])
    plain = left[best] < _PLAINLY_BETTER * left[0]
    if not plain or left[0] < _MATTERS_SHARE * earth.strength:
        return None
    alike = [number for number in left if left[number] < _ALMOST_AS_GOOD * left[best]]
    return best if len(alike) == 1 else None


def _left(known: FloatArray, vertical: FloatArray) -> float:
    """Median size of what offsets and motors leave of the part along gravity, mGauss."""
    made = np.linalg.lstsq(known, vertical, rcond=None)[0]
    return float(np.median(np.abs(vertical - known @ made)))
