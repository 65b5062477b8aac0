"""Tables of an analysis, a column a compass."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from rich.table import Table
from rich.text import Text

from magcomp.model import CURRENT, CompassResult
from magcomp.report import words

_VECTOR = re.compile(r"(COMPASS_[A-Z]+[23]?)_([XYZ])")

_Cell = Callable[[CompassResult], str]


def evidence(results: Sequence[CompassResult]) -> Table:
    """Interference, unexplained field, lags, line and coverage."""
    regressor = results[0].fit.regressor
    table = Table(box=None, pad_edge=False, padding=(0, 1), show_edge=False)
    table.add_column()
    for result in results:
        table.add_column(
            Text(f"compass {result.fit.compass}", style="bold"), justify="right", min_width=15
        )

    def section(name: str, unit: str) -> None:
        title = Text(f" {name}")
        title.append(f" {unit}", style="dim")
        table.add_row(title, *[Text() for _ in results])

    def row(name: str, cell: _Cell) -> None:
        table.add_row(Text(f"   {name}", style="dim"), *[Text(cell(result)) for result in results])

    section("motors add", words.per_unit(regressor))
    for index, axis in enumerate(("forward", "right", "down")):
        row(axis, _interference(index))
    section("unexplained field", "mGauss")
    row("now", lambda r: f"{r.verdict.residual.held_out_before:.1f}")
    row("corrected, on unseen data", lambda r: f"{r.verdict.residual.held_out:.1f}")
    row("corrected, on fitted data", lambda r: f"{r.verdict.residual.after:.1f}")
    section("lags", "ms")
    row(
        "compass behind attitude",
        lambda r: words.milliseconds(r.fit.lags.field, r.fit.lags_std.field),
    )
    row(
        f"compass behind {regressor}",
        lambda r: words.milliseconds(r.fit.lags.regressor, r.fit.lags_std.regressor),
    )
    section("the shift's line", "mGauss")
    row("off a line of", _line)
    section("covered", "")
    row(regressor, _range)
    row("headings, directions", _shares)
    row("tilt, time", _tilt)
    return table


def _interference(axis: int) -> _Cell:
    def cell(result: CompassResult) -> str:
        fit = result.fit
        return words.with_std(float(fit.interference[axis]), float(fit.interference_std[axis]))

    return cell


def _line(result: CompassResult) -> str:
    line = result.fit.line
    if line is None:
        return "–"
    return f"{line.rms:.2f} of {float(np.ptp(line.positions)):.0f}"


def _range(result: CompassResult) -> str:
    covered = result.verdict.coverage
    low, high = (words.quantity(u, result.fit.regressor) for u in (covered.u_low, covered.u_high))
    return f"{low} … {high}"


def _shares(result: CompassResult) -> str:
    covered = result.verdict.coverage
    return f"{100 * covered.heading:.0f} %, {100 * covered.sphere:.0f} %"


def _tilt(result: CompassResult) -> str:
    covered = result.verdict.coverage
    return f"{covered.tilt_deg:.0f}°, {covered.seconds:.0f} s"


def parameters(
    values: Mapping[str, float], present: Mapping[str, float], *, verbose: bool
) -> Table:
    """What would be written: old → new, a row a vector; unchanged vectors only where verbose."""
    table = Table(box=None, pad_edge=False, padding=(0, 1), show_edge=False)
    table.add_column(Text(" parameter", style="dim"))
    for axis in "XYZ":
        table.add_column(Text(f"_{axis}", style="dim"), justify="right", min_width=17)
    unchanged = []
    for name, members in _vectors(values).items():
        if not verbose and all(_same(values[m], present.get(m, math.nan)) for m in members):
            unchanged.append(name)
            continue
        cells = [_change(values[m], present.get(m, math.nan)) for m in members]
        table.add_row(Text(f" {name}"), *cells)
    if unchanged:
        table.caption = Text(f" unchanged: {', '.join(unchanged)}", style="dim")
        table.caption_justify = "left"
    return table


def _vectors(values: Mapping[str, float]) -> dict[str, list[str]]:
    """Names of parameters by vector; the motor vectors and the switch first."""
    found: dict[str, list[str]] = {}
    for name in values:
        match = _VECTOR.fullmatch(name)
        found.setdefault(match[1] if match else name, []).append(name)
    return dict(sorted(found.items(), key=lambda item: "MOT" not in item[0]))


def _same(new: float, old: float) -> bool:
    return bool(np.float32(new) == np.float32(old))


def _change(new: float, old: float) -> Text:
    if _same(new, old):
        return Text(words.number(new), style="dim")
    text = Text()
    if math.isfinite(old):
        text.append(f"{words.number(old)} → ", style="dim")
    text.append(words.number(new), style="bold")
    return text


def levels(result: CompassResult) -> Table:
    """Centre of the ellipsoid at each level of the control quantity: the paper's Fig. 4."""
    fit = result.fit
    table = Table(box=None, pad_edge=False, padding=(0, 1), show_edge=False)
    table.title = Text(f"\n compass {fit.compass}: centre of the readings, mGauss", style="bold")
    table.title_justify = "left"
    table.add_column(Text(f"   {fit.regressor}", style="dim"), justify="right", min_width=10)
    for axis in "xyz":
        table.add_column(Text(axis, style="dim"), justify="right", min_width=15)
    table.add_column(Text("readings", style="dim"), justify="right", min_width=9)
    for level in fit.levels:
        std = np.sqrt(np.diag(level.covariance))
        u = f"{level.u:.1f} A" if fit.regressor == CURRENT else f"{100 * level.u:.1f} %"
        centre = [
            words.with_std(float(c), float(s)) for c, s in zip(level.centre, std, strict=True)
        ]
        table.add_row(Text(u, style="dim"), *map(Text, centre), Text(str(level.count)))
    return table
