"""An archive that holds one log, unpacked as far as a log may be large."""

from __future__ import annotations

import gzip
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Protocol

from magcomp.errors import LogError

LARGEST = 1 << 30
"""Bytes of a log out of an archive; more are refused, unpacked or announced."""

MOST_FILES = 1000
"""Files of a .zip that are looked into."""

_PIECE = 1 << 20
_NAMES_SHOWN = 5
_NAME_SHOWN = 60
_ENCRYPTED = 0x1
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ZIP = (b"PK\x03\x04", b"PK\x05\x06", b"PK\x07\x08")
_GZIP = b"\x1f\x8b"
# All that the standard library's readers are known to raise on damaged archives.
_DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    NotImplementedError,
    OSError,
    OverflowError,
    RuntimeError,
    ValueError,
)


def is_archive(head: bytes) -> bool:
    """Tell from its first bytes whether a file is one that :func:`unpacked` opens."""
    return head.startswith((*_ZIP, _GZIP))


class _Readable(Protocol):
    def read(self, size: int, /) -> bytes:
        """At most ``size`` bytes; none at the end."""


@contextmanager
def unpacked(
    path: Path, is_log: Callable[[bytes], bool], head_size: int, *, limit: int = LARGEST
) -> Iterator[Path]:
    """The one log of an archive as a file, which is gone when the block ends.

    Parameters
    ----------
    path
        A .zip or .gz.
    is_log
        Tells from first bytes whether a file in the archive is a log.
    head_size
        How many first bytes it looks at.
    limit
        Largest size of the log.

    Raises
    ------
    LogError
        The archive is damaged or locked, holds no log or several, or one that is too large.
    """
    with tempfile.TemporaryDirectory(prefix="magcomp-", ignore_cleanup_errors=True) as folder:
        target = Path(folder) / "log"
        try:
            with path.open("rb") as file:
                if file.read(len(_GZIP)) == _GZIP:
                    file.seek(0)
                    with gzip.open(file) as content:
                        _copy(path, content, target, limit)
                else:
                    with zipfile.ZipFile(path) as archive:
                        _unzip(path, archive, target, is_log, head_size, limit)
        except _DAMAGED as error:
            raise LogError(
                f"Log {path} must be a sound archive; instead it is damaged "
                f"({_shown(str(error))}): copy it again, or unpack it and give the log."
            ) from error
        yield target


def _unzip(
    path: Path,
    archive: zipfile.ZipFile,
    target: Path,
    is_log: Callable[[bytes], bool],
    head_size: int,
    limit: int,
) -> None:
    if not all(info.filename for info in archive.infolist()):
        raise zipfile.BadZipFile("a file in it has no name")
    files = [info for info in archive.infolist() if not info.is_dir()]
    if len(files) > MOST_FILES:
        raise LogError(
            f"Log {path} must be an archive of one log; instead it holds {len(files)} files: "
            "unpack it and give the log."
        )
    for info in files:
        if info.flag_bits & _ENCRYPTED or info.compress_type not in _METHODS:
            how = "locked" if info.flag_bits & _ENCRYPTED else "packed in an unusual way"
            raise LogError(
                f"Log {path} must be an archive that can be opened; instead "
                f"{_shown(info.filename)} in it is {how}: unpack it and give the log."
            )
    logs = [info for info in files if is_log(_head(archive, info, head_size))]
    if len(logs) != 1:
        raise LogError(_not_one(path, [info.filename for info in (logs or files)], bool(logs)))
    with archive.open(logs[0]) as content:
        _copy(path, content, target, limit, logs[0].file_size)


def _head(archive: zipfile.ZipFile, info: zipfile.ZipInfo, size: int) -> bytes:
    with archive.open(info) as content:
        return content.read(size)


def _copy(path: Path, content: _Readable, target: Path, limit: int, announced: int = 0) -> None:
    size = 0
    with target.open("wb") as file:
        while announced <= limit and size <= limit:
            piece = content.read(min(_PIECE, limit + 1 - size))
            if not piece:
                return
            size += len(piece)
            _write(path, file, piece)
    raise LogError(
        f"Log {path} must hold a log of at most {limit >> 20} MB; instead received more: "
        "unpack it and give the log."
    )


def _write(path: Path, file: IO[bytes], piece: bytes) -> None:
    try:
        file.write(piece)
    except OSError as error:
        raise LogError(
            f"Log {path} must be unpacked to be read; instead {error.strerror}: make room, or "
            "unpack it elsewhere and give the log."
        ) from error


def _not_one(path: Path, names: list[str], are_logs: bool) -> str:
    listed = ", ".join(map(_shown, names[:_NAMES_SHOWN])) + (" …" if names[_NAMES_SHOWN:] else "")
    if are_logs:
        return (
            f"Log {path} must be an archive of one log; instead it holds {len(names)} logs "
            f"({listed}): unpack it and give one of them."
        )
    holds = f"no log ({listed})" if names else "nothing"
    return f"Log {path} must be an archive of one log; instead it holds {holds}: give the log."


def _shown(name: str) -> str:
    """A name from a file nobody vouches for, for people."""
    clean = "".join(letter if letter.isprintable() else "?" for letter in name)
    return clean if len(clean) <= _NAME_SHOWN else clean[: _NAME_SHOWN - 1] + "…"
