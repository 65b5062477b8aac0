"""stdout is data; stderr is diagnostics, and progress where it is a terminal."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from textwrap import wrap
from typing import TextIO

from magcomp.errors import OutputError
from magcomp.report.ascii import encodable, in_words, is_ascii_only
from magcomp.report.look import Look

Step = Callable[[str, float], None]
"""What is being done, and the share done, 0 … 1."""

_LEAST_COLUMNS, _USUAL_COLUMNS, _MOST_COLUMNS = 60, 80, 100
_GROWTH = 6
"""Columns that a line of ASCII may grow by: degrees become a word."""

_ALONE = "\n  "


def complain(message: str) -> None:
    """Write one sentence to stderr, and the command or path it ends with on a line of its own.

    Such a line can be pasted as it is: it begins with two blanks, and no full stop follows.
    """
    said, _, alone = message.partition(_ALONE)
    sentence = _printable(said)
    if sentence and sentence[-1] not in ".!?:":
        sentence += "."
    line = f"{_ALONE}{_printable(alone)}" if alone else ""
    whole = f"{_laid_out(f'magcomp: {sentence}')}{line}\n"
    _write(sys.stderr, in_words(whole) if takes_ascii_only(sys.stderr) else whole)


def _laid_out(sentence: str) -> str:
    """On a terminal no word goes on in the next line; elsewhere a sentence is one line."""
    if sys.stderr is None or not sys.stderr.isatty():
        return sentence
    columns = shutil.get_terminal_size((_USUAL_COLUMNS, 24)).columns
    lines = wrap(sentence, max(columns, 20), break_long_words=False, break_on_hyphens=False)
    return "\n".join(lines)


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


def answer_words(text: str) -> None:
    """Write a text for people, in ASCII where that is all there is; otherwise as `answer`."""
    answer(in_words(text) if takes_ascii_only(sys.stdout) else text)


def wrapped(text: str, columns: int) -> list[str]:
    """Lines of a sentence, all but the first indented."""
    return wrap(text, columns - 1, initial_indent=" ", subsequent_indent="   ")


def _write(stream: TextIO | None, text: str) -> None:
    if stream is None:  # a parent closed it: there is nobody to tell
        return
    # What the stream's encoding lacks (block characters, half a file name) must not end the run.
    try:
        stream.write(encodable(text, stream.encoding or "utf-8"))
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
    """The terminal's width, from 60 to 100 columns; colours where wanted; ASCII where needed."""
    size = shutil.get_terminal_size((_USUAL_COLUMNS, 24))
    width = min(max(size.columns, _LEAST_COLUMNS), _MOST_COLUMNS)
    plain = takes_ascii_only(sys.stdout)
    return Look(width - _GROWTH if plain else width, _colour_wanted(), ascii_only=plain)


def takes_ascii_only(stream: TextIO | None) -> bool:
    """Whether what reads a stream takes nothing but ASCII."""
    return is_ascii_only(stream.encoding if stream else None, os.environ)


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
        SpinnerColumn("line" if takes_ascii_only(sys.stderr) else "dots"),
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.percentage:>3.0f} %"),
    )
    with Progress(*parts, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)
