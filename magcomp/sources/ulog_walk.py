"""Take apart the bytes of a ULog file (PX4's .ulg): its messages, one after the other.

A message is its length (16 bits), its kind (a letter) and its body. Whatever is damaged is stepped
over to where the lengths of the next messages fit together again, or to the next sync mark.
"""

from __future__ import annotations

import struct
from collections.abc import Collection
from dataclasses import dataclass, field

from magcomp.errors import LogError

MAGIC = b"ULog\x01\x12\x35"

_HEADER = 16
_SYNC = bytes([0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12])
_SYNC_MESSAGE = struct.pack("<HB", len(_SYNC), ord("S")) + _SYNC
_KINDS = frozenset(b"BFIMPQALCDRSO")
_DATA, _FLAGS = ord("D"), ord("B")
_FITTING = 4
"""Messages that must follow each other before damaged bytes are believed to have ended."""

_NEAR = 1 << 14
"""Bytes in which to look for them; beyond it only for a sync mark."""

_MOST_SEARCHES = 100
_FLAG_BITS = 40
_DATA_APPENDED = 1
_SCALARS = {
    "int8_t": "<b",
    "uint8_t": "<B",
    "bool": "<?",
    "int16_t": "<h",
    "uint16_t": "<H",
    "int32_t": "<i",
    "uint32_t": "<I",
    "int64_t": "<q",
    "uint64_t": "<Q",
    "float": "<f",
    "double": "<d",
}

Value = int | float | str


@dataclass
class Subscription:
    """An instance of a topic, and the bodies of its messages without their number."""

    name: str
    instance: int
    rows: list[bytes] = field(default_factory=list)


@dataclass
class Walked:
    """What the messages of a file say.

    Attributes
    ----------
    start
        When the log began, microseconds.
    forms
        Topic, or part of one, to the text of its fields.
    info
        Facts such as ``"ver_sw_release"``.
    initial
        Parameters at the beginning.
    changed
        Parameters that were set later: the wanted message before (empty where none was), name and
        value.
    messages
        Texts.
    subscriptions
        Of the wanted topics, in the order in which they came.
    """

    start: int
    forms: dict[str, str] = field(default_factory=dict)
    info: dict[str, Value] = field(default_factory=dict)
    initial: dict[str, float] = field(default_factory=dict)
    changed: list[tuple[bytes, str, float]] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)
    subscriptions: list[Subscription] = field(default_factory=list)


def walk(data: bytes, source: str, wanted: Collection[str]) -> Walked:
    """Read the messages of a file.

    Parameters
    ----------
    data
        The whole file.
    source
        Its name, for messages.
    wanted
        Topics whose messages to keep.

    Raises
    ------
    LogError
        The file is shorter than its header, or of a form that this cannot know.
    """
    if len(data) < _HEADER or not data.startswith(MAGIC):
        raise LogError(
            f"Log {source} must begin as a PX4 log (.ulg); instead it is {len(data)} bytes of "
            "something else: copy it again from the vehicle."
        )
    reader = _Reader(data, source, frozenset(wanted))
    reader.read()
    return reader.found


class _Reader:
    """The state of a walk over a file's messages.

    Attributes
    ----------
    by_number
        The wanted subscriptions that are open.
    last
        Body of the last wanted message.
    ends
        Where the file was continued after a crash, and where it ends.
    in_data
        Whether the definitions are over.
    searches
        Damaged places so far.
    """

    def __init__(self, data: bytes, source: str, wanted: frozenset[str]) -> None:
        self.data = data
        self.source = source
        self.wanted = wanted
        self.found = Walked(int.from_bytes(data[8:16], "little"))
        self.by_number: dict[int, Subscription] = {}
        self.last = b""
        self.ends = [len(data)]
        self.in_data = False
        self.searches = 0

    def read(self) -> None:
        data, at, limit = self.data, _HEADER, len(self.data)
        sinks = self.by_number
        while at + 3 <= len(data):
            end = at + 3 + data[at] + (data[at + 1] << 8)
            kind = data[at + 2]
            if end > limit:
                # Cut by what was appended after a crash, or at the end, or its length is damaged.
                at = max(at, limit) if limit < len(data) else self._behind_damage(at + 1)
                limit = next((each for each in self.ends if each > at), len(data))
            elif kind == _DATA and end >= at + 5:
                sink = sinks.get(data[at + 3] | data[at + 4] << 8)
                if sink is not None:
                    row = data[at + 5 : end]
                    sink.rows.append(row)
                    self.last = row
                at = end
            elif kind not in _KINDS or end == at + 3:
                at = self._behind_damage(at + 1)
            else:
                self._take(chr(kind), data[at + 3 : end])
                if kind == _FLAGS:
                    limit = self.ends[0]
                at = end

    def _behind_damage(self, at: int) -> int:
        """Where the next whole message begins; the end where there is none."""
        self.searches += 1
        if self.searches > _MOST_SEARCHES:
            return len(self.data)
        near = range(at, min(at + _NEAR, len(self.data)))
        place = next((place for place in near if self._fits(place)), -1)
        if place < 0:
            place = self.data.find(_SYNC_MESSAGE, at)
        return place if place >= 0 else len(self.data)

    def _fits(self, at: int) -> bool:
        """Whether sound messages follow one another from here on."""
        data = self.data
        for _ in range(_FITTING):
            if at == len(data):
                return True
            if at + 3 > len(data) or data[at + 2] not in _KINDS or not data[at] + data[at + 1]:
                return False
            at += 3 + data[at] + (data[at + 1] << 8)
        return at <= len(data)

    def _take(self, kind: str, body: bytes) -> None:
        """A message that is no topic's; one that says nothing sound is left out."""
        try:
            if kind == "F":
                name, _, fields = body.decode("utf-8", "replace").partition(":")
                self.found.forms[name] = fields
            elif kind == "A":
                self._subscribe(body)
            elif kind == "P":
                self._parameter(body)
            elif kind == "I":
                name, value = _named(body)
                self.found.info[name] = value
            elif kind == "L":
                self.in_data = True
                self.found.messages.append(body[9:].decode("utf-8", "replace"))
            elif kind == "B":
                self._flags(body)
        except (ValueError, struct.error):
            return

    def _subscribe(self, body: bytes) -> None:
        self.in_data = True
        instance, number = struct.unpack_from("<BH", body)
        name = body[3:].decode("utf-8", "replace")
        self.by_number.pop(number, None)
        if name in self.wanted:
            made = Subscription(name, instance)
            self.found.subscriptions.append(made)
            self.by_number[number] = made

    def _parameter(self, body: bytes) -> None:
        name, value = _named(body)
        if isinstance(value, str):
            return
        if not self.in_data:
            self.found.initial[name] = float(value)
            return
        self.found.changed.append((self.last, name, float(value)))

    def _flags(self, body: bytes) -> None:
        if len(body) < _FLAG_BITS:
            return
        unknown = bytes([body[8] & ~_DATA_APPENDED]) + body[9:16]
        if any(unknown):
            raise LogError(
                f"Log {self.source} must be a PX4 log (.ulg) of a form known here; instead it says "
                "that it cannot be read without knowing more: is it damaged, or newer than this?"
            )
        if body[8] & _DATA_APPENDED:
            offsets = struct.unpack_from("<QQQ", body, 16)
            inside = sorted({offset for offset in offsets if _HEADER < offset < len(self.data)})
            self.ends = [*inside, len(self.data)]


def _named(body: bytes) -> tuple[str, Value]:
    """A name and its value from a message of a fact or parameter."""
    length = body[0] if body else 0
    key = body[1 : 1 + length].decode("utf-8", "replace")
    kind, _, name = key.partition(" ")
    value = body[1 + length :]
    if kind.startswith("char["):
        return name, value.decode("utf-8", "replace").rstrip("\0")
    if kind not in _SCALARS:
        raise ValueError(kind)
    return name, struct.unpack_from(_SCALARS[kind], value)[0]
