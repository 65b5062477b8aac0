"""The thread that watches a vehicle, so that no screen ever waits for a lock of the link."""

from __future__ import annotations

import threading
from collections.abc import Callable

from magcomp.live.snapshot import LiveSnapshot

EVERY_S = 0.1
"""The live screens are drawn ten times a second."""


class Watcher:
    """Takes snapshots until closed, and posts each.

    Parameters
    ----------
    take
        Makes a snapshot; may wait for the link's thread.
    post
        Given each snapshot; must not wait.
    failed
        Given what ``take`` raises; nothing is posted after that.
    """

    def __init__(
        self,
        take: Callable[[], LiveSnapshot],
        post: Callable[[LiveSnapshot], object],
        failed: Callable[[Exception], object],
    ) -> None:
        self._take, self._post, self._failed = take, post, failed
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="magcomp-screen", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Take no more; a snapshot on its way is dropped."""
        self._stop.set()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                snapshot = self._take()
            except Exception as error:  # whatever it is, the pilot must hear of it in words
                if not self._stop.is_set():
                    self._failed(error)
                return
            if not self._stop.is_set():
                self._post(snapshot)
            self._stop.wait(EVERY_S)
