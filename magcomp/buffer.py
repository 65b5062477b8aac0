"""What a live vehicle has said so far, in bounded memory, ready to be fitted each second.

The buffer keeps the frames a fit needs as they came, so that a snapshot is read by the same
code that reads a log, and gives the same numbers. Over its bound:

1. Streams faster than 20 Hz are halved, the oldest block of ten seconds first, then
   the next, and again, until none is above 20 Hz. Compasses are read at 10 Hz: what goes
   are mostly repeats.
2. After that the oldest blocks go. The vehicle's parameters and identity stay; only reports that
   repeat the value before them go. Of what it says in words the beginning stays, where the
   firmware is named.
3. Where those alone are more than a quarter of the bound, as no sound vehicle's are, the oldest go.
"""

from __future__ import annotations

import math
import threading
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from magcomp.mavlink.header import message_id, payload, source
from magcomp.mavlink.messages import WANTED, Message, decode_frame
from magcomp.mavlink.parameters import name_and_field
from magcomp.mavlink.records import STAMP_SIZE, chain, record
from magcomp.model import FloatArray, Recording
from magcomp.sources.assemble import recording_from_bytes
from magcomp.sources.vehicles import Choice

DEFAULT_LIMIT = 8 << 20
"""Bytes: a quarter of an hour of three compasses at 50 Hz whole, most of an hour thinned.

Reading a snapshot of this size takes about a tenth of a second."""

LEVELS = 10
"""Control levels of the coverage: a tenth of full throttle each."""

BANDS, SECTORS = 6, 12
"""The coverage's sphere: bands of equal height, so of equal area, and sectors."""

_BLOCK_US = 10_000_000
_FASTEST_HZ = 20.0
_KEPT_SHARE = 4
_MOST_BLOCKS = 2048
_MOST_SENDERS = 32
_MOST_TEXTS = 64
_ENTRY_SIZE = 500  # what Python needs to keep one record apart from its bytes
_PINNED = frozenset({Message.PARAM_VALUE, Message.AUTOPILOT_VERSION, Message.STATUSTEXT})
_TYPICAL_DIP = math.radians(60.0)


@dataclass(frozen=True, eq=False)
class Coverage:
    """Which directions the earth's field has had in body axes, by throttle.

    Attributes
    ----------
    counts
        Attitudes in each cell, shape (LEVELS, BANDS · SECTORS).
    """

    counts: NDArray[np.int64]

    @property
    def fraction(self) -> FloatArray:
        """Share of the sphere's cells seen at each level, 0 … 1, shape (LEVELS,)."""
        return np.asarray((self.counts > 0).mean(axis=1), dtype=np.float64)

    @property
    def share(self) -> FloatArray:
        """Share of the time at each level, shape (LEVELS,); zeros before the first attitude."""
        total = max(int(self.counts.sum()), 1)
        return np.asarray(self.counts.sum(axis=1) / total, dtype=np.float64)


@dataclass
class _Block:
    """Consecutive records of about ten seconds, or a little part of the bound."""

    begin_us: int
    end_us: int
    records: bytearray = field(default_factory=bytearray)
    thinned: int = 0
    at_floor: bool = False


_Key = tuple[tuple[int, int, int], bytes]


class _Kept(NamedTuple):
    """A record that outlives its block: of which parameter, what value, and all of it."""

    key: _Key
    value: bytes
    record: bytes

    @property
    def size(self) -> int:
        """Bytes of memory it takes, about."""
        return _ENTRY_SIZE + len(self.key[1]) + len(self.value) + len(self.record)


class Buffer:
    """The recording so far of a live link. One thread may add while another takes snapshots.

    Parameters
    ----------
    source
        Address of the link, for people.
    limit
        Bytes to keep at most; for parameters and identity a quarter of it more.
    dip_rad
        Dip of the field whose directions the coverage counts. Its exact value does not
        matter: it only says where on the sphere a level turn lies.
    """

    def __init__(
        self, source: str, *, limit: int = DEFAULT_LIMIT, dip_rad: float = _TYPICAL_DIP
    ) -> None:
        self._source = source
        self._limit = limit
        self._size = 0
        self._blocks: list[_Block] = []
        self._kept: deque[_Kept] = deque()
        self._kept_size = 0
        self._kept_last: dict[_Key, _Kept] = {}
        self._texts = 0
        self._lock = threading.Lock()
        self._field = (math.cos(dip_rad), math.sin(dip_rad))
        self._levels: dict[tuple[int, int], int] = {}
        self._counts: dict[tuple[int, int], NDArray[np.int64]] = {}

    @property
    def size(self) -> int:
        """Bytes held."""
        with self._lock:
            return self._size + self._kept_size

    def add(self, unix_us: int, frame: bytes) -> None:
        """Take one whole frame that arrived at ``unix_us``; what no fit needs is passed over."""
        message = message_id(frame)
        if message not in WANTED:
            return
        with self._lock:
            block = self._block(unix_us)
            block.end_us = unix_us
            block.records += record(unix_us, frame)
            self._size += STAMP_SIZE + len(frame)
            self._cover(message, frame)
            while self._size > self._limit and self._shrink():
                pass

    def data(self) -> bytes:
        """Give everything held, in the form of a .tlog."""
        with self._lock:
            kept = (entry.record for entry in self._kept)
            return b"".join([*kept, *(block.records for block in self._blocks)])

    def snapshot(self, system: int | None = None, component: int | None = None) -> Recording:
        """Give the recording so far, read as a log of the same frames would be.

        Parameters
        ----------
        system, component
            The vehicle's MAVLink system; None where there is only one. Its autopilot's component;
            None for the usual one.

        Raises
        ------
        LogError
            No vehicle has been heard yet.
        ChooseVehicleError
            There are several vehicles and none was chosen.
        """
        return recording_from_bytes(self.data(), self._source, Choice(system, component), live=True)

    def coverage(self, system: int | None = None, component: int | None = None) -> Coverage:
        """Give the attitudes seen so far; counted as they came, so thinning changes nothing.

        Parameters
        ----------
        system, component
            Whose; None for everybody's.
        """
        with self._lock:
            counts = np.zeros((LEVELS, BANDS * SECTORS), dtype=np.int64)
            for sender, seen in self._counts.items():
                if system in (None, sender[0]) and component in (None, sender[1]):
                    counts += seen
        counts.setflags(write=False)
        return Coverage(counts)

    # ---------------------------------------------------------------- coverage

    def _cover(self, message: int, frame: bytes) -> None:
        sender = source(frame)
        if message == Message.VFR_HUD:
            throttle = int(decode_frame(frame, message)["throttle"]) * 0.01
            self._levels[sender] = min(int(throttle * LEVELS), LEVELS - 1)
            while len(self._levels) > _MOST_SENDERS:
                del self._levels[next(iter(self._levels))]
        elif message == Message.ATTITUDE:
            _, roll, pitch, yaw = decode_frame(frame, message).tolist()[:4]
            if math.isfinite(roll + pitch + yaw):
                cell = sphere_cell(*self._field_direction(roll, pitch, yaw))
                self._counts_of(sender)[self._levels.get(sender, 0), cell] += 1

    def _counts_of(self, sender: tuple[int, int]) -> NDArray[np.int64]:
        counts = self._counts.get(sender)
        if counts is None:
            counts = self._counts[sender] = np.zeros((LEVELS, BANDS * SECTORS), dtype=np.int64)
            while len(self._counts) > _MOST_SENDERS:
                # The one of whom least was seen: nobody can crowd out a vehicle by many names.
                del self._counts[min(self._counts, key=lambda each: int(self._counts[each].sum()))]
        return counts

    def _field_direction(self, roll: float, pitch: float, yaw: float) -> tuple[float, float, float]:
        """Unit vector of a northward, dipping field in body axes."""
        north, down = self._field
        ahead, right = north * math.cos(yaw), -north * math.sin(yaw)
        x = ahead * math.cos(pitch) - down * math.sin(pitch)
        below = ahead * math.sin(pitch) + down * math.cos(pitch)
        y = right * math.cos(roll) + below * math.sin(roll)
        z = below * math.cos(roll) - right * math.sin(roll)
        return x, y, z

    # ---------------------------------------------------------------- the bound

    def _block(self, unix_us: int) -> _Block:
        last = self._blocks[-1] if self._blocks else None
        # A clock set back must not make a block that never ends, nor one that jumps many blocks.
        if last is None or (
            not 0 <= unix_us - last.begin_us < _BLOCK_US
            and len(last.records) * _MOST_BLOCKS >= self._limit
        ):
            last = _Block(unix_us, unix_us)
            self._blocks.append(last)
        return last

    def _shrink(self) -> bool:
        """Thin or drop the oldest block; False where only the one being filled is left."""
        finished = self._blocks[:-1]
        if not finished:
            return False
        thinnable = [block for block in finished if not block.at_floor]
        if thinnable:
            self._thin(min(thinnable, key=lambda block: block.thinned))
        else:
            self._drop(self._blocks.pop(0))
        return True

    def _thin(self, block: _Block) -> None:
        seconds = max((block.end_us - block.begin_us) * 1e-6, 1.0)
        counts = Counter(_stream(frame) for _, frame in chain(block.records))
        fast = {stream for stream, count in counts.items() if count > _FASTEST_HZ * seconds}
        fast = {stream for stream in fast if stream[2] not in _PINNED}
        if not fast:
            block.at_floor = True
            return
        turn: Counter[tuple[int, int, int]] = Counter()
        kept = bytearray()
        for whole, frame in chain(block.records):
            stream = _stream(frame)
            turn[stream] += 1
            if stream not in fast or turn[stream] % 2:
                kept += whole
        self._size -= len(block.records) - len(kept)
        block.records = kept
        block.thinned += 1

    def _drop(self, block: _Block) -> None:
        self._size -= len(block.records)
        for whole, frame in chain(block.records):
            stream = _stream(frame)
            if stream[2] not in _PINNED:
                continue
            if stream[2] == Message.STATUSTEXT:
                self._texts += 1
                if self._texts > _MOST_TEXTS:
                    continue
            content, value = payload(frame), b""
            if stream[2] == Message.PARAM_VALUE:
                content, value = name_and_field(content)
            self._keep(_Kept((stream, content), value, whole))

    def _keep(self, entry: _Kept) -> None:
        last = self._kept_last.get(entry.key)
        if last is not None and last.value == entry.value:
            return
        self._kept.append(entry)
        self._kept_last[entry.key] = entry
        self._kept_size += entry.size
        while self._kept_size > self._limit // _KEPT_SHARE:
            oldest = self._kept.popleft()
            self._kept_size -= oldest.size
            if self._kept_last[oldest.key] is oldest:
                del self._kept_last[oldest.key]


def sphere_cell(x: float, y: float, z: float) -> int:
    """Cell of a unit vector: 0 is at the top (z = −1, up in body axes), sectors from x to y."""
    band = min(int((z + 1.0) * 0.5 * BANDS), BANDS - 1)
    sector = min(int((math.atan2(y, x) / math.tau % 1.0) * SECTORS), SECTORS - 1)
    return max(band, 0) * SECTORS + sector


def _stream(frame: bytes) -> tuple[int, int, int]:
    """System, component and message of a frame."""
    return (*source(frame), message_id(frame))
