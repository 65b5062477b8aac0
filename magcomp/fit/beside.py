"""What is most likely where the calibration in force may well be right.

A fit says how uncertain its offsets are; two calibrations that agree say more than either. How far
the one in force may be off, nobody knows: each width is tried, and counts by how likely it makes
the distance that was found (docs/method.md, Beside the calibration in force).
"""

from __future__ import annotations

import numpy as np

from magcomp.fit.widths import weights_of
from magcomp.model import OFFSET, SOFT_IRON, Correction, FloatArray, MotorFit, pack, unpack

_WIDTHS_MGAUSS = np.concatenate([[0.0], np.geomspace(0.1, 300.0, 36)])
_MGAUSS_PER_SOFT_IRON = 800.0
"""An ordinary calibration is off by 4 mGauss and 0.005, a bad one by 12 mGauss and 0.015."""

_SMALL = 1e-9


def likely_beside(fit: MotorFit, present: Correction) -> Correction:
    """The fit, drawn towards the calibration in force as far as the two agree.

    Parameters
    ----------
    fit
        Against one control quantity.
    present
        What is in force; its motor vector counts for nothing, for it is what is being measured.

    Notes
    -----
    With d the distance of offsets, and of the soft iron where it was fitted, from those in force, C
    their covariance and S the prior of a width, the parameters p become
    p − cov(p, d) · (C + S)⁻¹ · d, and each width counts by the density of d, N(0, C + S).
    """
    moved = np.r_[OFFSET, SOFT_IRON] if "diagonal" in fit.free else np.r_[OFFSET]
    unit = np.ones(len(pack(present)))
    unit[SOFT_IRON] /= _MGAUSS_PER_SOFT_IRON
    whole, scale = fit.shared_covariance, unit[moved]
    parameters = pack(fit.correction)
    apart = parameters[moved] - pack(present)[moved]
    spreads = [_spread(whole[np.ix_(moved, moved)], w * scale) for w in _WIDTHS_MGAUSS]
    weights = weights_of(apart / scale, [each / np.outer(scale, scale) for each in spreads])
    pulled = weights @ np.array([np.linalg.solve(each, apart) for each in spreads])
    return unpack(parameters - whole[:, moved] @ pulled)


def _spread(covariance: FloatArray, width: FloatArray) -> FloatArray:
    return np.asarray(covariance + np.diag(width**2 + _SMALL * np.diag(covariance)))
