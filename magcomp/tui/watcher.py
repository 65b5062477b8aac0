"""The thread that watches a vehicle, so that no screen ever waits for a lock of the link."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from magcomp.live.snapshot import LiveSnapshot

EVERY_S = 0.1
"""The live screens are drawn ten times a second, where drawing takes less than half of that."""


class Watcher:
    """Takes snapshots until closed, and posts each once the one before has been drawn.

    A slow terminal gets fewer of them: between two there is at least the time that drawing takes,
    so that keys are always heard.

    Parameters
    ----------
    take
        Makes a snapshot; may wait for the link's thread.
    post
        Given each snapshot; must not wait.
    failed
        Given what ``take`` raises; nothing is posted after that.
    clock
        Seconds.
    """

    def __init__(
        self,
        take: Callable[[], LiveSnapshot],
        post: Callable[[LiveSnapshot], object],
        failed: Callable[[Exception], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._take, self._post, self._failed, self._clock = take, post, failed, clock
        self._drawn = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="magcomp-screen", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Take no more; a snapshot on its way is dropped."""
        self._stop.set()
        self._drawn.set()

    def drawn(self) -> None:
        """Say that the snapshot posted last is on the screen."""
        self._drawn.set()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                snapshot = self._take()
            except Exception as error:  # whatever it is, the pilot must hear of it in words
                if not self._stop.is_set():
                    self._failed(error)
                return
            if self._stop.is_set():
                return
            self._drawn.clear()
            posted = self._clock()
            self._post(snapshot)
            self._drawn.wait()
            self._stop.wait(max(EVERY_S, self._clock() - posted))
