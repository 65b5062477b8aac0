"""The line in space on which the ellipsoid centres lie, in three forms.

- :func:`paper_line`: the paper's iteration exactly (docs/method.md, Equations 14 to 16). It has
  no answer for a line perpendicular to z, lets constants of its design matrix
  move, and treats all errors as equal.
- :func:`orthogonal_line`: through the centroid along the first principal
  direction: the most probable line for equal errors in every direction.
- :func:`weighted_line`: every centre with its own 3×3 covariance, exact
  constants, one position a centre: the most probable line for errors as they
  are. It is the default.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magcomp.errors import InputError
from magcomp.model import FloatArray, Level, Line

_SETTLED = 1e-12
_ITERATIONS = 500


@dataclass(frozen=True, eq=False)
class SpaceLine:
    """A line: point + position · direction.

    Attributes
    ----------
    point, direction
        mGauss and unit vector, shape (3,).
    """

    point: FloatArray
    direction: FloatArray

    def positions(self, centres: FloatArray) -> FloatArray:
        """Position of the foot of each centre along the line, shape (k,)."""
        return np.asarray((centres - self.point) @ self.direction)

    def distances(self, centres: FloatArray) -> FloatArray:
        """Distance of each centre from the line, shape (k,)."""
        feet = self.point + np.multiply.outer(self.positions(centres), self.direction)
        return np.asarray(np.linalg.norm(centres - feet, axis=1))


def paper_line(centres: FloatArray, *, threshold: float = 1e-9, most: int = 20_000) -> SpaceLine:
    """The paper's total least squares line x = a·z + b, y = c·z + d.

    Parameters
    ----------
    centres
        Shape (k, 3), k ≥ 2.
    threshold
        The iteration ends when no element of ξ = [a, b, c, d] changes by more.
    most
        Iterations allowed; it creeps: thousands are needed for centres a few noise widths apart.

    Raises
    ------
    InputError
        Where all centres share one z: the form x = a·z + b has no answer then.

    Notes
    -----
    docs/method.md, Equations 13 to 16: the form, V = B·ξ − L, B̂ᵀB̂·ξ = B̂ᵀL with the observed L,
    and (E + ξξᵀ)·B̂ᵀ = Bᵀ + ξLᵀ. As in 16, every element of B̂ may move.

    Examples
    --------
    >>> line = paper_line(np.array([[0.0, 0.0, 0.0], [2.0, 1.0, 2.0], [4.0, 2.0, 4.0]]))
    >>> line.direction.round(3).tolist()
    [0.667, 0.333, 0.667]
    """
    centres = _checked(centres)
    count = len(centres)
    design = np.zeros((2 * count, 4))
    design[0::2, 0] = centres[:, 2]
    design[0::2, 1] = 1.0
    design[1::2, 2] = centres[:, 2]
    design[1::2, 3] = 1.0
    observed = centres[:, :2].reshape(-1)
    moved, solution = design, np.full(4, np.inf)
    for _ in range(most):
        normal = moved.T @ moved
        if moved is design and np.linalg.cond(normal) > 1 / np.finfo(np.float64).eps:
            raise InputError(
                "The paper's line x = a·z + b needs centres at different z; instead all "
                f"{count} centres lie within {np.ptp(centres[:, 2]):.3g} mGauss of one z"
            )
        previous, solution = solution, np.linalg.solve(normal, moved.T @ observed)
        if np.abs(solution - previous).max() <= threshold:
            break
        # (E + ξξᵀ)⁻¹ = E − ξξᵀ / (1 + ξᵀξ), and so B̂ = B + (L − Bξ)·ξᵀ / (1 + ξᵀξ).
        share = (observed - design @ solution) / (1.0 + solution @ solution)
        moved = design + share[:, None] * solution
    a, b, c, d = solution
    direction = np.array([a, c, 1.0])
    return SpaceLine(np.array([b, d, 0.0]), direction / np.linalg.norm(direction))


def orthogonal_line(centres: FloatArray, weights: FloatArray | None = None) -> SpaceLine:
    """Line through the weighted centroid along the first principal direction.

    Parameters
    ----------
    centres
        Shape (k, 3), k ≥ 2.
    weights
        Shape (k,); equal by default.

    Examples
    --------
    A line perpendicular to z, which the paper's form does not have:

    >>> line = orthogonal_line(np.array([[0.0, 0.0, 5.0], [3.0, 4.0, 5.0], [6.0, 8.0, 5.0]]))
    >>> np.abs(line.direction).round(9).tolist()
    [0.6, 0.8, 0.0]
    """
    centres = _checked(centres)
    weights = np.ones(len(centres)) if weights is None else weights
    centroid = np.average(centres, axis=0, weights=weights)
    _, _, directions = np.linalg.svd((centres - centroid) * np.sqrt(weights)[:, None])
    return SpaceLine(centroid, directions[0])


def weighted_line(centres: FloatArray, covariances: FloatArray) -> SpaceLine:
    """Structured errors-in-variables line: each centre with its own covariance.

    Parameters
    ----------
    centres
        Shape (k, 3), k ≥ 2.
    covariances
        Shape (k, 3, 3), positive definite.

    Notes
    -----
    Minimises Σ (xₖ − P − tₖ d)ᵀ Σₖ⁻¹ (xₖ − P − tₖ d) over P, d and every tₖ, in turn: the
    positions for a given line, then the line for given positions (docs/method.md, Three
    lines).

    Examples
    --------
    A centre known badly hardly moves the line:

    >>> centres = np.array([[0.0, 0.0, 0.0], [1.0, 5.0, 0.0], [2.0, 0.0, 0.0]])
    >>> known = np.array([np.eye(3), 1e6 * np.eye(3), np.eye(3)])
    >>> np.abs(weighted_line(centres, known).direction).round(3).tolist()
    [1.0, 0.0, 0.0]
    """
    centres = _checked(centres)
    precision: FloatArray = np.asarray(np.linalg.inv(covariances), dtype=np.float64)
    line = orthogonal_line(centres, 1.0 / np.trace(covariances, axis1=1, axis2=2))
    for _ in range(_ITERATIONS):
        towards = np.einsum("kij,j->ki", precision, line.direction)
        along = np.einsum("ki,ki->k", towards, centres - line.point)
        positions = along / (towards @ line.direction)
        updated = _line_for(centres, precision, positions - np.mean(positions))
        change = np.abs(updated.direction - line.direction).max()
        line = updated
        if change < _SETTLED:
            break
    return line


def _line_for(centres: FloatArray, precision: FloatArray, positions: FloatArray) -> SpaceLine:
    """The most probable point and direction for given positions: six linear equations."""
    normal = np.empty((6, 6))
    normal[:3, :3] = precision.sum(axis=0)
    normal[:3, 3:] = np.einsum("k,kij->ij", positions, precision)
    normal[3:, :3] = normal[:3, 3:]
    normal[3:, 3:] = np.einsum("k,kij->ij", positions**2, precision)
    pulled = np.einsum("kij,kj->ki", precision, centres)
    right = np.concatenate([pulled.sum(axis=0), positions @ pulled])
    solution = np.linalg.lstsq(normal, right, rcond=None)[0]
    size = np.linalg.norm(solution[3:])
    return SpaceLine(solution[:3], solution[3:] / size if size > 0 else np.eye(3)[0])


def line_through(levels: tuple[Level, ...]) -> Line:
    """The weighted line through the centres of levels, and the position along it against u.

    Parameters
    ----------
    levels
        At least two, at different control quantities.

    Notes
    -----
    York's regression with errors of both, position on u (docs/method.md, Position along the
    line).
    """
    centres = np.stack([level.centre for level in levels])
    covariances = np.stack([level.covariance for level in levels])
    u = np.array([level.u for level in levels])
    u_std = np.array([level.u_std for level in levels])
    space = weighted_line(centres, covariances)
    positions = space.positions(centres)
    if np.polyfit(u, positions, 1)[0] < 0:
        space = SpaceLine(space.point, -space.direction)
        positions = -positions
    variance = np.einsum("i,kij,j->k", space.direction, covariances, space.direction)
    slope, intercept, slope_std = regress_with_errors(u, u_std**2, positions, variance)
    distance = space.distances(centres)
    spread = float(np.sum(np.var(centres, axis=0)))
    expected = space.point + np.multiply.outer(intercept + slope * u, space.direction) - centres
    inflated = covariances + np.einsum(
        "k,i,j->kij", (slope * u_std) ** 2, space.direction, space.direction
    )
    chi2 = float(
        np.einsum("ki,kij,kj->", expected, np.linalg.pinv(inflated, hermitian=True), expected)
    )
    return Line(
        point=space.point,
        direction=space.direction,
        positions=positions,
        slope=slope,
        intercept=intercept,
        slope_std=slope_std,
        rms=float(np.sqrt(np.mean(distance**2))),
        straightness=1.0 - float(np.mean(distance**2)) / spread if spread > 0 else 0.0,
        chi2=chi2,
        degrees=max(3 * len(levels) - 6, 0),
    )


def regress_with_errors(
    x: FloatArray, x_variance: FloatArray, y: FloatArray, y_variance: FloatArray
) -> tuple[float, float, float]:
    """Straight line y = intercept + slope · x with errors in both.

    Returns
    -------
    slope, intercept, slope_std

    Notes
    -----
    The effective-variance form: weights 1 / (σ_y² + slope² σ_x²), iterated, with x replaced by
    its most probable value as in York (1966).

    Examples
    --------
    >>> x, alike = np.array([0.0, 1.0, 2.0]), np.full(3, 0.01)
    >>> slope, intercept, _ = regress_with_errors(x, alike, 1.0 + 2.0 * x, alike)
    >>> round(slope, 6), round(intercept, 6)
    (2.0, 1.0)
    """
    slope = float(np.polyfit(x, y, 1)[0])
    for _ in range(_ITERATIONS):
        weight = 1.0 / (y_variance + slope**2 * x_variance)
        x_mean, y_mean = np.average(x, weights=weight), np.average(y, weights=weight)
        dx, dy = x - x_mean, y - y_mean
        adjusted = weight * (dx * y_variance + slope * dy * x_variance)
        updated = float(np.sum(weight * adjusted * dy) / np.sum(weight * adjusted * dx))
        change, slope = abs(updated - slope), updated
        if change <= _SETTLED * (1.0 + abs(slope)):
            break
    return slope, float(y_mean - slope * x_mean), float(1.0 / np.sqrt(np.sum(weight * dx**2)))


def _checked(centres: FloatArray) -> FloatArray:
    centres = np.asarray(centres, dtype=np.float64)
    if centres.ndim != 2 or centres.shape[1] != 3 or len(centres) < 2:
        raise InputError(
            f"A line needs at least two centres of shape (k, 3); instead received {centres.shape}"
        )
    return centres
