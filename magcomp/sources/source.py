"""Open a log's bytes without loading them."""

from __future__ import annotations

import mmap
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from magcomp.errors import LogError, NoLogError
from magcomp.mavlink.checksum import ByteArray

_TEXT_SHARE = 0.95
_PRINTABLE = bytes([9, 10, 13, *range(32, 127)])


def is_text(head: bytes) -> bool:
    """Tell whether bytes are nearly all printable ASCII, and some are there."""
    return len(head) - len(head.translate(None, _PRINTABLE)) > _TEXT_SHARE * len(head)


@contextmanager
def mapped(path: str | Path) -> Iterator[ByteArray]:
    """Bytes of a file, brought into memory by the operating system as they are touched.

    Nothing that outlives the block may refer to the array.

    Raises
    ------
    NoLogError
        There is no such file, or it is not a regular file.
    LogError
        It cannot be read.
    """
    content = _map(Path(path))
    # Arrays still refer to the mapping when a caller's error is on its way; it closes with them.
    yield np.frombuffer(content, dtype=np.uint8)


def let_go(octets: ByteArray) -> None:
    """Give a file's bytes back to the operating system, which brings again what is still asked for.

    Bytes that are not those of a :func:`mapped` file stay where they are.
    """
    holder: object = octets
    while isinstance(holder, np.ndarray | memoryview):
        holder = holder.base if isinstance(holder, np.ndarray) else holder.obj
    # Windows takes them back by itself.
    if isinstance(holder, mmap.mmap) and hasattr(holder, "madvise"):
        holder.madvise(mmap.MADV_DONTNEED)


def _map(path: Path) -> mmap.mmap | bytes:
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            what = "a directory" if stat.S_ISDIR(status.st_mode) else "something that is no file"
            raise NoLogError(f"Log {path} must be a file; instead received {what}.")
        if not status.st_size:
            return b""
        with path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except FileNotFoundError:
        raise NoLogError(f"Log {path} must exist; instead found no such file.") from None
    except (OSError, ValueError) as error:
        raise LogError(f"Log {path} must be readable; instead received: {error}.") from error
