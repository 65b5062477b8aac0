"""Rows for a spreadsheet or a data frame; no cell can be a formula."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from magcomp.errors import OutputError
from magcomp.fleet.row import VECTORS
from magcomp.fleet.store import arrow
from magcomp.report import words
from magcomp.report.files import write_text

SUFFIXES = (".csv", ".parquet")

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_PARTS = {
    "correction": "motor_x motor_y motor_z offset_x offset_y offset_z "
    "iron_xx iron_yy iron_zz iron_xy iron_xz iron_yz",
    "in_force": "motor_x motor_y motor_z offset_x offset_y offset_z "
    "iron_xx iron_yy iron_zz iron_xy iron_xz iron_yz",
    "motor_covariance": "xx yy zz xy xz yz",
}


def write_table(path: Path, table: Any, *, force: bool = False) -> None:
    """Write rows; the suffix chooses the form.

    Parameters
    ----------
    path
        ``.csv`` or ``.parquet``.
    table
        Of the store.
    force
        Replace a file that is there.

    Raises
    ------
    OutputError
        Where the file exists and ``force`` is not set, or it cannot be written.
    """
    if path.suffix.lower() == ".csv":
        write_text(path, csv_text(table), force=force)
        return
    if path.exists() and not force:
        raise OutputError(f"{path} must not exist yet; use --force to overwrite it")
    _, parquet = arrow()
    temporary = path.with_name(f".{path.name}.part")
    try:
        try:
            parquet.write_table(table, temporary, compression="zstd")
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{path} must be writable; instead received: {error}") from error


def csv_text(table: Any) -> str:
    """Rows as comma-separated values, a line each, vectors in columns of their own."""
    page = io.StringIO()
    writer = csv.writer(page, lineterminator="\n")
    names = table.column_names
    writer.writerow(list(_titles(names)))
    columns = [table.column(name).to_pylist() for name in names]
    for values in zip(*columns, strict=True):
        writer.writerow(
            [
                cell(part)
                for value in values
                for part in (value if isinstance(value, list) else [value])
            ]
        )
    return page.getvalue()


def _titles(names: list[str]) -> Iterator[str]:
    for name in names:
        if name in VECTORS:
            yield from (f"{name}_{part}" for part in _PARTS[name].split())
        else:
            yield name


def cell(value: object) -> object:
    """A cell that no spreadsheet takes for a formula, and no terminal for a command."""
    if isinstance(value, float):
        return value if math.isfinite(value) else ""
    if not isinstance(value, str):
        return value
    clean = "; ".join(words.printable(line) for line in value.split("\n"))
    return f"'{clean}" if clean.lstrip().startswith(_FORMULA) else clean
