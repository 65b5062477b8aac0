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

_MOST_COLUMNS = 100
_USUAL_COLUMNS = 80


def complain(message: str) -> None:
    """Write one sentence to stderr."""
    sentence = " ".join(message.split())
    if sentence and sentence[-1] not in ".!?":
        sentence += "."
    _write(sys.stderr, f"magcomp: {sentence}\n")


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


def _write(stream: TextIO, text: str) -> None:
    # What the stream's encoding lacks (block characters, half a file name) must not end the run.
    encoding = stream.encoding or "utf-8"
    printable = text.encode(encoding, errors="replace").decode(encoding)
    try:
        stream.write(printable)
        stream.flush()
    except BrokenPipeError:
        _discard(stream)


def _discard(stream: TextIO) -> None:
    """Let the interpreter's own last flush of a stream that is broken go nowhere."""
    try:
        descriptor = stream.fileno()
    except (OSError, ValueError):
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)


def look() -> Look:
    """The terminal's width, at most 100 columns, 80 where there is none; colours where wanted."""
    size = shutil.get_terminal_size((_USUAL_COLUMNS, 24))
    return Look(columns=min(size.columns, _MOST_COLUMNS), colour=_colour_wanted())


def _colour_wanted() -> bool:
    # https://no-color.org; FORCE_COLOR is its usual counterpart.
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return sys.stdout.isatty() and os.environ.get("TERM") != "dumb"


@contextmanager
def progress() -> Iterator[Step]:
    """Show what is being done on stderr while it is done, if stderr is a terminal."""
    if not sys.stderr.isatty():
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
