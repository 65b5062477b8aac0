"""Tables of an analysis, a column a compass."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from magcomp import autopilots
from magcomp.autopilots import Kind
from magcomp.model import CompassResult, Form, MotorFit, Verdict, quantity_of
from magcomp.report import words
from magcomp.report.by_width import ByWidth

_DECIMALS = {Kind.DIAGONAL: 4, Kind.OFF_DIAGONAL: 4}


_NAMES, _COLUMN = 25, 17
"""Columns of the screen that the names of rows take, and a compass."""
_VECTORS_WIDTH = 74
"""Columns that a row a vector takes."""


class _Columns:
    """A table with a column a compass, in sections; on a narrow screen several, a few each."""

    def __init__(self, compasses: Sequence[int]) -> None:
        self._compasses = compasses
        self._rows: list[tuple[Text, list[str]]] = []

    def section(self, title: str) -> None:
        self._rows.append((Text(f" {title}"), []))

    def row(self, name: str, cells: Iterable[str]) -> None:
        self._rows.append((Text(f"   {name}", style="dim"), list(cells)))

    def tables(self, width: int) -> Iterator[RenderableType]:
        count = len(self._compasses)
        each = max((width - _NAMES) // _COLUMN, 1)
        for first in range(0, count, each):
            if first:
                yield Text()
            yield self._table(range(first, min(first + each, count)))

    def _table(self, which: range) -> Table:
        table = _plain_table()
        table.add_column()
        for index in which:
            title = Text(f"compass {self._compasses[index]}", style="bold")
            table.add_column(title, justify="right", min_width=_COLUMN - 2)
        for name, cells in self._rows:
            table.add_row(name, *(Text(cells[index]) for index in which if cells))
        return table


def _plain_table() -> Table:
    return Table(box=None, pad_edge=False, padding=(0, 1), show_edge=False)


def evidence(results: Sequence[CompassResult], *, verbose: bool = True) -> ByWidth:
    """Interference and coverage; where verbose, unexplained field, lags and line too."""
    fits = [result.fit for result in results]
    verdicts = [result.verdict for result in results]
    regressor = fits[0].regressor
    columns = _Columns([fit.compass for fit in fits])
    columns.section(words.interference_title(regressor))
    for index, axis in enumerate(words.AXES):
        pairs = ((f.interference[index], f.interference_std[index]) for f in fits)
        columns.row(axis, (words.with_std(float(value), float(std)) for value, std in pairs))
    if verbose:
        _statistics(columns, fits, verdicts)
    _coverage(columns, verdicts, regressor)
    return ByWidth(columns.tables)


def motors(results: Sequence[CompassResult]) -> ByWidth:
    """What each motor adds, a row an axis of a motor; nothing where the motors were not fitted."""
    columns = _Columns([result.fit.compass for result in results])
    for index, number in enumerate(results[0].fit.numbers):
        columns.section(f"motor {number} adds, mGauss per A")
        for axis, name in enumerate(words.AXES):
            told = (result.fit.by_motor[index] for result in results)
            columns.row(name, (words.with_std(float(v[axis]), float(s[axis])) for _, v, s in told))
    return ByWidth(columns.tables)


def forms(results: Sequence[CompassResult]) -> ByWidth:
    """What the field may follow: left unexplained on unseen data, and heading it costs."""
    columns = _Columns([result.fit.compass for result in results])
    columns.section("left unseen, mGauss")
    for row, form in enumerate(results[0].forms):
        name = f"{form.name} ({form.count})"
        columns.row(name, (_form(result.forms[row]) for result in results))
    return ByWidth(columns.tables)


def _form(form: Form) -> str:
    if form.is_best:
        return f"{form.held_out:.1f}, best"
    costs = f", {words.degrees(form.left_deg)}" if math.isfinite(form.left_deg) else ""
    return f"{form.held_out:.1f}{costs}"


def _statistics(columns: _Columns, fits: Sequence[MotorFit], verdicts: Sequence[Verdict]) -> None:
    columns.section("unexplained field, mGauss")
    columns.row("now", (f"{v.residual.held_out_before:.1f}" for v in verdicts))
    columns.row("corrected", (f"{v.residual.after:.1f}" for v in verdicts))
    columns.row("corrected, unseen data", (f"{v.residual.held_out:.1f}" for v in verdicts))
    columns.section("compass lags, ms")
    columns.row(
        "behind attitude",
        (words.milliseconds(f.lags.field, f.lags_std.field) for f in fits),
    )
    columns.row(
        f"behind {fits[0].regressor}",
        (words.milliseconds(f.lags.regressor, f.lags_std.regressor) for f in fits),
    )
    columns.section("line of the shift, mGauss")
    columns.row("straight to", map(_line, fits))


def check(verdicts: Mapping[int, Verdict], regressor: str) -> ByWidth:
    """What a check of the calibration in force rests on."""
    columns = _Columns(sorted(verdicts))
    ordered = [verdicts[compass] for compass in sorted(verdicts)]
    _coverage(columns, ordered, regressor)
    return ByWidth(columns.tables)


def _coverage(columns: _Columns, verdicts: Sequence[Verdict], regressor: str) -> None:
    covered = [verdict.coverage for verdict in verdicts]
    columns.section("covered")
    columns.row(
        regressor,
        (
            f"{words.quantity(c.u_low, regressor)} … {words.quantity(c.u_high, regressor)}"
            for c in covered
        ),
    )
    columns.row("of the full turn", (f"{100 * c.heading:.0f} %" for c in covered))
    columns.row("of all directions", (f"{100 * c.sphere:.0f} %" for c in covered))
    columns.row("tilt, time", (f"{c.tilt_deg:.0f}°, {c.seconds:.0f} s" for c in covered))


def _line(fit: MotorFit) -> str:
    if fit.line is None:
        return "–"
    return f"{fit.line.rms:.2f} in {float(np.ptp(fit.line.positions)):.0f}"


def parameters(
    values: Mapping[str, float], present: Mapping[str, float], *, verbose: bool
) -> tuple[ByWidth, list[str]]:
    """What would be written: old → new, a row a vector; and the vectors that stay as they are.

    Where verbose, those are in the table too. On a narrow screen each parameter has a row.
    """
    unchanged = []
    shown: dict[str, dict[str, Text]] = {}
    for name, members in _vectors(values).items():
        if not verbose and all(_same(values[m], present.get(m, math.nan)) for m in members):
            unchanged.append(name)
            continue
        shown[name] = {m: _change(m, values[m], present.get(m, math.nan)) for m in members}
    return ByWidth(lambda width: [_changes(shown, width)]), unchanged


def _changes(shown: Mapping[str, Mapping[str, Text]], width: int) -> Table:
    table = _plain_table()
    table.add_column(Text(" parameter", style="dim"))
    if width < _VECTORS_WIDTH:
        table.add_column(justify="right")
        for members in shown.values():
            for name, change in members.items():
                table.add_row(Text(f" {name}"), change)
        return table
    for axis in "XYZ":
        table.add_column(Text(f"_{axis}", style="dim"), justify="right", min_width=17)
    for vector, members in shown.items():
        table.add_row(Text(f" {vector}"), *members.values())
    return table


def _vectors(values: Mapping[str, float]) -> dict[str, list[str]]:
    """Names of parameters by vector: the switch, then motor, offset and soft iron by compass."""
    found: dict[str, list[str]] = {}
    place: dict[str, tuple[float, str]] = {}
    for name in values:
        parsed = autopilots.parse(name)
        vector = name if parsed is None else parsed.vector
        found.setdefault(vector, []).append(name)
        place[vector] = (math.inf if parsed is None else parsed.kind, vector)
    return {vector: found[vector] for vector in sorted(found, key=place.__getitem__)}


def _same(new: float, old: float) -> bool:
    return bool(np.float32(new) == np.float32(old))


def _change(name: str, new: float, old: float) -> Text:
    parsed = autopilots.parse(name)
    decimals = 3 if parsed is None else _DECIMALS.get(parsed.kind, 3)
    if parsed is not None and parsed.kind is Kind.OFFSET:
        decimals = autopilots.offset_decimals(name)
    if _same(new, old):
        return Text(words.number(new, decimals), style="dim")
    text = Text()
    if math.isfinite(old):
        text.append(f"{words.number(old, decimals)} → ", style="dim")
    text.append(words.number(new, decimals), style="bold")
    return text


def levels(result: CompassResult) -> ByWidth:
    """Centre of the ellipsoid at each level of the control quantity: docs/method.md, Fig. 4."""
    return ByWidth(lambda width: [_levels(result, is_wide=width >= _VECTORS_WIDTH)])


def _levels(result: CompassResult, *, is_wide: bool) -> Table:
    fit = result.fit
    table = _plain_table()
    table.add_column(Text(f"   {fit.regressor}", style="dim"), justify="right")
    for axis in words.AXES:
        table.add_column(Text(axis, style="dim"), justify="right", min_width=15 if is_wide else 0)
    if is_wide:
        table.add_column(Text("readings", style="dim"), justify="right", min_width=9)
    for level in fit.levels:
        std = np.sqrt(np.diag(level.covariance))
        u = quantity_of(fit.regressor).precise(level.u)
        centre = [
            words.with_std(float(c), float(s)) for c, s in zip(level.centre, std, strict=True)
        ]
        count = [Text(str(level.count))] if is_wide else []
        table.add_row(Text(u, style="dim"), *map(Text, centre), *count)
    return table
