"""The topics, parameters and facts of a PX4 log (.ulg), whatever is wrong with the file."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from magcomp.model import FloatArray, as_floats
from magcomp.sources.ulog_walk import Subscription, Walked, walk

Columns = Mapping[str, NDArray[Any]]

MICROSECOND = 1e-6

_LONGEST_MESSAGE = 1 << 16
"""A message's length is told in 16 bits, so no topic is longer."""

_FIELD = re.compile(r"([\w/-]+?)(?:\[(\d{1,5})\])? (\w+)")
_TYPES = {
    "int8_t": "i1",
    "uint8_t": "u1",
    "bool": "i1",
    "char": "i1",
    "int16_t": "<i2",
    "uint16_t": "<u2",
    "int32_t": "<i4",
    "uint32_t": "<u4",
    "int64_t": "<i8",
    "uint64_t": "<u8",
    "float": "<f4",
    "double": "<f8",
}
_STAMP_BYTES = 8
_DEEPEST = 8
"""Formats inside one another."""

_DAY_US = 86_400_000_000
_BEFORE_US = 1_000_000
"""Rows from further before the log say how it was, not when."""


@dataclass(frozen=True, eq=False)
class Topic:
    """One instance of a topic.

    Attributes
    ----------
    columns
        Field name, such as ``"q[0]"``, to its values, shape (n,) each.
    """

    columns: Columns

    def __len__(self) -> int:
        return len(self.columns["timestamp"])

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def number(self, name: str) -> FloatArray:
        """A field as float64, shape (n,)."""
        return as_floats(self.columns[name])

    def vector(self, name: str, size: int) -> FloatArray:
        """The first fields of an array side by side, shape (n, size)."""
        return np.stack([self.number(f"{name}[{index}]") for index in range(size)], axis=1)

    def said(self, zero: int) -> FloatArray:
        """When each row was said, seconds since ``zero`` microseconds, shape (n,)."""
        return (self.number("timestamp") - zero) * MICROSECOND

    def measured(self, zero: int) -> FloatArray:
        """When each row was measured, or else said, seconds since ``zero``, shape (n,)."""
        said = self.number("timestamp")
        if "timestamp_sample" not in self.columns:
            return (said - zero) * MICROSECOND
        measured = self.number("timestamp_sample")
        # What is not set is 0, and a reading does not wait for long.
        believed = np.abs(said - measured) < _DAY_US
        return (np.where(believed, measured, said) - zero) * MICROSECOND


@dataclass(frozen=True, eq=False)
class UlogFile:
    """What a log holds.

    Attributes
    ----------
    topics
        By name and instance; those that were asked for and came.
    info
        Facts such as ``"ver_sw_release"``.
    initial
        Parameters at the beginning.
    changed
        Time in microseconds, name and value of each parameter that was set later.
    messages
        Texts of the log, oldest first.
    start
        When the log began, microseconds.
    """

    topics: Mapping[tuple[str, int], Topic]
    info: Mapping[str, Any]
    initial: Mapping[str, float]
    changed: tuple[tuple[int, str, float], ...]
    messages: tuple[str, ...]
    start: int

    def number(self, name: str) -> int:
        """A fact that is a whole number; 0 where it is not told, or is none."""
        value = self.info.get(name, 0)
        return value if isinstance(value, int) and value >= 0 else 0

    def topic(self, name: str, *fields: str, instance: int = 0) -> Topic | None:
        """A topic's instance, if it came with these fields."""
        found = self.topics.get((name, instance))
        if found is None or not all(each in found for each in fields):
            return None
        return found

    def instances(self, name: str, *fields: str) -> dict[int, Topic]:
        """Every instance of a topic that came with these fields, in order."""
        return {
            instance: topic
            for (each, instance), topic in sorted(self.topics.items(), key=lambda item: item[0])
            if each == name and all(wanted in topic for wanted in fields)
        }


def read_ulog_file(data: bytes, source: str, wanted: Collection[str]) -> UlogFile:
    """Take apart a log.

    Parameters
    ----------
    data
        The whole file.
    source
        Its name, for messages.
    wanted
        Names of the topics to read.

    Raises
    ------
    LogError
        It is of a form that this cannot know.
    """
    log = walk(data, source, wanted)
    parts = _parts(log)
    start = _start(log, parts)
    return UlogFile(
        topics=_topics(parts, start),
        info=log.info,
        initial=log.initial,
        changed=tuple((_stamp(row, start), name, value) for row, name, value in log.changed),
        messages=tuple(log.messages),
        start=start,
    )


def _stamp(row: bytes, start: int) -> int:
    """Microseconds at which a message was said: its first field, in every topic."""
    said = int.from_bytes(row[:_STAMP_BYTES], "little")
    return said if len(row) >= _STAMP_BYTES and abs(said - start) < _DAY_US else start


class _Layout(NamedTuple):
    """How a topic's rows are laid out, and their length with the padding at their end, bytes."""

    kind: np.dtype[Any]
    padded: int


def _layout(name: str, forms: Mapping[str, str]) -> _Layout | None:
    """None where the format is none, too long for a message, or says nothing of the time."""
    fields = _flat(name, "", forms, ())
    padded = sum(np.dtype(kind).itemsize for _, kind in fields)
    if padded > _LONGEST_MESSAGE:
        return None
    # The firmware leaves out padding at the end of a format.
    while fields and fields[-1][0].startswith("_padding"):
        fields.pop()
    names = [called for called, _ in fields]
    if "timestamp" not in names or len(set(names)) < len(names):
        return None
    return _Layout(np.dtype(fields), padded)


def _table(subscription: Subscription, layout: _Layout) -> NDArray[Any] | None:
    """The rows of a subscription; None where none is whole."""
    size = layout.kind.itemsize
    rows = [row[:size] for row in subscription.rows if size <= len(row) <= layout.padded]
    return np.frombuffer(b"".join(rows), dtype=layout.kind) if rows else None


def _flat(
    name: str, before: str, forms: Mapping[str, str], above: tuple[str, ...]
) -> list[tuple[str, str]]:
    """Names and numpy types of a format's fields, those of the formats inside it in their places.

    Empty where the format is not known, or longer than a message can be.
    """
    found: list[tuple[str, str]] = []
    if name in above or len(above) > _DEEPEST:
        return []
    for text in filter(None, forms.get(name, "").split(";")):
        parts = _FIELD.fullmatch(text)
        if parts is None:
            return []
        kind, count, called = parts.groups()
        for index in range(1 if count is None else int(count)):
            whole = before + (called if count is None else f"{called}[{index}]")
            if kind in _TYPES:
                found.append((whole, _TYPES[kind]))
            else:
                inner = _flat(kind, f"{whole}.", forms, (*above, name))
                if not inner:
                    return []
                found.extend(inner)
            if len(found) > _LONGEST_MESSAGE:
                return []
    return found


def _parts(log: Walked) -> dict[tuple[str, int], list[NDArray[Any]]]:
    """What came of each topic; what was appended after a crash comes apart from the rest."""
    parts: dict[tuple[str, int], list[NDArray[Any]]] = {}
    names = {subscription.name for subscription in log.subscriptions}
    layouts = {name: _layout(name, log.forms) for name in names}
    for subscription in log.subscriptions:
        layout = layouts[subscription.name]
        table = None if layout is None else _table(subscription, layout)
        if table is not None:
            parts.setdefault((subscription.name, subscription.instance), []).append(table)
    return parts


def _start(log: Walked, parts: Mapping[tuple[str, int], list[NDArray[Any]]]) -> int:
    """When the log began, as it says; the earliest row where that cannot be.

    A topic that seldom changes comes first with the last message from before the log.
    """
    stamps = [each["timestamp"] for tables in parts.values() for each in tables]
    if not stamps:
        return log.start
    every = np.concatenate([stamp.astype(np.float64) for stamp in stamps])
    every = every[np.isfinite(every)]
    if not len(every):
        return 0
    # One of them, so that there is a row near it even where half are years from the others.
    middle = float(np.sort(every)[len(every) // 2])
    said = float(log.start)
    # None is said where it was never set.
    if max(middle - _DAY_US, 0.0) < said <= middle:
        return int(said)
    return int(every[np.abs(every - middle) < _DAY_US].min())


def _topics(
    parts: Mapping[tuple[str, int], list[NDArray[Any]]], start: int
) -> dict[tuple[str, int], Topic]:
    """Rows in order of time, without those before the log and of another day."""
    found = {}
    for key, tables in parts.items():
        alike = [each for each in tables if each.dtype == tables[0].dtype]
        table = alike[0] if len(alike) == 1 else np.concatenate(alike)
        since = as_floats(table["timestamp"]) - start
        rows = np.flatnonzero((since > -_BEFORE_US) & (since < _DAY_US))
        rows = rows[np.argsort(since[rows], kind="stable")]
        if len(rows):
            chosen = table if len(rows) == len(table) and _in_order(since) else table[rows]
            found[key] = Topic({name: chosen[name] for name in chosen.dtype.names or ()})
    return found


def _in_order(time: FloatArray) -> bool:
    return bool((np.diff(time) >= 0.0).all())
