"""Writes what arrives into a .tlog, frame by frame, so that a crash loses nothing of it.

A record is a big-endian 64-bit count of microseconds since 1970 and one MAVLink frame.
"""

from __future__ import annotations

import errno
import os
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Self

from magcomp.errors import OutputError
from magcomp.mavlink.records import record


class Recorder:
    """A .tlog being written. Each frame reaches the operating system before ``add`` returns.

    So a killed program loses nothing; a computer that loses power, what its
    system had not yet put on the disk. Until the first frame comes, the file has another
    name: a vehicle that never answers leaves no empty file, and an older one as it is.

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
        self._force = force
        self._waiting: Path | None = None
        self._file: FileIO
        try:
            if path.exists() and not path.is_file():
                self._file = FileIO(path, "w")  # a pipe or a device keeps its name
                return
            self._refuse_existing()
            self._waiting = path.with_name(f".{path.name}.{os.getpid()}.part")
            self._file = FileIO(self._waiting, "w")
        except OSError as error:
            raise self._unwritable(error) from error

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
                left = left[self._file.write(left) or 0 :]
            if self._waiting is not None:
                self._name()
        except OSError as error:
            raise self._unwritable(error) from error
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
            raise self._unwritable(error) from error
        finally:
            if self._waiting is not None:
                self._waiting.unlink(missing_ok=True)

    def _name(self) -> None:
        """Give the file its name, now that there is something in it."""
        waiting, self._waiting = self._waiting, None
        if waiting is None:
            return
        self._refuse_existing()
        # Not every system renames a file that is open.
        self._file.close()
        waiting.replace(self.path)
        self._file = FileIO(self.path, "a")

    def _refuse_existing(self) -> None:
        if not self._force and self.path.exists():
            raise OutputError(
                f"{self.path} already exists; choose another name or replace it with --force."
            )

    def _unwritable(self, error: OSError) -> OutputError:
        return OutputError(f"{self.path} cannot be written: {error.strerror}.")
