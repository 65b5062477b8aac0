"""Logs in, a Recording out: the same whatever recorded it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from magcomp.errors import InputError, NoLogError
from magcomp.model import Recording
from magcomp.sources.archive import is_archive, unpacked
from magcomp.sources.formats import FORMATS, HEAD, Progress, format_of, is_log, other_of
from magcomp.sources.source import mapped
from magcomp.sources.tlog import read_tlog
from magcomp.sources.vehicles import Choice

__all__ = ["read", "read_tlog"]


def read(
    path: str | Path,
    *,
    system: int | None = None,
    component: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Read a log of any format that magcomp knows, or an archive that holds one.

    Parameters
    ----------
    path
        The log. What it holds counts, not its name.
    system, component
        The vehicle's MAVLink system, or None where the log holds only one, and its autopilot's
        component, or None for the usual one.
    progress
        Called with the read fraction, 0 to 1.

    Raises
    ------
    LogError
        The file cannot be read; as NoLogError, it is not there or no log that magcomp reads.
    ChooseVehicleError
        The log holds several vehicles and none is chosen, or the chosen one is not in it.
    """
    path, choice = Path(path), Choice(system, component)
    if not is_archive(_head(path)):
        return _read(path, choice, progress)
    with unpacked(path, is_log, HEAD) as inner:
        try:
            recording = _read(inner, choice, progress)
        except InputError as error:
            # The user knows the archive, not where it was unpacked.
            raise type(error)(str(error).replace(str(inner), f"{path}, unpacked,")) from error
    return replace(recording, source=str(path))


def _read(path: Path, choice: Choice, progress: Progress | None) -> Recording:
    head = _head(path)
    other = other_of(head)
    if other is not None:
        wanted = " or ".join(each.title for each in FORMATS)
        raise NoLogError(
            f"Log {path} must be {wanted}; instead received {other.title}: {other.advice}."
        )
    # What nobody recognises may be a telemetry log whose beginning is damaged.
    chosen = format_of(head) or FORMATS[-1]
    return chosen.read(path, choice, progress)


def _head(path: Path) -> bytes:
    with mapped(path) as data:
        return bytes(data[:HEAD])
