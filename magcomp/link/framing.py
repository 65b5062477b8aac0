"""Bytes to MAVLink frames and back. No input or output happens here.

Rules
-----
1. A frame counts only when its checksum is right. Where it is not, the search goes on
   one byte later, so a false marker never swallows a good frame.
2. A frame of a message that the dialect does not have cannot be checked. It is taken
   only in MAVLink 2, where another frame, or nothing, follows it directly, and
   where no sound frame begins inside it.
3. With a signing key, what is not signed with it is refused and counted.
4. A frame that does not complete within a second was a false marker.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.link.signing import SignatureCheck, signing_timestamp
from magcomp.link.transport import Peer
from magcomp.mavlink.header import (
    frame_length,
    is_marker,
    is_signed,
    is_version_1,
    next_marker,
    sequence,
    source,
)

Message = Any
"""A pymavlink message object of the dialect ardupilotmega, MAVLink 2."""

GROUND_STATION_SYSTEM = 255
GROUND_STATION_COMPONENT = 190  # MAV_COMP_ID_MISSIONPLANNER, as ground stations announce themselves

_PATIENCE_S = 1.0
_MOST_PEERS = 32


@dataclass(frozen=True)
class Frame:
    """One whole frame as it arrived, and its meaning."""

    raw: bytes
    message: Message

    @property
    def source(self) -> tuple[int, int]:
        """System and component that sent it."""
        return source(self.raw)

    @property
    def sequence(self) -> int:
        """The sender's running number, modulo 256."""
        return sequence(self.raw)


@dataclass
class FrameCounts:
    """What the bytes so far were made of.

    Attributes
    ----------
    received
        Bytes received.
    frames, signed
        Frames taken, and how many of them carried a signature.
    refused
        Sound frames without the key's signature.
    skipped
        Bytes that belong to no frame.
    """

    received: int = 0
    frames: int = 0
    signed: int = 0
    refused: int = 0
    skipped: int = 0


@dataclass
class _Half:
    """Bytes of a frame that is not complete, and since when."""

    pending: bytearray = field(default_factory=bytearray)
    since: float = 0.0


class Framer:
    """Both directions of one link.

    Parameters
    ----------
    key
        Signing key of 32 bytes; None leaves signatures unread and signs nothing.
    unix_us
        Calendar time, where the signature's time starts.
    system
        The ground station's own number.
    """

    def __init__(
        self, key: bytes | None = None, unix_us: int = 0, system: int = GROUND_STATION_SYSTEM
    ) -> None:
        self.counts = FrameCounts()
        self._check = None if key is None else SignatureCheck(key, unix_us)
        self._codec = mavlink.MAVLink(None, system, GROUND_STATION_COMPONENT)
        self._halves: dict[Peer, _Half] = {}
        self._half = _Half()
        if key is not None:
            # Only for sending: the codec without a key decodes what the check has yet to judge.
            self._signer = mavlink.MAVLink(None, system, GROUND_STATION_COMPONENT)
            self._signer.signing.secret_key = key
            self._signer.signing.sign_outgoing = True
        else:
            self._signer = self._codec

    def reset(self) -> None:
        """Forget halves of frames, because the bytes that come next are from another connection."""
        self.counts.skipped += sum(len(half.pending) for half in self._halves.values())
        self._halves.clear()

    def receive(self, data: bytes, now: float, peer: Peer = None) -> list[Frame]:
        """Find the frames that ``data`` of a peer completes."""
        self.counts.received += len(data)
        half = self._half = self._half_of(peer)
        overdue = bool(half.pending) and now - half.since > _PATIENCE_S
        before = len(half.pending)
        half.pending += data
        frames, position = self._scan(1 if overdue else 0)
        if overdue:
            self.counts.skipped += 1
        del half.pending[:position]
        if position > 0 or before == 0:
            half.since = now
        return frames

    def _half_of(self, peer: Peer) -> _Half:
        """A peer's unfinished frame: what two send at once must not run together."""
        half = self._halves.pop(peer, None) or _Half()
        self._halves[peer] = half
        while len(self._halves) > _MOST_PEERS:
            dropped = self._halves.pop(next(iter(self._halves)))
            self.counts.skipped += len(dropped.pending)
        return half

    def pack(self, message: Message, unix_us: int) -> bytes:
        """Put a message into a frame of the ground station, signed where there is a key."""
        if self._check is not None:
            signing = self._signer.signing
            signing.timestamp = max(
                signing.timestamp, self._check.newest, signing_timestamp(unix_us)
            )
        raw: bytes = message.pack(self._signer)
        self._signer.seq = (self._signer.seq + 1) % 256
        return raw

    def _scan(self, position: int) -> tuple[list[Frame], int]:
        """Frames found from ``position`` on, and where the first unfinished one starts."""
        pending = self._half.pending
        frames: list[Frame] = []
        while True:
            start = next_marker(pending, position)
            self.counts.skipped += start - position
            length = frame_length(pending, start)
            if length is None or start + length > len(pending):
                return frames, start
            frame = self._decode(start, length) if length else None
            if frame is None:
                self.counts.skipped += 1
                position = start + 1
                continue
            position = start + length
            if self._admit(frame):
                frames.append(frame)

    def _decode(self, start: int, length: int) -> Frame | None:
        raw = self._half.pending[start : start + length]
        try:
            message = self._codec.decode(raw)
        except mavlink.MAVError:
            return None
        if isinstance(message, mavlink.MAVLink_unknown) and not self._plausible(start, length):
            return None
        return Frame(bytes(raw), message)

    def _plausible(self, start: int, length: int) -> bool:
        """Tell whether what cannot be checked stands where a frame should."""
        pending, end = self._half.pending, start + length
        if is_version_1(pending[start:end]) or (end < len(pending) and not is_marker(pending[end])):
            return False
        inner = next_marker(pending, start + 1)
        while inner < end:
            if self._is_sound(inner):
                return False
            inner = next_marker(pending, inner + 1)
        return True

    def _is_sound(self, start: int) -> bool:
        length = frame_length(self._half.pending, start)
        if not length or start + length > len(self._half.pending):
            return False
        try:
            message = self._codec.decode(self._half.pending[start : start + length])
        except mavlink.MAVError:
            return False
        return not isinstance(message, mavlink.MAVLink_unknown)

    def _admit(self, frame: Frame) -> bool:
        if self._check is not None and not self._check.accepts(frame.raw):
            self.counts.refused += 1
            return False
        self.counts.frames += 1
        self.counts.signed += is_signed(frame.raw)
        return True
