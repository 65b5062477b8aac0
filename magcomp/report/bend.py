"""How what the motors add bends with the control quantity: docs/method.md, Motor by motor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magcomp.model import CompassResult, FloatArray

_STEPS = 6
_DRAWN = 25


@dataclass(frozen=True, eq=False)
class Bend:
    """A curve beside the straight line that is written.

    Attributes
    ----------
    u
        Control quantity, shape (k,).
    curve, straight
        What the motors add there, mGauss, shape (k, 3).
    """

    u: FloatArray
    curve: FloatArray
    straight: FloatArray

    def along(self) -> tuple[FloatArray, FloatArray]:
        """Curve and line along the direction of the line, mGauss, shape (k,) each."""
        far = self.straight[-1]
        unit = far / max(float(np.linalg.norm(far)), 1e-9)
        return self.curve @ unit, self.straight @ unit


def bend_of(result: CompassResult, *, steps: int = _DRAWN) -> Bend | None:
    """The bend of one compass; None where its field follows a straight line, or another form.

    Parameters
    ----------
    result
        One compass of an analysis.
    steps
        Points of the curve.
    """
    curved = next((form for form in result.forms if form.is_best and form.curve), None)
    if curved is None:
        return None
    u = np.linspace(0.0, result.fit.u_high, steps)
    rest, slope, bend = np.array(curved.curve)
    return Bend(
        u=u,
        curve=rest + np.outer(u, slope) + np.outer(u**2, bend),
        straight=np.outer(u, result.fit.interference),
    )


def steps_of(result: CompassResult) -> Bend | None:
    """The same at the few steps that a text has room for."""
    return bend_of(result, steps=_STEPS)
