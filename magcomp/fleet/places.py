"""Where logs lie: files, folders, patterns, and addresses such as ``s3://`` and ``http://``."""

from __future__ import annotations

import glob
import math
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from types import ModuleType
from typing import Any

from magcomp.errors import LogError, UsageError
from magcomp.fleet.row import Log

SUFFIXES = (".tlog", ".bin", ".log", ".ulg", ".zip", ".gz")
"""Of logs in a folder, in any case. A file that is named is taken whatever its name."""

_MAGIC = frozenset("*?[")
_PIECE = 1 << 20


def is_address(path: str) -> bool:
    """Tell an address from a file's name."""
    return "://" in path


def find(paths: Iterable[str]) -> tuple[Log, ...]:
    """Every log at these places, each once, in the order of their names.

    Parameters
    ----------
    paths
        Files, folders (with all that is below), patterns (``**`` is any depth) and addresses.

    Raises
    ------
    UsageError
        Where a place does not exist.
    """
    found: dict[str, Log] = {}
    for path in paths:
        for log in _at_address(path) if is_address(path) else _on_disk(path):
            found.setdefault(log.path, log)
    return tuple(found[path] for path in sorted(found))


def _on_disk(path: str) -> Iterator[Log]:
    if os.path.isdir(path):  # noqa: PTH112 - a Path would drop what a name holds
        yield from _below(path)
        return
    known = _log(path)
    if known is not None:
        yield known
        return
    matches = glob.glob(path, recursive=True) if _MAGIC & set(path) else []  # noqa: PTH207
    if not matches:
        raise UsageError(
            f"{path} must be a log, a folder of logs or a pattern that some match; instead there "
            "is none"
        )
    for match in matches:
        yield from _on_disk(match)


def _below(folder: str) -> Iterator[Log]:
    for root, _, names in os.walk(folder):
        for name in names:
            if name.lower().endswith(SUFFIXES):
                log = _log(os.path.join(root, name))  # noqa: PTH118
                if log is not None:
                    yield log


def _log(path: str) -> Log | None:
    try:
        status = Path(path).stat()
    except (OSError, ValueError):
        return None
    return Log(path, status.st_size, str(status.st_mtime_ns), status.st_mtime)


# ---------------------------------------------------------------- addresses


def _fsspec() -> ModuleType:
    try:
        import fsspec  # noqa: PLC0415 - optional
    except ImportError as error:
        raise UsageError(
            "An address must be opened with fsspec, which is not installed: pip install "
            "'magcomp[fleet]'"
        ) from error
    module: ModuleType = fsspec
    return module


def _at_address(address: str) -> Iterator[Log]:
    fsspec = _fsspec()
    try:
        system, path = fsspec.core.url_to_fs(address)
        if _MAGIC & set(path):
            found = system.glob(path, detail=True)
        elif system.isfile(path) and path.lower().endswith(SUFFIXES):
            found = {path: system.info(path)}
        else:
            found = {
                name: info
                for name, info in system.find(path, detail=True).items()
                if name.lower().endswith(SUFFIXES)
            }
            if not found:
                # What looks for files leaves out what cannot be reached; a list of it does not.
                system.ls(path, detail=False)
    # Every file system of fsspec has errors of its own.
    except Exception as error:
        raise UsageError(f"{address} must be reachable; instead received: {error}") from error
    if not found:
        raise UsageError(f"{address} must hold logs; instead there is none")
    for name, listed in sorted(found.items()):
        if listed.get("type", "file") == "file":
            # A web server's list of files tells no more than their names.
            info = system.info(name) if listed.get("size") is None else listed
            yield _remote(str(system.unstrip_protocol(name)), info)


def _remote(address: str, info: Mapping[str, Any]) -> Log:
    stamps = ("ETag", "etag", "mtime", "LastModified", "last_modified", "created")
    stamp = next((str(info[key]) for key in stamps if info.get(key)), "")
    size = info.get("size")
    moments = (info.get(key) for key in ("mtime", "LastModified", "last_modified"))
    modified = next((_unix(each) for each in moments if each), math.nan)
    return Log(address, -1 if size is None else int(size), stamp, modified)


def _unix(moment: object) -> float:
    if isinstance(moment, datetime):
        return moment.timestamp()
    return float(moment) if isinstance(moment, (int, float)) else math.nan


@contextmanager
def fetched(address: str) -> Iterator[Path]:
    """What lies at an address as a file, which is gone when the block ends.

    Raises
    ------
    LogError
        Where it cannot be fetched.
    """
    fsspec = _fsspec()
    with tempfile.TemporaryDirectory(prefix="magcomp-", ignore_cleanup_errors=True) as folder:
        target = Path(folder) / "log"
        try:
            with fsspec.open(address, "rb") as source, target.open("wb") as file:
                shutil.copyfileobj(source, file, _PIECE)
        except Exception as error:
            raise LogError(f"Log {address} must be reachable; instead received: {error}") from error
        yield target
