"""A worker process: takes work from a pipe and answers, until the pipe closes.

Nothing here imports numpy: a process decides how many threads it may use before that.
"""

from __future__ import annotations

import signal
import sys
import traceback
from multiprocessing.connection import Connection

from magcomp.process import prepare


def serve(pipe: Connection, memory: int) -> None:
    """Answer every piece of work; end where the other side is gone.

    Parameters
    ----------
    pipe
        First sends the function, then one argument after the other.
    memory
        Bytes of data this process may hold; as many as it likes where 0.
    """
    # Ctrl-C reaches every process of a terminal; the one that started this one ends it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    prepare()
    _limit(memory)
    try:
        work = pipe.recv()
        while True:
            pipe.send(work(pipe.recv()))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return
    except Exception:
        traceback.print_exc()
        sys.exit(1)


def _limit(memory: int) -> None:
    try:
        import resource  # noqa: PLC0415 - only some systems have it
    except ImportError:
        return
    if memory:
        _, most = resource.getrlimit(resource.RLIMIT_DATA)
        wanted = memory if most == resource.RLIM_INFINITY else min(memory, most)
        resource.setrlimit(resource.RLIMIT_DATA, (wanted, most))
