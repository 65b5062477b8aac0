"""The recordings of real firmware, each read once in a process and analysed once in a run."""

from __future__ import annotations

from functools import cache

import once
import truth

from magcomp.analysis import Options
from magcomp.model import Analysis, CompassResult, Recording
from magcomp.sources import read


@cache
def recording(name: str) -> Recording:
    """A recording of sitl_fixtures/; a .tlog where the name does not say otherwise."""
    return read(truth.FIXTURES / (name if "." in name else f"{name}.tlog"))


@cache
def analysis(name: str, options: Options | None = None) -> Analysis:
    """What magcomp makes of it, asked for nothing in particular or for what the options say."""
    return once.analyse(recording(name), options)


def result(name: str, compass: int) -> CompassResult:
    """One compass of it."""
    return next(c for c in analysis(name).compasses if c.fit.compass == compass)


@cache
def of_fixture(name: str) -> truth.Truth:
    """The vehicle as it really was."""
    return truth.of_fixture(name.partition(".")[0], recording(name).start_unix_s)


REAL_LOGS = sorted(truth.REAL.glob("*")) if truth.REAL.is_dir() else []
"""Logs of real vehicles, where the folder beside the repository is."""
