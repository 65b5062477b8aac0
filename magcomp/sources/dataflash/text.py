"""Take a dataflash log in text (.log) apart: lines of a message's name and its columns.

Lines are found and told apart as bytes of one array; only the wanted ones become numbers, all rows
of a message at once.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from magcomp.mavlink.checksum import ByteArray
from magcomp.sources.dataflash.table import Definition, Piece, Table, Unpacked

IntArray = NDArray[np.intp]

_NEWLINE, _RETURN, _COMMA = 10, 13, 44
_NAME_SIZE = 5  # four letters and the comma
_FORMAT = "FMT"
_FORMAT_COLUMNS = 5
_TEXTS = frozenset("nNZM")
_LONGEST = 1 << 12
_PREFACE_LINES = 50


def unpack(octets: ByteArray, wanted: Collection[str]) -> Unpacked:
    """Find every line of a known message and the columns of some messages.

    Parameters
    ----------
    octets
        The whole log.
    wanted
        Names of the messages to decode.
    """
    begin, end = _lines(octets)
    kinds, which = np.unique(_names(octets, begin, end), return_inverse=True)
    rows = {
        kind.decode("latin-1"): np.flatnonzero(which == n) for n, kind in enumerate(kinds.tolist())
    }
    lines = rows.get(_FORMAT, np.zeros(0, dtype=np.intp))
    definitions = _definitions(octets, begin, end, lines)
    known = {name: at for name, at in rows.items() if name in definitions or name == _FORMAT}
    tables = {}
    for name in wanted:
        if name in known and name in definitions:
            piece = _piece(octets, begin, end, known[name], definitions[name])
            if len(piece.place):
                tables[name] = Table([piece])
    records = sum(map(len, known.values()))
    first_format = int(lines[0]) if len(lines) else 0
    is_lost = np.ones(len(begin), dtype=bool)
    for at in known.values():
        is_lost[at] = False
    after = np.flatnonzero(is_lost[first_format:]) + first_format
    preface = [_line(octets, begin, end, n) for n in range(min(first_format, _PREFACE_LINES))]
    return Unpacked(
        tables=tables,
        records=records,
        skipped=int((end[after] - begin[after]).sum()),
        first_gap=int(after[0]) if len(after) else len(begin),
        counts={name: len(at) for name, at in known.items()},
        preface="\n".join(line.decode("latin-1") for line in preface),
    )


def _lines(octets: ByteArray) -> tuple[IntArray, IntArray]:
    """First byte of each line that is not empty, and the one after its last, shape (n,) each."""
    breaks = np.flatnonzero(octets == _NEWLINE)
    begin = np.append(0, breaks + 1)
    end = np.append(breaks, len(octets))
    end -= (end > begin) & (octets[np.maximum(end - 1, 0)] == _RETURN) if len(octets) else 0
    some = end > begin
    return begin[some], end[some]


def _names(octets: ByteArray, begin: IntArray, end: IntArray) -> NDArray[np.bytes_]:
    """What stands before the first comma of each line, where that is at most four letters."""
    if not len(begin):
        return np.zeros(0, dtype="S5")
    at = np.minimum(begin[:, np.newaxis] + np.arange(_NAME_SIZE), len(octets) - 1)
    head = np.where(at < end[:, np.newaxis], octets[at], 0).astype(np.uint8)
    is_comma = head == _COMMA
    length = np.where(is_comma.any(axis=1), is_comma.argmax(axis=1), 0)
    head[np.arange(_NAME_SIZE) >= length[:, np.newaxis]] = 0
    return head.view(f"S{_NAME_SIZE}")[:, 0]


def _line(octets: ByteArray, begin: IntArray, end: IntArray, number: int) -> bytes:
    first = int(begin[number])
    return bytes(octets[first : min(int(end[number]), first + _LONGEST)])


def _definitions(
    octets: ByteArray, begin: IntArray, end: IntArray, rows: IntArray
) -> dict[str, Definition]:
    """The format table; of a name that stands twice the first."""
    found: dict[str, Definition] = {}
    seen: set[bytes] = set()
    for row in rows.tolist():
        line = _line(octets, begin, end, row)
        if line in seen:
            continue
        seen.add(line)
        parts = [part.strip() for part in line.decode("latin-1").split(",")]
        if len(parts) < _FORMAT_COLUMNS:
            continue
        _, _, _, name, kinds, *columns = parts
        columns = [column for column in columns if column]
        if len(columns) == len(kinds) == len(set(columns)):
            found.setdefault(name, Definition(name, kinds, tuple(columns)))
    return found


def _piece(
    octets: ByteArray, begin: IntArray, end: IntArray, rows: IntArray, definition: Definition
) -> Piece:
    """Rows with as many columns as the definition says."""
    content = octets.tobytes()
    spans = zip((begin[rows]).tolist(), end[rows].tolist(), strict=True)
    lines = [content[first:last] for first, last in spans]
    count = len(definition.columns)
    texts = [index for index, kind in enumerate(definition.kinds) if kind in _TEXTS]
    # The last text may hold commas of its own.
    exact = not (texts and texts[-1] == count - 1)
    whole = [
        (row, line)
        for row, line in zip(rows.tolist(), lines, strict=True)
        if len(line) <= _LONGEST
        and (line.count(b",") == count or (not exact and line.count(b",") > count))
    ]
    place = np.array([row for row, _ in whole], dtype=np.intp)
    raw: dict[str, NDArray[Any]] = {}
    if texts:
        cells = [line.split(b",", count)[1:] for _, line in whole]
        for index, column in enumerate(definition.columns):
            values = [cell[index].strip() for cell in cells]
            if index in texts:
                raw[column] = np.array(values, dtype=bytes)
            else:
                raw[column] = np.array([_number(value) for value in values])
        return Piece(definition, place, raw, scaled=True)
    numbers = _numbers([line[line.index(b",") + 1 :] for _, line in whole], count)
    for index, column in enumerate(definition.columns):
        raw[column] = numbers[:, index]
    return Piece(definition, place, raw, scaled=True)


def _numbers(rows: list[bytes], count: int) -> NDArray[np.float64]:
    """Rows of as many numbers between commas, shape (n, count); NaN where one is none."""
    if not rows:
        return np.zeros((0, count))
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromstring(b",".join(rows), dtype=np.float64, sep=",")
        except (ValueError, DeprecationWarning):
            values = np.zeros(0)
    if len(values) == len(rows) * count:
        return np.asarray(values.reshape(len(rows), count))
    return np.array([[_number(value) for value in row.split(b",")] for row in rows])


def _number(value: bytes) -> float:
    try:
        return float(value)
    except ValueError:
        return float("nan")
