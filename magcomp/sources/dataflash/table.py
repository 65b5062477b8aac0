"""The messages of a dataflash log, by name, as columns: the same of a binary and of a text log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from magcomp.model import FloatArray, as_floats

Columns = Mapping[str, NDArray[Any]]

_PLAIN_WORDS = b"\n_ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789"
_SCALES: Mapping[str, float] = {"c": 1e-2, "C": 1e-2, "e": 1e-2, "E": 1e-2, "L": 1e-7}


class Definition(NamedTuple):
    """What the format table says of a message.

    Attributes
    ----------
    name
        Such as ``"MAG"``.
    kinds
        A letter a column.
    columns
        Their names.
    """

    name: str
    kinds: str
    columns: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Piece:
    """Rows of a message that one definition describes.

    Attributes
    ----------
    definition
        Theirs.
    place
        Where each row stands: its byte or its line, increasing, shape (n,).
    raw
        Columns by name as stored, shape (n,) each; texts are bytes.
    scaled
        Whether numbers are in whole units already, as a text log has them.
    """

    definition: Definition
    place: NDArray[np.intp]
    raw: Columns
    scaled: bool = False

    def kind(self, column: str) -> str:
        """Letter of a column."""
        return self.definition.kinds[self.definition.columns.index(column)]

    def numbers(self, column: str) -> FloatArray:
        """A column in whole units, shape (n,); NaN where there is none, or it is a text."""
        stored = self.raw.get(column)
        if stored is None or stored.dtype.kind not in "biuf":
            return np.full(len(self.place), np.nan)
        scale = 1.0 if self.scaled else _SCALES.get(self.kind(column), 1.0)
        number = as_floats(stored)
        return number if scale == 1.0 else number * scale


class Table:
    """Every row of a message, in the order of the log.

    Parameters
    ----------
    pieces
        One a definition; more where the log redefines its messages.
    """

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self._pieces = tuple(pieces)
        place = np.concatenate([piece.place for piece in self._pieces])
        self._order = None if len(self._pieces) == 1 else np.argsort(place, kind="stable")
        self.place: NDArray[np.intp] = place if self._order is None else place[self._order]
        self.names = frozenset(name for piece in self._pieces for name in piece.raw)

    def __len__(self) -> int:
        return len(self.place)

    def first_of(self, *names: str) -> str | None:
        """The first of some columns that the message has."""
        return next((name for name in names if name in self.names), None)

    def is_float(self, column: str) -> bool:
        """Whether a column is in whole units: a fraction, or a number with its scale."""
        kinds = [piece.kind(column) for piece in self._pieces if column in piece.raw]
        return all(kind in "fdg" or kind in _SCALES for kind in kinds)

    def numbers(self, column: str) -> FloatArray:
        """A column in whole units, shape (n,); NaN where it is missing."""
        if self._order is None:
            return self._pieces[0].numbers(column)
        return np.concatenate([piece.numbers(column) for piece in self._pieces])[self._order]

    def matrix(self, *columns: str) -> FloatArray:
        """Some columns side by side, shape (n, number of columns)."""
        result = np.empty((len(self), len(columns)))
        for index, column in enumerate(columns):
            result[:, index] = self.numbers(column)
        return result

    def texts(self, column: str) -> list[str]:
        """A column of texts; empty where it is missing."""
        found: list[bytes] = []
        for piece in self._pieces:
            stored = piece.raw.get(column)
            is_text = stored is not None and stored.dtype.kind == "S"
            found.extend(
                stored.tolist() if stored is not None and is_text else [b""] * len(piece.place)
            )
        if self._order is not None:
            found = [found[index] for index in self._order.tolist()]
        together = b"\n".join(found)
        if not together.translate(None, _PLAIN_WORDS) and together.count(b"\n") < len(found):
            return together.decode("ascii").split("\n")
        return [text.partition(b"\0")[0].decode("latin-1").strip() for text in found]


Tables = Mapping[str, Table]


class Unpacked(NamedTuple):
    """A log taken apart.

    Attributes
    ----------
    tables
        The wanted messages by name; one that did not come has no entry.
    records
        Whole records found, wanted or not.
    skipped
        Bytes that belong to none.
    first_gap
        Place of the first of those; the end of the log where there is none.
    preface
        What stands before the format table, as an old text log has it.
    counts
        Rows of every message by name.
    """

    tables: Tables
    records: int
    skipped: int
    first_gap: int
    counts: Mapping[str, int]
    preface: str = ""
