"""Take a binary dataflash log (.BIN) apart, a whole message type at a time.

A record is A3 95, the number of its type, and as many bytes as the format table says. Every place
that could begin a record is a candidate with one successor: the first candidate from its end on.
A candidate that ends where no other begins, and that begins where no other ends, is a
coincidence. Of the others those that are reached from the first one are the records.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from magcomp.mavlink.checksum import ByteArray
from magcomp.sources.dataflash.table import Definition, Piece, Table, Unpacked

IntArray = NDArray[np.intp]

_HEAD = (0xA3, 0x95)
_HEAD_SIZE = 3
_FORMAT = 128
_FORMAT_RECORD = np.dtype(
    [
        ("head", "V3"),
        ("type", "u1"),
        ("size", "u1"),
        ("name", "S4"),
        ("kinds", "S16"),
        ("columns", "S64"),
    ]
)
_TYPES: dict[str, str] = {
    "a": "(32,)<i2", "b": "i1", "B": "u1", "c": "<i2", "C": "<u2", "d": "<f8", "e": "<i4",
    "E": "<u4", "f": "<f4", "g": "<f2", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4",
    "L": "<i4", "M": "u1", "n": "S4", "N": "S16", "q": "<i8", "Q": "<u8", "Z": "S64",
}  # fmt: skip
_SIZES = np.zeros(256, dtype=np.intp)
_SIZES[[ord(kind) for kind in _TYPES]] = [np.dtype(code).itemsize for code in _TYPES.values()]
_ENOUGH_ROWS = 1000
_NAME = re.compile(rb"[A-Za-z0-9_]{1,4}")
_KINDS = re.compile(rb"[%s]{0,16}" % "".join(_TYPES).encode())


class _Format(NamedTuple):
    """A definition and where it stands."""

    place: int
    number: int
    size: int
    name: str
    kinds: bytes
    columns: bytes

    @property
    def definition(self) -> Definition:
        columns = self.columns.partition(b"\0")[0].decode("latin-1").split(",")
        return Definition(self.name, self.kinds.decode(), tuple(map(str.strip, columns)))


def unpack(octets: ByteArray, wanted: Collection[str]) -> Unpacked:
    """Find every record and the columns of some messages.

    Parameters
    ----------
    octets
        The whole log.
    wanted
        Names of the messages to decode.
    """
    candidates = _candidates(octets)
    numbers = octets[candidates + 2]
    places = _whole(candidates[numbers == _FORMAT], len(octets), _FORMAT_RECORD.itemsize)
    formats = _sized(octets, candidates, numbers, _formats(octets, places))
    found = _Records(octets, candidates, numbers, formats)
    # A format that stands in a message's text, and not in the log's own table, describes nothing.
    own = found.hold(np.array([each.place for each in formats], dtype=np.intp))
    if not own.all():
        formats = [each for each, is_own in zip(formats, own.tolist(), strict=True) if is_own]
        found = _Records(octets, candidates, numbers, formats)
    pieces: dict[str, list[Piece]] = {}
    counts: dict[str, int] = {}
    for each, rows in found.by_format():
        counts[each.name] = counts.get(each.name, 0) + len(rows)
        if each.name in wanted and (piece := _piece(octets, each, rows)) is not None:
            pieces.setdefault(each.name, []).append(piece)
    return Unpacked(
        tables={name: Table(some) for name, some in pieces.items()},
        records=len(found.place),
        skipped=len(octets) - found.bytes,
        first_gap=found.first_gap,
        counts=counts,
    )


def _candidates(octets: ByteArray) -> IntArray:
    """Places of A3 95, increasing."""
    if len(octets) < _HEAD_SIZE:
        return np.zeros(0, dtype=np.intp)
    # The second byte is looked at only where the first one is right: a fifth of the time.
    first = np.flatnonzero(octets[: 1 - _HEAD_SIZE] == _HEAD[0])
    return np.asarray(first[octets[first + 1] == _HEAD[1]])


def _whole(places: IntArray, size: int, length: int) -> IntArray:
    return places[places + length <= size]


def _records(octets: ByteArray, places: IntArray, length: int) -> NDArray[np.void]:
    """Copies of the records at some places, shape (n,), of ``length`` raw bytes each."""
    everywhere: NDArray[np.void] = np.ndarray(
        (max(len(octets) - length + 1, 0),), dtype=f"V{length}", buffer=octets, strides=(1,)
    )
    return everywhere[places]


def _formats(octets: ByteArray, places: IntArray) -> list[_Format]:
    """Every definition that differs from the one before it of the same type."""
    if not len(places):
        return []
    raw = _records(octets, places, _FORMAT_RECORD.itemsize)
    table = raw.view(_FORMAT_RECORD)
    found: list[_Format] = []
    last: dict[int, bytes] = {}
    rows = zip(places.tolist(), raw.tolist(), table.tolist(), strict=True)
    for place, whole, (_, number, size, name, kinds, columns) in rows:
        if last.get(number) == whole or not _NAME.fullmatch(name) or not _KINDS.fullmatch(kinds):
            continue
        last[number] = whole
        found.append(_Format(place, number, size, name.decode(), kinds, columns))
    return found


def _sized(
    octets: ByteArray, candidates: IntArray, numbers: ByteArray, formats: list[_Format]
) -> list[_Format]:
    """Formats with the length that their letters make, where the told one is a lie.

    It is one where another record stands after the former more often than after the latter.
    """
    if not formats:
        return []
    letters = np.array([each.kinds for each in formats], dtype="S16")
    sizes = _HEAD_SIZE + _SIZES[letters.view(np.uint8).reshape(len(formats), 16)].sum(axis=1)
    told = np.array([each.size for each in formats])
    result = list(formats)
    places: dict[int, IntArray] = {}
    for index in np.flatnonzero(sizes != told).tolist():
        each, size = formats[index], int(sizes[index])
        if each.number not in places:
            places[each.number] = candidates[numbers == each.number][:_ENOUGH_ROWS]
        rows = places[each.number]
        possible = each.size >= _HEAD_SIZE
        as_told = _ending(octets, rows + each.size) if possible else 0
        if _ending(octets, rows + size) > as_told:
            result[index] = each._replace(size=size)
    return [each for each in result if each.size >= _HEAD_SIZE]


def _ending(octets: ByteArray, ends: IntArray) -> int:
    """How many ends of records have a header, or the end of the log, after them."""
    inside = ends[ends < len(octets) - 1]
    heads = (octets[inside] == _HEAD[0]) & (octets[inside + 1] == _HEAD[1])
    return int(np.count_nonzero(heads) + np.count_nonzero(ends == len(octets)))


def _layout(definition: Definition, size: int) -> np.dtype[Any] | None:
    """Where each column stands in a record; None where names, letters and size do not agree."""
    names, kinds = definition.columns, definition.kinds
    if len(set(names)) != len(names) or len(names) != len(kinds) or "" in names:
        return None
    fields = [(name, _TYPES[kind]) for name, kind in zip(names, kinds, strict=True)]
    layout = np.dtype([("", f"V{_HEAD_SIZE}"), *fields]) if fields else np.dtype("V3")
    return layout if layout.itemsize == size else None


class _Records:
    """The records of a log.

    Attributes
    ----------
    place
        Where each begins, increasing, shape (n,).
    bytes
        Bytes in all of them.
    first_gap
        First byte that is in none.
    """

    def __init__(
        self, octets: ByteArray, candidates: IntArray, numbers: ByteArray, formats: list[_Format]
    ) -> None:
        self._formats = formats
        which = _which(candidates, numbers, formats)
        sizes = np.array([each.size for each in formats] + [0], dtype=np.intp)
        size = sizes[which]
        end = candidates + size
        known = (size > 0) & (end <= len(octets))
        if not known.all():
            candidates, which, end = candidates[known], which[known], end[known]
        chosen = _chained(candidates, end, len(octets))
        if chosen is not None:
            candidates, which, end = candidates[chosen], which[chosen], end[chosen]
        self.place, self._which = candidates, which
        self.bytes = int((end - candidates).sum())
        begins, ends = np.append(candidates, len(octets)), np.append(0, end)
        gaps = begins != ends
        self.first_gap = int(ends[np.argmax(gaps)]) if gaps.any() else len(octets)

    def hold(self, places: IntArray) -> NDArray[np.bool_]:
        """Whether a record begins at each of some places."""
        at = np.searchsorted(self.place, places)
        return np.asarray(np.append(self.place, -1)[at] == places)

    def by_format(self) -> list[tuple[_Format, IntArray]]:
        """Places of the records of each format that has any."""
        order = np.argsort(
            self._which.astype(np.int16 if len(self._formats) < 1 << 15 else np.intp), kind="stable"
        )
        sorted_places = self.place[order]
        count = np.bincount(self._which, minlength=len(self._formats))
        stop = np.cumsum(count)
        return [
            (self._formats[index], sorted_places[stop[index] - count[index] : stop[index]])
            for index in np.flatnonzero(count).tolist()
        ]


def _which(candidates: IntArray, numbers: ByteArray, formats: list[_Format]) -> IntArray:
    """Index of the format of each candidate; the number of formats where it has none.

    A definition holds from its place on, and the first one of a type before it too.
    """
    none = len(formats)
    by_number: dict[int, list[int]] = {}
    for index, each in enumerate(formats):
        by_number.setdefault(each.number, []).append(index)
    first = np.full(256, none, dtype=np.intp)
    for number, indices in by_number.items():
        first[number] = indices[0]
    which = first[numbers]
    for number, indices in by_number.items():
        if len(indices) > 1:
            rows = np.flatnonzero(numbers == number)
            since = np.array([formats[index].place for index in indices])
            at = np.searchsorted(since, candidates[rows], side="right") - 1
            which[rows] = np.array(indices)[np.maximum(at, 0)]
    return which


def _chained(begin: IntArray, end: IntArray, size: int) -> NDArray[np.bool_] | None:
    """Which candidates are records; None for all of them."""
    if not len(begin):
        return None
    if (begin[1:] == end[:-1]).all():
        return None
    following = _following(begin, end)
    joins = np.append(begin, size)[following] == end
    met = np.zeros(len(begin) + 1, dtype=bool)
    met[following[joins]] = True
    sure = np.flatnonzero(joins | met[:-1])
    chosen = np.zeros(len(begin), dtype=bool)
    if not len(sure):
        return chosen
    chosen[sure[_reached(_following(begin[sure], end[sure]))]] = True
    return chosen


def _following(begin: IntArray, end: IntArray) -> IntArray:
    """Index of the first candidate from each one's end on, which mostly is the next one."""
    following = np.arange(1, len(begin) + 1)
    others = np.flatnonzero(np.append(begin[1:], -1) != end)
    following[others] = np.searchsorted(begin, end[others])
    return following


def _reached(following: IntArray) -> NDArray[np.bool_]:
    """Which of n nodes are reached from the first, where each leads to a later one; n is the end.

    Only where a step leaves nodes out is there anything to decide; those places are followed by
    doubling the length of the jumps.
    """
    n = len(following)
    leaps = np.flatnonzero(following != np.arange(1, n + 1))
    if not len(leaps):
        return np.ones(n, dtype=bool)
    jump = np.append(np.searchsorted(leaps, following[leaps]), len(leaps))
    taken = np.zeros(len(leaps) + 1, dtype=bool)
    taken[0] = True
    for _ in range(len(leaps).bit_length()):
        taken[jump[taken]] = True
        jump = jump[jump]
    left = np.zeros(n + 1, dtype=np.intp)
    start = leaps[taken[:-1]]
    left[start + 1] += 1
    left[following[start]] -= 1
    return np.asarray(np.cumsum(left[:-1]) == 0)


def _piece(octets: ByteArray, of: _Format, rows: IntArray) -> Piece | None:
    definition = of.definition
    layout = _layout(definition, of.size)
    if layout is None:
        return None
    table = _records(octets, rows, of.size).view(layout)
    return Piece(definition, rows, {name: table[name] for name in definition.columns})
