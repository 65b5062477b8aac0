"""What a miss of a correction costs in heading, by differences of headings and nothing else."""

from __future__ import annotations

from functools import cache

import numpy as np
from truth import TILTS

from magcomp.autopilots import Leeway
from magcomp.geometry import body_from_earth, heading, wrap_angle
from magcomp.model import Correction, pack, unpack

EARTH = np.array([216.0, 0.0, 429.0])
_YAWS = np.radians(np.arange(0.0, 360.0, 30.0))
_CONTROLS = (0.0, 10.0, 20.0, 30.0, 40.0)
_STEPS = np.concatenate([np.full(3, 1e-3), np.full(3, 1e-2), np.full(6, 1e-5)])


def leeway_around(likely: Correction) -> Leeway:
    """Around a correction, with what misses of a usual one cost."""
    return Leeway(likely, _turning())


@cache
def _turning() -> np.ndarray:
    usual = Correction(np.array([50.0, -80.0, 120.0]), np.eye(3), np.ones(3))
    turning = np.zeros((12, 12))
    for u in _CONTROLS:
        for roll, pitch in TILTS:
            field = body_from_earth(roll, pitch, _YAWS) @ EARTH
            raw = usual.undo(field, np.full(len(field), u))

            def found(parameters, raw=raw, u=u, roll=roll, pitch=pitch):
                corrected = unpack(parameters).apply(raw, np.full(len(raw), u))
                return heading(corrected, roll, pitch, 0.0)

            slopes = np.column_stack(
                [
                    wrap_angle(found(pack(usual) + step) - found(pack(usual) - step))
                    / (2.0 * step.max())
                    for step in np.diag(_STEPS)
                ]
            )
            turning += slopes.T @ slopes / (len(TILTS) * len(_CONTROLS) * len(_YAWS))
    return turning
