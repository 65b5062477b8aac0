"""Who gets every frame as it arrives."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from magcomp.errors import InputError
from magcomp.link.events import SinkFailed


class FrameSink(Protocol):
    """Takes every frame as it arrives: a Recorder, a Buffer."""

    def add(self, unix_us: int, frame: bytes) -> None:
        """Take one whole frame that arrived at ``unix_us``.

        Raises
        ------
        InputError
            It can take no more, as a recorder whose disk is full.
        """
        ...


class Sinks:
    """Hands frames on. A sink that fails gets no more; the others and the link go on."""

    def __init__(self, sinks: Iterable[FrameSink]) -> None:
        self._sinks = list(sinks)

    def add(self, unix_us: int, frame: bytes, now: float) -> list[SinkFailed]:
        """Hand one frame to all; gives those that failed by it."""
        failed = []
        for sink in tuple(self._sinks):
            try:
                sink.add(unix_us, frame)
            except InputError as error:
                self._sinks.remove(sink)
                failed.append(SinkFailed(now, error))
        return failed
