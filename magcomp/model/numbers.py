"""Numbers as they stand in a file or a frame, made into numbers to reckon with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def as_floats(values: NDArray[Any]) -> NDArray[np.float64]:
    """Any numbers as float64, shape kept; a signalling NaN becomes a quiet one, and no warning.

    Examples
    --------
    The bytes of a signalling NaN, which NumPy by itself would warn of:

    >>> signalling = np.frombuffer(bytes.fromhex("0100807f"), dtype="<f4")
    >>> as_floats(signalling).tolist()
    [nan]
    """
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)
