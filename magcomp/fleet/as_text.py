"""A fleet for a terminal: what needs attention first, then all aircraft, then what was unusable."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.console import RenderableType
from rich.padding import Padding
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

from magcomp import __version__
from magcomp.fleet.aircraft import Aircraft
from magcomp.fleet.answer import Fleet
from magcomp.fleet.findings import Attention, date, texts
from magcomp.model import quantity_of
from magcomp.report import words
from magcomp.report.as_text import render
from magcomp.report.look import Look

_SIGN = {Attention.NONE: "●", Attention.LOOK: "◐", Attention.ACT: "○"}
_STYLE = {Attention.NONE: "bold green", Attention.LOOK: "bold yellow", Attention.ACT: "bold red"}
_SHOWN = 20
_UNUSABLE_SHOWN = 10
_NAME = 20
_COLUMNS = (("logs", 4), ("newest", 10), ("now", 6), ("fitted ≤", 8), ("adds, mGauss", 21))


def fleet_text(fleet: Fleet, look: Look, *, verbose: bool = False) -> str:
    """What ``magcomp fleet`` prints.

    Parameters
    ----------
    fleet
        The answer.
    look
        Width and colour.
    verbose
        Every aircraft and every unusable log.
    """
    return render(
        [*_summary(fleet), *_urgent(fleet, verbose), *_all(fleet, verbose), *_bad(fleet, verbose)],
        look,
    )


def counted(count: int, what: str) -> str:
    """``1 log``, ``12 logs``; aircraft stay aircraft."""
    plural = "" if count == 1 or what == "aircraft" else "s"
    return f"{count} {what}{plural}"


def summary(fleet: Fleet) -> str:
    """How many logs, and what became of them."""
    parts = [f"{fleet.fitted} fitted", f"{len(fleet.unusable)} unusable"]
    if fleet.selected.copies:
        parts.append(counted(fleet.selected.copies, "copy").replace("copys", "copies"))
    return (
        f"{counted(fleet.logs, 'log')}: {', '.join(parts)}; {fleet.read} read now; "
        f"{counted(len(fleet.aircraft), 'aircraft')}"
    )


def _summary(fleet: Fleet) -> Iterator[RenderableType]:
    yield Rule(Text(f"magcomp {__version__} fleet", style="bold"), align="left", style="dim")
    yield Text(f" {summary(fleet)}", style="bold")


def _urgent(fleet: Fleet, verbose: bool) -> Iterator[RenderableType]:
    needing = [each for each in fleet.aircraft if each.attention is not Attention.NONE]
    if not needing:
        if fleet.aircraft:
            yield Text(" No aircraft needs attention.", style=_STYLE[Attention.NONE])
        return
    for each in needing if verbose else needing[:_SHOWN]:
        yield Text()
        yield Text.assemble(
            (f" {_SIGN[each.attention]} ", _STYLE[each.attention]),
            (words.printable(each.name), "bold"),
            (f"  {words.printable(each.kind)} {words.printable(each.firmware)}", "dim"),
        )
        for text in texts(each.findings):
            yield Padding(Text(words.sentence(words.printable(text))), (0, 1, 0, 3))
    hidden = 0 if verbose else len(needing) - _SHOWN
    if hidden > 0:
        yield Text(f"\n and {hidden} more: see -v, --html or --table", style="dim")


def _all(fleet: Fleet, verbose: bool) -> Iterator[RenderableType]:
    if not fleet.aircraft:
        return
    table = Table(box=None, pad_edge=False, padding=(0, 1), show_edge=False)
    table.add_column()
    table.add_column(Text("aircraft", style="dim"), overflow="ellipsis", no_wrap=True)
    for title, least in _COLUMNS:
        table.add_column(Text(title, style="dim"), justify="right", min_width=least, no_wrap=True)
    for each in fleet.aircraft if verbose else fleet.aircraft[:_SHOWN]:
        table.add_row(
            Text(f" {_SIGN[each.attention]}", style=_STYLE[each.attention]),
            Text(_short(words.printable(each.name))),
            str(each.logs),
            date(each.newest),
            _degrees(each.before_deg),
            _degrees(_bound(each)),
            largest_motor(each),
        )
    yield Text()
    yield table
    hidden = 0 if verbose else len(fleet.aircraft) - _SHOWN
    if hidden > 0:
        yield Text(f" and {hidden} more: see -v, --html or --table", style="dim")


def _bad(fleet: Fleet, verbose: bool) -> Iterator[RenderableType]:
    if not fleet.unusable:
        return
    yield Text()
    yield Rule(
        Text(f"{counted(len(fleet.unusable), 'log')} without a fit", style="bold"),
        align="left",
        style="dim",
    )
    for each in fleet.unusable if verbose else fleet.unusable[:_UNUSABLE_SHOWN]:
        yield Text(f" {words.printable(each.path)}", no_wrap=True, overflow="ignore")
        yield Padding(Text(words.sentence(words.printable(each.why)), style="dim"), (0, 1, 0, 3))
    hidden = 0 if verbose else len(fleet.unusable) - _UNUSABLE_SHOWN
    if hidden > 0:
        yield Text(f" and {hidden} more: see -v, --html or --table", style="dim")


def largest_motor(each: Aircraft) -> str:
    """The largest component of the pooled motor vectors, mGauss, with its scatter and of what."""
    pooled = [
        (compass.pooled, compass.regressor)
        for compass in each.compasses
        if compass.pooled is not None
    ]
    if not pooled:
        return "–"
    worst, regressor = max(pooled, key=lambda one: float(abs(one[0].motor).max()))
    axis = int(abs(worst.motor).argmax())
    std = float(worst.covariance[axis, axis]) ** 0.5
    return f"{words.with_std(-float(worst.motor[axis]), std)} {quantity_of(regressor).per}"


def _bound(each: Aircraft) -> float:
    bounds = [compass.flights[-1].bound_deg for compass in each.compasses]
    return max((one for one in bounds if math.isfinite(one)), default=math.nan)


def _degrees(value: float) -> str:
    return f"{value:.1f}°" if math.isfinite(value) else "–"


def _short(name: str) -> str:
    # The end of a path tells more than its beginning.
    return name if len(name) <= _NAME else f"…{name[-_NAME + 1 :]}"
