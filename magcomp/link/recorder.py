"""Writes what arrives into a .tlog, frame by frame, so that a crash loses nothing of it.

A record is a big-endian 64-bit count of microseconds since 1970 and one MAVLink frame.
"""

from __future__ import annotations

import errno
import os
from pathlib import Path
from types import TracebackType
from typing import Self

from magcomp.errors import OutputError
from magcomp.mavlink.records import record


class Recorder:
    """A .tlog being written. Each frame reaches the operating system before ``add`` returns.

    So a killed program loses nothing; a computer that loses power, what its
    system had not yet put on the disk.

    Parameters
    ----------
    path
        The file to make.
    force
        Replace a file that is there.

    Raises
    ------
    OutputError
        The file exists and ``force`` is not given, or it cannot be made.
    """

    def __init__(self, path: Path, *, force: bool = False) -> None:
        self.path = path
        self.frames = 0
        try:
            self._file = path.open("wb" if force else "xb", buffering=0)
        except FileExistsError as error:
            raise OutputError(
                f"{path} already exists; choose another name or replace it with --force."
            ) from error
        except OSError as error:
            raise OutputError(f"{path} cannot be written: {error.strerror}.") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def add(self, unix_us: int, frame: bytes) -> None:
        """Write one frame that arrived at ``unix_us``.

        Raises
        ------
        OutputError
            The disk is full, gone or read-only.
        """
        left = record(unix_us, frame)
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            raise OutputError(f"{self.path} cannot be written: {error.strerror}.") from error
        self.frames += 1

    def close(self) -> None:
        """Put everything on the disk and close the file. Closing twice is harmless.

        Raises
        ------
        OutputError
            The disk did not take it.
        """
        if self._file.closed:
            return
        try:
            with self._file:
                os.fsync(self._file.fileno())
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.ENOTSUP):
                return  # a pipe or a device: there is no disk to wait for
            raise OutputError(f"{self.path} cannot be written: {error.strerror}.") from error
