"""stdout is data; stderr is diagnostics, and progress where it is a terminal."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from magcomp.errors import OutputError
from magcomp.report.look import Look

Step = Callable[[str, float], None]
"""What is being done, and the share done, 0 … 1."""

_LEAST_COLUMNS, _MOST_COLUMNS = 80, 100


_COMMAND = "\n  magcomp "


def complain(message: str) -> None:
    """Write one sentence to stderr, and the command it ends with on a line of its own."""
    said, _, command = message.partition(_COMMAND)
    sentence = _printable(said)
    if sentence and sentence[-1] not in ".!?:":
        sentence += "."
    line = f"{_COMMAND}{_printable(command)}" if command else ""
    _write(sys.stderr, f"magcomp: {sentence}{line}\n")


def _printable(text: str) -> str:
    # A name in a message may hold anything, also what a terminal would obey.
    return "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))


def answer(text: str) -> None:
    """Write data to stdout, all of it, now.

    A reader that has gone, as ``| head`` does, is no error.

    Raises
    ------
    OutputError
        Where stdout cannot take it, for example a full disk.
    """
    try:
        _write(sys.stdout, text)
    except OSError as error:
        _discard(sys.stdout)
        raise OutputError(f"stdout must be writable; instead received: {error.strerror}") from error


def _write(stream: TextIO | None, text: str) -> None:
    if stream is None:  # a parent closed it: there is nobody to tell
        return
    # What the stream's encoding lacks (block characters, half a file name) must not end the run.
    encoding = stream.encoding or "utf-8"
    printable = text.encode(encoding, errors="replace").decode(encoding)
    try:
        stream.write(printable)
        stream.flush()
    except BrokenPipeError:
        _discard(stream)


def flush() -> None:
    """Flush both streams, so that the interpreter's own last flush has nothing to complain of."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except OSError:
            _discard(stream)


def _discard(stream: TextIO | None) -> None:
    if stream is None:
        return
    try:
        descriptor = stream.fileno()
    except (OSError, ValueError):
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)


def look() -> Look:
    """The terminal's width, from 80 to 100 columns; colours where wanted."""
    size = shutil.get_terminal_size((_LEAST_COLUMNS, 24))
    width = min(max(size.columns, _LEAST_COLUMNS), _MOST_COLUMNS)
    return Look(columns=width, colour=_colour_wanted())


def _colour_wanted() -> bool:
    # https://no-color.org; FORCE_COLOR is its usual counterpart.
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return sys.stdout is not None and sys.stdout.isatty() and os.environ.get("TERM") != "dumb"


@contextmanager
def progress() -> Iterator[Step]:
    """Show what is being done on stderr while it is done, if stderr is a terminal."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda _what, _share: None
        return
    # Rich takes a tenth of a second to import, which only a terminal is worth.
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn  # noqa: PLC0415

    parts = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.percentage:>3.0f} %"),
    )
    with Progress(*parts, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)
