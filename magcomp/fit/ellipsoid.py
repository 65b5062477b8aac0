"""Ellipsoids of raw field: one shape, one or many centres.

Every raw reading lies on |D · (raw − centre)| = F (docs/method.md, Equations 4 to 6). D is kept
symmetric and positive definite, so the surface is an ellipsoid and nothing
else; several levels of the control quantity share D and have a centre each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from magcomp.errors import FitRejectedError
from magcomp.fit.robust import Prior, solve
from magcomp.model import FloatArray, IntArray, symmetric

_SHAPE = 6
_LEAST_READINGS = 12
_LEAST_SPREAD = 0.05


@dataclass(frozen=True, eq=False)
class Ellipsoids:
    """One soft-iron shape and a centre per level.

    Attributes
    ----------
    soft_iron
        D, symmetric, shape (3, 3).
    centres
        mGauss, shape (k, 3).
    covariance
        Of [D_xx, D_yy, D_zz, D_xy, D_xz, D_yz, centre₀, centre₁, …], shape (6 + 3k, 6 + 3k).
    strength
        F the readings were scaled to, mGauss.
    noise
        Robust spread of |D · (raw − centre)| − F, mGauss.
    """

    soft_iron: FloatArray
    centres: FloatArray
    covariance: FloatArray
    strength: float
    noise: float

    def centre_covariance(self, level: int) -> FloatArray:
        """Covariance of one centre, mGauss², shape (3, 3)."""
        first = _SHAPE + 3 * level
        return self.covariance[first : first + 3, first : first + 3]

    def drifting(self, shared: FloatArray) -> Ellipsoids:
        """The same with centres that drifted, by a covariance alike on each axis, shape (k, k)."""
        covariance = self.covariance.copy()
        covariance[_SHAPE:, _SHAPE:] += np.kron(shared, np.eye(3))
        return replace(self, covariance=covariance)


def fit_ellipsoid(raw: FloatArray, strength: float) -> Ellipsoids:
    """Robust ellipsoid through readings; see :func:`fit_ellipsoids`.

    Examples
    --------
    >>> turned = np.random.default_rng(1).normal(size=(200, 3))
    >>> field = 500.0 * turned / np.linalg.norm(turned, axis=1)[:, None]
    >>> fit_ellipsoid(field + [100.0, -40.0, 20.0], 500.0).centres.round(3).tolist()
    [[100.0, -40.0, 20.0]]
    """
    return fit_ellipsoids(raw, np.zeros(len(raw), dtype=np.intp), strength)


def fit_ellipsoids(
    raw: FloatArray,
    level: IntArray,
    strength: float,
    *,
    blocks: IntArray | None = None,
) -> Ellipsoids:
    """Robust ellipsoids of one shape through the readings of several levels.

    Parameters
    ----------
    raw
        mGauss, shape (n, 3).
    level
        Level of each reading, 0 … k − 1, shape (n,).
    strength
        Earth field strength, mGauss: sets the scale of D.
    blocks
        Block in time of each reading, shape (n,), ascending; each its own by default.

    Raises
    ------
    FitRejectedError
        With too few readings, or readings that lie on no ellipsoid.
    """
    count = int(level.max()) + 1 if len(level) else 0
    if len(raw) < _LEAST_READINGS or count == 0:
        raise FitRejectedError(
            f"An ellipsoid needs at least {_LEAST_READINGS} readings; instead received {len(raw)}"
        )
    moved = float(np.median(np.linalg.norm(raw - np.median(raw, axis=0), axis=1)))
    if moved < _LEAST_SPREAD * strength:
        raise FitRejectedError(
            f"An ellipsoid needs readings from all round; instead half of them lie within "
            f"{moved:.3g} mGauss of one point"
        )
    begin = _spheres(raw, level, count, strength)
    rows = np.arange(len(raw))
    columns = _SHAPE + 3 * level

    def residuals(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        shape = symmetric(parameters[:_SHAPE])
        centred = raw - parameters[_SHAPE:].reshape(count, 3)[level]
        corrected = centred @ shape.T
        size = np.linalg.norm(corrected, axis=1)
        along = corrected / size[:, None]
        slopes = np.zeros((len(raw), 1, len(parameters)))
        slopes[:, 0, :3] = along * centred
        for column, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)), start=3):
            slopes[:, 0, column] = along[:, i] * centred[:, j] + along[:, j] * centred[:, i]
        pull = -along @ shape
        for axis in range(3):
            slopes[rows, 0, columns + axis] = pull[:, axis]
        return (size - strength)[:, None], slopes

    known = Prior(mean=begin, width=_widths(count, strength))
    found = solve(
        residuals,
        begin,
        known,
        blocks=rows if blocks is None else blocks,
        feasible=_is_ellipsoid,
    )
    return Ellipsoids(
        soft_iron=symmetric(found.parameters[:_SHAPE]),
        centres=found.parameters[_SHAPE:].reshape(count, 3),
        covariance=found.covariance,
        strength=strength,
        noise=float(found.noise[0]),
    )


def _widths(count: int, strength: float) -> FloatArray:
    """Wide enough not to be felt, narrow enough to keep an unseen direction from running away."""
    return np.concatenate([np.full(_SHAPE, 0.5), np.full(3 * count, 3.0 * strength)])


def _is_ellipsoid(parameters: FloatArray) -> bool:
    values = np.linalg.eigvalsh(symmetric(parameters[:_SHAPE]))
    return bool(values[0] > 0.2 and values[-1] < 5.0)


def _spheres(raw: FloatArray, level: IntArray, count: int, strength: float) -> FloatArray:
    """A sphere per level by linear least squares: |x|² = 2 x·c + (r² − |c|²)."""
    centres = np.empty((count, 3))
    for index in range(count):
        points = raw[level == index]
        middle = points.mean(axis=0)
        shifted = points - middle
        design = np.column_stack([2 * shifted, np.ones(len(points))])
        # A little pull towards the mean: a turn about one axis says nothing along that axis.
        ridge = 1e-3 * len(points) * np.diag([1.0, 1.0, 1.0, 0.0]) * strength**2
        solution = np.linalg.solve(
            design.T @ design + ridge + 1e-9 * np.eye(4), design.T @ np.sum(shifted**2, axis=1)
        )
        centres[index] = middle + solution[:3]
    spread = np.linalg.norm(raw - centres[level], axis=1)
    scale = strength / float(np.median(spread))
    return np.concatenate([[scale, scale, scale, 0.0, 0.0, 0.0], centres.reshape(-1)])
