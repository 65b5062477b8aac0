"""Logs in, a Recording out: the same whatever recorded it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from magcomp.errors import LogError
from magcomp.model import Recording
from magcomp.sources.source import mapped
from magcomp.sources.tlog import read_tlog

__all__ = ["read"]

_HEAD = 16
# First bytes and names of logs that are not telemetry logs.
_BEGINNINGS = {b"ULog\x01\x12\x35": "a PX4 log (.ulg)", b"\xa3\x95": "a dataflash log (.BIN)"}
_SUFFIXES = {
    ".ulg": "a PX4 log (.ulg)",
    ".bin": "a dataflash log (.BIN)",
    ".log": "a dataflash log in text (.log)",
    ".csv": "a table (.csv)",
}


def read(
    path: str | Path,
    *,
    system: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Read a log of any format that magcomp knows.

    Parameters
    ----------
    path
        The log. What it holds counts, not its name.
    system
        The vehicle's MAVLink system, or None where the log holds only one.
    progress
        Called with the read fraction, 0 to 1.

    Raises
    ------
    LogError
        The file cannot be read, or its format is not known yet.
    ChooseVehicleError
        The log holds several vehicles and ``system`` is None, or ``system`` is not in it.
    """
    with mapped(path) as data:
        head = bytes(data[:_HEAD])
    known = (name for beginning, name in _BEGINNINGS.items() if head.startswith(beginning))
    other = next(known, _SUFFIXES.get(Path(path).suffix.lower()))
    if other is not None:
        raise LogError(
            f"Log {path} must be a telemetry log (.tlog); instead received {other}, "
            "which cannot be read yet."
        )
    return read_tlog(path, system=system, progress=progress)
