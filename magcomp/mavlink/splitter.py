"""Cut a stream of bytes into MAVLink frames without looking inside them."""

from __future__ import annotations

from magcomp.mavlink.header import frame_length, next_marker


class Splitter:
    """Collects bytes and gives whole frames; what is not a frame is dropped."""

    def __init__(self) -> None:
        self._pending = bytearray()

    def push(self, data: bytes) -> list[bytes]:
        """Frames that ``data`` completes, oldest first; checksums are not looked at."""
        self._pending += data
        frames = []
        start = next_marker(self._pending, 0)
        while (length := frame_length(self._pending, start)) is not None:
            if not length:
                start = next_marker(self._pending, start + 1)
                continue
            if start + length > len(self._pending):
                break
            frames.append(bytes(self._pending[start : start + length]))
            start = next_marker(self._pending, start + length)
        del self._pending[:start]
        return frames
