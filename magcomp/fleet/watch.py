"""A folder where logs arrive: which are whole and new each time it is looked at."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from magcomp.fleet.row import Log
from magcomp.fleet.run import key


def arrivals(look: Callable[[], Sequence[Log]], pause: Callable[[], None]) -> Iterator[list[Log]]:
    """Every log that stood still between two looks, each state of a log once.

    Parameters
    ----------
    look
        Gives the logs that are there.
    pause
        Waits between two looks.

    Yields
    ------
    list of Log
        What is whole now and was not before; may be empty.
    """
    seen: set[tuple[str, int, str]] = set()
    given: set[tuple[str, int, str]] = set()
    while True:
        logs = look()
        # What is still being written has another size or time at the next look.
        whole = [log for log in logs if key(log) in seen and key(log) not in given]
        seen = {key(log) for log in logs}
        given = (given & seen) | {key(log) for log in whole}
        yield whole
        pause()
