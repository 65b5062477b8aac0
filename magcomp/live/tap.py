"""Where every frame of a live session goes: the newest values, the buffer and the file."""

from __future__ import annotations

import threading
from pathlib import Path

from magcomp.buffer import Buffer
from magcomp.errors import OutputError
from magcomp.link import FrameSink, Recorder
from magcomp.live.latest import Latest
from magcomp.mavlink.header import message_id, source
from magcomp.mavlink.messages import Message, decode_frame
from magcomp.mavlink.records import STAMP_SIZE
from magcomp.model import Vehicle

_LONGEST_STEP_MS = 1500
_MOST_SENDERS = 32


class Tap:
    """Takes each frame for all who want it.

    Buffer and file get exactly the same frames, so that what was received
    live and its own .tlog fit to the same numbers. A file that fails leaves the rest working.

    Parameters
    ----------
    buffer, latest
        Always there.
    recorder
        None where nothing is recorded; the tap closes it.

    Attributes
    ----------
    failure
        Why the file takes no more, a sentence; empty while it does.
    """

    def __init__(self, buffer: Buffer, latest: Latest, recorder: Recorder | None) -> None:
        self.buffer = buffer
        self.latest = latest
        self._recorder = recorder
        self._listeners: tuple[FrameSink, ...] = ()
        self._lock = threading.Lock()
        self._taking = True
        self.failure = ""
        self._size = 0
        self._attitude_ms: dict[tuple[int, int], tuple[int, int]] = {}

    @property
    def path(self) -> Path | None:
        """The file being written, or written."""
        return None if self._recorder is None else self._recorder.path

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._size

    @property
    def taking(self) -> bool:
        """Frames are still taken."""
        return self._taking

    def seconds(self, vehicle: Vehicle | None) -> float:
        """Seconds of the vehicle's clock in which its attitudes came; gaps do not count."""
        if vehicle is None:
            return 0.0
        return self._attitude_ms.get((vehicle.system, vehicle.component), (0, 0))[0] * 1e-3

    def add(self, unix_us: int, frame: bytes) -> None:
        """Take one whole frame that arrived at ``unix_us``."""
        self.latest.add(unix_us, frame)
        for listener in self._listeners:
            listener.add(unix_us, frame)
        with self._lock:
            if not self._taking:
                return
            self.buffer.add(unix_us, frame)
            self._count(frame)
            if self._recorder is not None and not self.failure:
                self._write(self._recorder, unix_us, frame)

    def listen(self, sink: FrameSink) -> None:
        """Give a sink, which must not fail, every frame from now on."""
        self._listeners = (*self._listeners, sink)

    def stop(self) -> None:
        """Take no more frames into buffer and file, and close the file."""
        with self._lock:
            self._taking = False
            if self._recorder is not None:
                try:
                    self._recorder.close()
                except OutputError as error:
                    self.failure = str(error)

    def close(self) -> None:
        """Stop for good."""
        self.stop()

    def _write(self, recorder: Recorder, unix_us: int, frame: bytes) -> None:
        try:
            recorder.add(unix_us, frame)
        except OutputError as error:
            self.failure = str(error)
            return
        self._size += len(frame) + STAMP_SIZE

    def _count(self, frame: bytes) -> None:
        if message_id(frame) != Message.ATTITUDE:
            return
        sender = source(frame)
        now_ms = int(decode_frame(frame, Message.ATTITUDE)["time_boot_ms"])
        seen_ms, last_ms = self._attitude_ms.pop(sender, (0, now_ms))
        if 0 < now_ms - last_ms < _LONGEST_STEP_MS:
            seen_ms += now_ms - last_ms
        self._attitude_ms[sender] = (seen_ms, now_ms)
        while len(self._attitude_ms) > _MOST_SENDERS:
            del self._attitude_ms[next(iter(self._attitude_ms))]
