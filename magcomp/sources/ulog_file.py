"""The topics, parameters and facts of a PX4 log (.ulg), whatever is wrong with the file.

pyulog takes the file apart. It prints what it finds wrong, raises whatever happens to it, believes
any length that a format claims, and looks at damaged bytes one by one; all of that ends here.
"""

from __future__ import annotations

import io
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyulog import ULog, core

from magcomp.errors import LogError
from magcomp.model import FloatArray

Columns = Mapping[str, NDArray[Any]]

MICROSECOND = 1e-6

_LONGEST_MESSAGE = 1 << 16
"""A message's length is told in 16 bits, so no topic is longer."""

_READS_PER_BYTE = 0.5
_READS_ALWAYS = 10_000
"""A sound file takes two reads for each message of at least 10 bytes."""

_DAY_US = 86_400_000_000
_BEFORE_US = 1_000_000
"""Rows from further before the log say how it was, not when."""


def _say_nothing(*_: object, **__: object) -> None:
    """Stand for print inside pyulog: a log's damage is told by what is read of it."""


core.print = _say_nothing


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
        # A signalling NaN becomes a quiet one, and no warning.
        with np.errstate(invalid="ignore"):
            return np.asarray(self.columns[name], dtype=np.float64)

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


@dataclass
class _Bounded(io.RawIOBase):
    """A file in memory that ends a search that goes over its bytes one by one."""

    data: bytes
    source: str
    _file: io.BytesIO = field(init=False)
    _reads: float = field(init=False)

    def __post_init__(self) -> None:
        self._file = io.BytesIO(self.data)
        self._reads = _READS_ALWAYS + _READS_PER_BYTE * len(self.data)

    def read(self, size: int = -1) -> bytes:
        self._reads -= 1
        if self._reads < 0:
            raise LogError(
                f"Log {self.source} must be a whole PX4 log (.ulg); instead received one that is "
                f"damaged from byte {self._file.tell()} on: copy it again from the vehicle."
            )
        return self._file.read(size)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()


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
        It cannot be taken apart.
    """
    log = _parse(data, source, list(wanted))
    parts = _parts(log)
    start = _start(log, parts)
    return UlogFile(
        topics=_topics(parts, start),
        info=dict(log.msg_info_dict),
        initial={name: float(v) for name, v in log.initial_parameters.items() if _is_number(v)},
        changed=tuple(
            (int(time), name, float(v)) for time, name, v in log.changed_parameters if _is_number(v)
        ),
        messages=tuple(message.message for message in log.logged_messages),
        start=start,
    )


class _Wary(ULog):  # type: ignore[misc]
    """pyulog that does not take a topic for longer than a message can be."""

    class _MessageAddLogged(ULog._MessageAddLogged):  # type: ignore[misc]
        def __init__(self, data: bytes, header: Any, message_formats: Mapping[str, Any]) -> None:
            name = ULog.parse_string(data[3:])
            if _fields(name, message_formats, {}, ()) > _LONGEST_MESSAGE:
                # pyulog goes on with the other topics.
                raise ValueError
            super().__init__(data, header, message_formats)


def _fields(
    name: str, forms: Mapping[str, Any], known: dict[str, int], above: tuple[str, ...]
) -> int:
    """How many fields a format has, those of the formats inside it too."""
    if name in above:
        return _LONGEST_MESSAGE + 1
    if name not in known:
        total = 0
        for kind, count, _ in forms[name].fields:
            each = 1 if kind not in forms else _fields(kind, forms, known, (*above, name))
            total += max(int(count), 1) * each
        known[name] = total
    return known[name]


def _parse(data: bytes, source: str, wanted: list[str]) -> Any:
    try:
        return _Wary(_Bounded(data, source), wanted)
    except (LogError, MemoryError):
        raise
    except Exception as error:
        raise LogError(
            f"Log {source} must be a PX4 log (.ulg) that can be taken apart; instead received "
            f"{type(error).__name__} ({_one_line(error)}): copy it again from the vehicle."
        ) from error


def _one_line(error: Exception) -> str:
    return re.sub(r"\s+", " ", str(error))[:80] or "no reason given"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float)


def _parts(log: Any) -> dict[tuple[str, int], list[Columns]]:
    """What came of each topic; what was appended after a crash comes apart from the rest."""
    parts: dict[tuple[str, int], list[Columns]] = {}
    for data in log.data_list:
        if "timestamp" in data.data:
            parts.setdefault((data.name, int(data.multi_id)), []).append(data.data)
    return parts


def _start(log: Any, parts: Mapping[tuple[str, int], list[Columns]]) -> int:
    """When the log began, as it says; the earliest row where that cannot be.

    A topic that seldom changes comes first with the last message from before the log.
    """
    stamps = [each["timestamp"] for tables in parts.values() for each in tables]
    if not stamps:
        return int(log.start_timestamp)
    every = np.concatenate([stamp.astype(np.float64) for stamp in stamps])
    every = every[np.isfinite(every)]
    if not len(every):
        return 0
    middle = float(np.median(every))
    said = float(log.start_timestamp)
    if middle - _DAY_US < said <= middle:
        return int(said)
    return int(every[np.abs(every - middle) < _DAY_US].min())


def _topics(
    parts: Mapping[tuple[str, int], list[Columns]], start: int
) -> dict[tuple[str, int], Topic]:
    """Rows in order of time, without those before the log and of another day."""
    found = {}
    for key, tables in parts.items():
        alike = [each for each in tables if each.keys() == tables[0].keys()]
        columns = {name: np.concatenate([each[name] for each in alike]) for name in tables[0]}
        since = columns["timestamp"].astype(np.float64) - start
        rows = np.flatnonzero((since > -_BEFORE_US) & (since < _DAY_US))
        rows = rows[np.argsort(since[rows], kind="stable")]
        if len(rows):
            found[key] = Topic({name: values[rows] for name, values in columns.items()})
    return found
