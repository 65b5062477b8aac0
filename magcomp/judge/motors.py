"""Whether a flight tells the motors apart."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from magcomp.fit.motors import contrasts
from magcomp.geometry import horizontal_part
from magcomp.judge.finding import Finding
from magcomp.judge.thresholds import Thresholds
from magcomp.model import Coverage, FloatArray, Grade, MotorFit

_YAW_OF_FOUR = np.array([1.0, 1.0, -1.0, -1.0]) / 2.0
"""How the motors of a quadrotor differ in a turn: 1 and 2 spin one way, 3 and 4 the other."""

_MOSTLY = 0.8


def on_motors(fit: MotorFit, covered: Coverage, limits: Thresholds) -> Iterator[Finding]:
    """Whether the vectors of the motors are known apart from each other, and what to fly if not.

    Notes
    -----
    From the information matrix of the flight, without the prior that motors are alike: the
    difference that is known worst, times what a motor usually draws, as heading error.
    """
    if not len(fit.told_apart):
        return
    parts = fit.correction.motor.shape[1]
    std, pattern = _worst(fit.told_apart, parts)
    horizontal = horizontal_part(fit.strength, fit.vertical)
    usual = (covered.u_median if np.isfinite(covered.u_median) else covered.u_high) / parts
    degrees = float(np.degrees(np.sqrt(2.0) * std * usual / horizontal))
    if degrees <= limits.good_deg:
        return
    yield Finding(
        Grade.MARGINAL if degrees <= limits.marginal_deg else Grade.REJECTED,
        f"the motors can hardly be told apart: how differently they disturb is known to "
        f"{std:.1f} mGauss per A only ({degrees:.0f}° at what each usually draws), and is taken as "
        f"little; {_what_to_fly(pattern)}, or sweep the motors one by one on the ground",
    )


def _worst(doubt: FloatArray, parts: int) -> tuple[float, FloatArray]:
    """Standard error an axis of the difference that is known worst, and its share in each motor."""
    blocks = doubt.reshape(parts - 1, 3, parts - 1, 3)
    values, vectors = np.linalg.eigh(np.einsum("iaja->ij", blocks) / 3.0)
    return float(np.sqrt(max(values[-1], 0.0))), vectors[:, -1] @ contrasts(parts)


def _what_to_fly(pattern: FloatArray) -> str:
    if len(pattern) == len(_YAW_OF_FOUR):
        if abs(float(pattern @ _YAW_OF_FOUR)) > _MOSTLY:
            return "fly turns that start and stop briskly, both ways"
        return "fly short brisk rolls and pitches"
    return "fly brisk rolls, pitches and turns, both ways"
