"""What holds for every test."""

from __future__ import annotations

import gc
import os
import sys
import tempfile

import pytest
from effort import examples
from hypothesis import settings

# The matrices of a fit are small: more threads only wait for each other. Set before numpy is
# loaded; programs that tests start inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# An app is drawn when it has something new to show; sixty times a second is for eyes.
os.environ.setdefault("TEXTUAL_FPS", "12")

# What is printed has Unicode in it, whatever the locale of the machine that tests.
os.environ["LC_ALL"] = "C.UTF-8"

# A busy machine is slow, not wrong: no test here is about the time of one example.
settings.register_profile("magcomp", deadline=None, max_examples=examples(50))
settings.load_profile("magcomp")

# Serial ports and terminals are played by pseudo-terminals, which Windows has not.
collect_ignore = (
    ["cli/test_cli_process.py", "link/test_link_connection.py", "link/test_link_transports.py"]
    if sys.platform == "win32"
    else []
)


def pytest_configure(config: pytest.Config) -> None:
    """Make the folder of `once.py`; the processes that share the tests inherit its name."""
    if not hasattr(config, "workerinput"):
        folder = tempfile.TemporaryDirectory(prefix="magcomp-tests-")
        config.add_cleanup(folder.cleanup)
        os.environ["MAGCOMP_TESTS_ONCE"] = folder.name


def pytest_sessionstart() -> None:
    """Let nothing be looked through while the tests are found: none of it is garbage."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Look for garbage again, but not among thousands of tests, which live to the end."""
    gc.freeze()
    gc.enable()


@pytest.fixture
def fits_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let commands that run in this process share their fits with other tests."""
    import once  # noqa: PLC0415 - loads numpy, for which it is too early above

    monkeypatch.setattr("magcomp.cli.work.analyse", once.analyse)
