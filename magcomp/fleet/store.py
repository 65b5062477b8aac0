"""Rows in one Parquet dataset, a folder a version, that survives being killed at any moment."""

from __future__ import annotations

import uuid
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from magcomp import __version__
from magcomp.errors import OutputError, UsageError
from magcomp.fleet.row import VECTORS, Row

_PARTS = 16
"""Files beyond which those of earlier runs are put into one."""


def arrow() -> tuple[ModuleType, ModuleType]:
    """Give pyarrow and its Parquet module.

    Raises
    ------
    UsageError
        Where they are not installed.
    """
    try:
        import pyarrow  # noqa: PLC0415 - optional
        import pyarrow.parquet  # noqa: PLC0415
    except ImportError as error:
        raise UsageError(
            "A fleet's results must be kept with pyarrow, which is not installed: pip install "
            "'magcomp[fleet]'"
        ) from error
    return pyarrow, pyarrow.parquet


class Store:
    """A folder of results; every row stays for good.

    Parameters
    ----------
    folder
        Where; made where it is missing.
    version
        Whose rows are read and written.

    Raises
    ------
    OutputError
        Where the folder cannot be made.
    """

    def __init__(self, folder: Path, version: str = __version__) -> None:
        self.folder = folder / "results" / f"version={version}"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(
                f"{folder} must be a folder that can be written; instead received: {error.strerror}"
            ) from error

    def append(self, rows: Sequence[Row]) -> None:
        """Keep rows: all of them or none.

        Raises
        ------
        OutputError
            Where they cannot be written.
        """
        if rows:
            self._write(table_of(rows))

    def read(self, columns: Sequence[str] | None = None) -> Any:
        """Every row as a pyarrow table, in the order in which they were written in each file.

        Parameters
        ----------
        columns
            Those wanted, with texts as dictionaries: rows that say the same share one. All by
            default, with texts as they are.
        """
        pa, parquet = arrow()
        schema = _schema()
        names = schema.names if columns is None else list(columns)
        texts = (
            []
            if columns is None
            else [n for n in names if pa.types.is_string(schema.field(n).type)]
        )
        tables = []
        for part in self._parts():
            try:
                with parquet.ParquetFile(part, read_dictionary=texts) as file:
                    # Threads that wait for each other take three times as long as one.
                    table = file.read(columns=names, use_threads=False)
                tables.append(table.select(names))
            except FileNotFoundError:
                # Another run has just put it into one with others, which is read again at the next.
                continue
            except (OSError, KeyError, pa.ArrowInvalid) as error:
                raise OutputError(
                    f"{part} must be a file of results; instead it is damaged ({error}): remove "
                    "it, and its logs are read again"
                ) from error
        if not tables:
            return pa.schema([schema.field(name) for name in names]).empty_table()
        return pa.concat_tables(tables).unify_dictionaries()

    def gather(self) -> None:
        """Put many small files into one. A kill half-way leaves rows twice, never none."""
        parts = self._parts()
        if len(parts) <= _PARTS:
            return
        self._write(self.read())
        for part in parts:
            part.unlink(missing_ok=True)

    def _parts(self) -> list[Path]:
        return sorted(self.folder.glob("*.parquet"))

    def _write(self, table: Any) -> None:
        _, parquet = arrow()
        name = uuid.uuid4().hex
        temporary = self.folder / f".{name}"
        try:
            try:
                parquet.write_table(table, temporary, compression="zstd")
                temporary.replace(self.folder / f"{name}.parquet")
            finally:
                temporary.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(
                f"{self.folder} must be a folder that can be written; instead received: {error}"
            ) from error


def words_of(table: Any, name: str) -> tuple[list[str], NDArray[np.intp]]:
    """The different words of a column of text, and which of them stands in each row."""
    pa, _ = arrow()
    column = table.column(name)
    encoded = column if pa.types.is_dictionary(column.type) else column.dictionary_encode()
    whole = encoded.combine_chunks()
    return whole.dictionary.to_pylist(), whole.indices.to_numpy().astype(np.intp)


def listed(table: Any, name: str, rows: NDArray[np.intp]) -> list[Any]:
    """A column of some rows as a list; those that say the same share one text, made only once."""
    column = table.column(name)
    pa, _ = arrow()
    if pa.types.is_string(column.type) or pa.types.is_dictionary(column.type):
        words, which = words_of(table, name)
        shared: list[Any] = np.array([*words, None], dtype=object)[which[rows]].tolist()
        return shared
    plain: list[Any] = column.to_numpy()[rows].tolist()
    return plain


def table_of(rows: Iterable[Row]) -> Any:
    """Rows as a pyarrow table."""
    pa, _ = arrow()
    listed = list(rows)
    schema = _schema()
    columns = [
        pa.array([_value(getattr(row, each.name)) for row in listed], each.type) for each in schema
    ]
    return pa.Table.from_arrays(columns, schema=schema)


def _value(value: object) -> object:
    # A path may hold bytes that are no text.
    return value.encode("utf-8", "replace").decode() if isinstance(value, str) else value


def _schema() -> Any:
    pa, _ = arrow()
    types: Mapping[str, Any] = {
        "str": pa.string(),
        "int": pa.int64(),
        "float": pa.float64(),
        "bool": pa.bool_(),
    }
    return pa.schema(
        [
            (each.name, pa.list_(pa.float64(), VECTORS[each.name]))
            if each.name in VECTORS
            else (each.name, types[str(each.type)])
            for each in fields(Row)
        ]
    )
