"""What is dear to work out is worked out once in a run of the tests, whichever process needs it.

The tests run in several processes and many of them begin with the same fit of the same log. The
first to need it leaves it in a folder of this run, which `conftest.py` makes and removes.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from magcomp import analysis
from magcomp.analysis import Options
from magcomp.model import Analysis, Recording

FOLDER = "MAGCOMP_TESTS_ONCE"
"""Environment variable that names the folder, and so reaches every process of the run."""

_T = TypeVar("_T")


def once(make: Callable[[], _T], *key: object) -> _T:
    """What ``make`` gives, a copy of its own for everybody who asks by an equal key."""
    name = hashlib.sha256(pickle.dumps(key)).hexdigest()
    path = Path(os.environ[FOLDER]) / name
    if path.is_file():
        return pickle.loads(path.read_bytes())  # noqa: S301 - written by ourselves
    made = make()
    part = path.with_suffix(f".{os.getpid()}-{threading.get_ident()}")
    part.write_bytes(pickle.dumps(made))
    part.replace(path)
    return made


def analyse(
    recording: Recording,
    options: Options | None = None,
    progress: Callable[[str, float], None] = lambda what, share: None,
) -> Analysis:
    """As :func:`magcomp.analysis.analyse`, of an equal recording only once."""
    wanted = Options() if options is None else options
    return once(lambda: analysis.analyse(recording, wanted, progress), recording, wanted)
