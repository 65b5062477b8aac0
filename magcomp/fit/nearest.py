"""A field that follows several quantities, as nearly as fewer can follow it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from magcomp.model import Correction, FloatArray


def nearest(added: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A field as a constant and vectors times the columns of u, by least squares.

    Parameters
    ----------
    added
        mGauss, shape (n, 3).
    u
        Shape (n, m).

    Returns
    -------
    ndarray, shape (1 + m, 3)
        The constant and the vectors.
    ndarray, shape (n, 3)
        What they leave, mGauss.

    Examples
    --------
    >>> u = np.array([[0.0], [1.0], [2.0]])
    >>> found, left = nearest(5.0 + u * [[1.0, 2.0, -1.0]], u)
    >>> found.round(6).tolist()
    [[5.0, 5.0, 5.0], [1.0, 2.0, -1.0]]
    """
    design = np.column_stack([np.ones(len(u)), u])
    found: FloatArray = np.linalg.lstsq(design, added, rcond=None)[0].astype(np.float64)
    return found, np.asarray(added - design @ found)


def moved(correction: Correction, found: FloatArray) -> Correction:
    """A correction with what :func:`nearest` found in the place of its motor vectors.

    The offsets take up the constant.
    """
    offset = correction.offset + np.linalg.solve(correction.soft_iron, found[0])
    return replace(correction, offset=offset, motor=found[1:].T)
