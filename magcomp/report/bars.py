"""Bars of block characters: numbers that can be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.table import Table
from rich.text import Text

_EIGHTHS = " ▏▎▍▌▋▊▉"
_WIDTH = 22
_STYLES = ("red", "green")


@dataclass(frozen=True)
class Row:
    """One control quantity: its name and a value in degrees for each column."""

    label: str
    values: tuple[float, ...]


def bars(title: str, columns: Sequence[str], rows: Sequence[Row]) -> Table:
    """A small plot: a row a control quantity, a bar a column, all to one scale."""
    table = Table(box=None, pad_edge=False, padding=(0, 1), show_edge=False)
    table.add_column(Text(""), justify="right", width=2)
    table.add_column(Text("", style="dim"), justify="right", width=6)
    for name in columns:
        table.add_column(Text("", style="dim"), justify="right", width=7)
        table.add_column(Text(name, style="dim"), width=_WIDTH)
    largest = max((value for row in rows for value in row.values), default=0.0)
    for row in rows:
        cells = [Text(), Text(row.label, style="dim")]
        for value, style in zip(row.values, _STYLES, strict=False):
            cells.append(Text(f"{value:.1f}°"))
            cells.append(Text(bar(value, largest, _WIDTH), style=style))
        table.add_row(*cells)
    table.title = Text(
        f"   {title}, the largest of all headings, level and tilted by 20°", style="dim"
    )
    table.title_justify = "left"
    return table


def bar(value: float, largest: float, width: int) -> str:
    """A bar whose full ``width`` is ``largest``; never empty, so that small is not none."""
    eighths = round(value / largest * width * 8) if largest > 0.0 else 0
    full, rest = divmod(min(max(eighths, 1), width * 8), 8)
    return "█" * full + _EIGHTHS[rest].strip()
