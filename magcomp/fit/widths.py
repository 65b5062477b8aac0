"""How wide a prior around nothing is, told by what it is a prior of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from magcomp.model import FloatArray


def weights_of(found: FloatArray, spreads: Sequence[FloatArray]) -> FloatArray:
    """How much each of several priors counts: by the density it gives what was found.

    Parameters
    ----------
    found
        Shape (k,).
    spreads
        With each prior, the covariance of what would be found, shape (k, k).

    Returns
    -------
    ndarray
        One weight a prior, 1 together.

    Examples
    --------
    >>> near, far = np.array([0.1]), np.array([5.0])
    >>> narrow_or_wide = [np.eye(1), 25.0 * np.eye(1)]
    >>> weights_of(near, narrow_or_wide).round(2).tolist()
    [0.83, 0.17]
    >>> weights_of(far, narrow_or_wide).round(2).tolist()
    [0.0, 1.0]
    """
    density = np.array(
        [
            -0.5 * float(found @ np.linalg.solve(each, found))
            - 0.5 * float(np.linalg.slogdet(each)[1])
            for each in spreads
        ]
    )
    weights = np.exp(density - density.max())
    return np.asarray(weights / weights.sum())
