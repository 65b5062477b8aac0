"""How a process that fits logs is set up, before it imports NumPy."""

from __future__ import annotations

import os

_THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
_LARGE = 31 << 20


def prepare() -> None:
    """One thread for linear algebra, and memory that is kept between its arrays.

    Notes
    -----
    The matrices of a fit are small: threads that wait for each other over them take half as long
    again and twice the processor.

    A fit makes and drops arrays of megabytes by the thousand. glibc hands memory of such a size
    back to the system, which clears its pages for the next array, until a block as large as that
    of ``_LARGE`` bytes (its most is 32 MB) was dropped: a sixth of a fit's time. The block costs
    nothing, for its pages are never touched; other systems do not notice.
    """
    for name in _THREADS:
        os.environ.setdefault(name, "1")
    bytearray(_LARGE)
