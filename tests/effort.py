"""How hard generated tests look: little each time, a lot with ``make test-all``."""

from __future__ import annotations

import os

TIMES = int(os.environ.get("MAGCOMP_EFFORT", "1"))
"""By how much more there is of everything that is drawn by lot."""


def examples(count: int) -> int:
    """Number of examples that hypothesis makes up."""
    return count * TIMES
