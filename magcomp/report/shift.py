"""What the motors add, measured level by level and as it was fitted: docs/method.md, Fig. 4."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magcomp.model import FloatArray, MotorFit, quantity_of


@dataclass(frozen=True, eq=False)
class Shift:
    """How far the field's centre moves, by control quantity, seen along each axis.

    Attributes
    ----------
    u
        Control quantity of each centre, in the unit that is shown, shape (k,).
    centres
        Shift of each centre from its place at rest, in the corrected field, mGauss, shape (k, 3).
    std
        Its standard errors, shape (k, 3).
    ends
        Control quantities at which the lines begin and end, in that unit, shape (2,).
    lines
        The fitted interference there, mGauss, shape (2, 3).
    title
        Of the control quantity, with its unit.
    """

    u: FloatArray
    centres: FloatArray
    std: FloatArray
    ends: FloatArray
    lines: FloatArray
    title: str


def shift_of(fit: MotorFit) -> Shift:
    """The shift of one compass's field."""
    quantity = quantity_of(fit.regressor)
    shape = fit.correction.soft_iron
    rest = fit.correction.centre(0.0)
    u = np.array([level.u for level in fit.levels])
    moved = [shape @ (level.centre - rest) for level in fit.levels]
    std = [np.sqrt(np.diag(shape @ level.covariance @ shape.T)) for level in fit.levels]
    ends = np.array([0.0, max(fit.u_high, float(u.max(initial=0.0)))])
    return Shift(
        u=quantity.scale * u,
        centres=np.array(moved).reshape(-1, 3),
        std=np.array(std).reshape(-1, 3),
        ends=quantity.scale * ends,
        lines=np.outer(ends, fit.interference),
        title=f"{quantity.name}, {quantity.shown_unit}",
    )
