"""What a correction leaves unexplained."""

from __future__ import annotations

import numpy as np

from magcomp.model import Correction, FloatArray, Samples

_KEPT = 0.99


def residuals(
    samples: Samples, correction: Correction, strength: float, vertical: float
) -> FloatArray:
    """Strength and vertical part of the corrected field less the earth's, mGauss, shape (n, 2)."""
    return departures(correction.apply(samples.raw, samples.u), samples.down, strength, vertical)


def departures(field: FloatArray, down: FloatArray, strength: float, vertical: float) -> FloatArray:
    """The same for a field already corrected, shape (n, 2).

    Examples
    --------
    >>> field, down = np.array([[300.0, 0.0, 410.0]]), np.array([[0.0, 0.0, 1.0]])
    >>> departures(field, down, 500.0, 400.0).round(2).tolist()
    [[8.04, 10.0]]
    """
    size = np.linalg.norm(field, axis=1)
    along = np.einsum("ij,ij->i", field, down)
    return np.stack([size - strength, along - vertical], axis=1)


def spread(left: FloatArray) -> float:
    """Root mean square length of residual rows, mGauss, the worst hundredth left out.

    Examples
    --------
    >>> spread(np.array([[3.0, 4.0], [3.0, 4.0]]))
    5.0
    """
    square = np.sort(np.sum(left**2, axis=1))
    return float(np.sqrt(np.mean(square[: max(1, int(_KEPT * len(square)))])))
