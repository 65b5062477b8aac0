"""Bars of block characters: numbers that can be seen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rich.text import Text

from magcomp.report.by_width import ByWidth

_EIGHTHS = ("", "▏", "▎", "▍", "▌", "▋", "▊", "▉")
BEFORE_AFTER = ("red", "green")
_WIDEST = 22
_AROUND = 34
"""Columns of a line that are no bars."""


@dataclass(frozen=True)
class Row:
    """One control quantity: its name, and a value for each of the columns.

    ``is_bound`` says that the first value is known from above only, ``is_marked`` that this is the
    row the sentences quote.
    """

    label: str
    values: tuple[float, float]
    is_bound: bool = False
    is_marked: bool = False


def bars(
    title: str,
    columns: tuple[str, str],
    rows: Sequence[Row],
    styles: tuple[str, str] = BEFORE_AFTER,
    unit: str = "°",
) -> ByWidth:
    """A small plot: a line a control quantity, two bars a line, all to one scale."""
    return ByWidth(lambda width: lines(title, columns, rows, styles, width, unit))


def lines(
    title: str,
    columns: tuple[str, str],
    rows: Sequence[Row],
    styles: tuple[str, str],
    width: int,
    unit: str = "°",
) -> Iterator[Text]:
    """The plot's lines, none longer than ``width`` columns, from 60."""
    length = min(_WIDEST, (width - _AROUND) // 2)
    largest = max((value for row in rows for value in row.values), default=0.0)
    head = f"      {title:<16}{columns[0]}"
    second = min(len(head) - len(columns[0]) + length + 10, width - len(columns[1]))
    yield Text(f"{head:<{second}}{columns[1]}", style="dim")
    for row in rows:
        line = Text(f"{row.label:>12}", style="bold" if row.is_marked else "dim")
        for index, (value, style) in enumerate(zip(row.values, styles, strict=True)):
            sign = "≤" if row.is_bound and index == 0 else " "
            line.append(f"{sign + f'{value:.1f}':>8}{unit}  ", style="not bold not dim")
            drawn = bar(value, largest, length)
            line.append(drawn if index else f"{drawn:<{length}}", style=f"not bold not dim {style}")
        yield line


def bar(value: float, largest: float, width: int) -> str:
    """A bar whose full ``width`` is ``largest``; never empty, so that small is not none."""
    eighths = round(value / largest * width * 8) if largest > 0.0 else 0
    full, rest = divmod(min(max(eighths, 1), width * 8), 8)
    return "█" * full + _EIGHTHS[rest]
