"""The command line. Nothing heavy is imported before a command runs."""

import os

# The matrices of a fit are small: threads that wait for each other over them take half as long
# again and twice the processor. It must be said before numpy is imported.
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

from magcomp.cli.app import main  # noqa: E402

__all__ = ["main"]
