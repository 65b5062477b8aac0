"""Cut a stream of bytes into MAVLink frames without looking inside them."""

from __future__ import annotations

_VERSION_1, _VERSION_2 = 0xFE, 0xFD
_SIGNED = 0x01


class Splitter:
    """Collects bytes and gives whole frames; what is not a frame is dropped."""

    def __init__(self) -> None:
        self._pending = bytearray()

    def push(self, data: bytes) -> list[bytes]:
        """Frames that ``data`` completes, oldest first; checksums are not looked at."""
        self._pending += data
        frames = []
        while (length := self._next_length()) is not None:
            frames.append(bytes(self._pending[:length]))
            del self._pending[:length]
        return frames

    def _next_length(self) -> int | None:
        """Length of the frame at the head, once all of it is there."""
        while self._pending and self._pending[0] not in (_VERSION_1, _VERSION_2):
            del self._pending[0]
        if len(self._pending) < 3:
            return None
        if self._pending[0] == _VERSION_1:
            length = self._pending[1] + 8
        else:
            length = self._pending[1] + 12 + (13 if self._pending[2] & _SIGNED else 0)
        return length if length <= len(self._pending) else None


def message_id(frame: bytes) -> int:
    """The message's number, from a whole frame."""
    if frame[0] == _VERSION_1:
        return frame[5]
    return int.from_bytes(frame[7:10], "little")
