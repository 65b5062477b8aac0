"""Readings so wild that nothing can be worked out from them end in a sentence, not in NumPy's."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np

from magcomp.errors import MissingDataError
from magcomp.model import FloatArray


@contextmanager
def solvable(compass: int) -> Iterator[None]:
    """Work on one compass: what has no solution is named.

    Numbers that overflow on the way are left to :func:`require_finite` at its end, because only
    there is it known whether they mattered.

    Raises
    ------
    MissingDataError
        Where equations have no solution.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except np.linalg.LinAlgError as error:
        raise _unsolvable(compass) from error


def require_finite(compass: int, numbers: Iterable[FloatArray | float]) -> None:
    """Refuse an answer with a number that is none: no limit holds it back.

    Raises
    ------
    MissingDataError
        Where one is not finite.
    """
    if not all(np.isfinite(each).all() for each in numbers):
        raise _unsolvable(compass)


def _unsolvable(compass: int) -> MissingDataError:
    return MissingDataError(
        f"The readings of compass {compass} and what goes with them must be those of a vehicle; "
        "instead they hold numbers so wild that nothing follows from them"
    )
