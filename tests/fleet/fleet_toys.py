"""Work for worker processes, which can only be told the name of a function of a module."""

from __future__ import annotations

import os
import signal
import threading


def double(number: int) -> int:
    return 2 * number


def die_of_three(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return 2 * number


def hang_at_three(number: int) -> int:
    if number == 3:
        threading.Event().wait()
    return 2 * number


def hold(megabytes: int) -> int:
    try:
        return len(bytearray(megabytes << 20)) >> 20
    except MemoryError:
        return -1


def whose(_: int) -> int:
    return os.getpid()


def fail_of_three(number: int) -> int:
    if number == 3:
        raise ValueError("three")
    return 2 * number
