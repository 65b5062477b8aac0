"""What holds for every test."""

from __future__ import annotations

import os
import sys

from hypothesis import settings

# The matrices of a fit are small: more threads only wait for each other. Set before numpy is
# loaded; programs that tests start inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What is printed has Unicode in it, whatever the locale of the machine that tests.
os.environ["LC_ALL"] = "C.UTF-8"

# A busy machine is slow, not wrong: no test here is about the time of one example.
settings.register_profile("magcomp", deadline=None)
settings.load_profile("magcomp")

# Serial ports and terminals are played by pseudo-terminals, which Windows has not.
collect_ignore = (
    ["cli/test_cli_process.py", "link/test_link_connection.py", "link/test_link_transports.py"]
    if sys.platform == "win32"
    else []
)
