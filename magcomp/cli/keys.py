"""Whether any key was pressed, on a terminal, without waiting for Enter."""

from __future__ import annotations

import contextlib
import os
import select
import sys
from collections.abc import Callable, Iterator

from magcomp.errors import UsageError

Pressed = Callable[[], bool]
"""Tells whether a key was pressed since the beginning."""


def require_terminal(what: str) -> None:
    """Refuse where nobody could press a key.

    Raises
    ------
    UsageError
        The standard input is no terminal.
    """
    if sys.stdin is None or not sys.stdin.isatty():
        raise UsageError(f"{what} must be run at a terminal, where any key can stop it")


@contextlib.contextmanager
def any_key() -> Iterator[Pressed]:
    """Let keys arrive one by one while the block runs; Ctrl-C stays what it is."""
    yield_from = _windows if sys.platform == "win32" else _posix
    with yield_from() as pressed:
        yield pressed


@contextlib.contextmanager
def _posix() -> Iterator[Pressed]:
    # Only Unix has these modules.
    import termios  # noqa: PLC0415
    import tty  # noqa: PLC0415

    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)

    def pressed() -> bool:
        # A terminal that is gone reads as its end, and counts as a key too.
        return bool(select.select([descriptor], [], [], 0.0)[0])

    try:
        tty.setcbreak(descriptor)
        termios.tcflush(descriptor, termios.TCIFLUSH)
        yield pressed
    finally:
        with contextlib.suppress(termios.error, OSError):
            while pressed() and os.read(descriptor, 1024):
                pass
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


@contextlib.contextmanager
def _windows() -> Iterator[Pressed]:
    # Only Windows has this module.
    import msvcrt  # noqa: PLC0415

    keyboard = vars(msvcrt)
    while keyboard["kbhit"]():
        keyboard["getwch"]()
    yield lambda: bool(keyboard["kbhit"]())
