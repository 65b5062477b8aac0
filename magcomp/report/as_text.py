"""An analysis as text for a terminal: the verdict first, then what it rests on."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.rule import Rule
from rich.text import Text

from magcomp import __version__
from magcomp.model import Analysis, CompassResult, Grade, Recording, Vehicle, Verdict
from magcomp.report import tables, words
from magcomp.report.bars import Row, bars
from magcomp.report.look import Look

GRADE_STYLE = {Grade.GOOD: "bold green", Grade.MARGINAL: "bold yellow", Grade.REJECTED: "bold red"}
_GRADE_SIGN = {Grade.GOOD: "●", Grade.MARGINAL: "◐", Grade.REJECTED: "○"}

_ALIKE_DEG, _ALIKE_SHARE = 0.5, 0.05
"""Compasses whose heading errors differ by less share one picture."""

_DIGITS = re.compile(r"\d+(\.\d+)?")


def analysis_text(
    analysis: Analysis,
    present: Mapping[str, float],
    look: Look,
    *,
    written: str | None = None,
    verbose: bool = False,
) -> str:
    """What ``magcomp fit`` prints.

    Parameters
    ----------
    analysis
        The answer.
    present
        Parameters as the recording left them, for the difference.
    look
        Width and colour.
    written
        The parameter file it went to, if any.
    verbose
        Every parameter and every level.
    """
    return render(
        [
            *heading(analysis.source, analysis.vehicle, analysis.duration_s),
            *findings(analysis),
            *evidence(analysis),
            *_parameters(analysis, present, verbose=verbose),
            *(tables.levels(result) for result in analysis.compasses if verbose),
            *_ending(analysis, written),
        ],
        look,
    )


def check_text(recording: Recording, verdicts: Mapping[int, Verdict], kind: str, look: Look) -> str:
    """What ``magcomp check`` prints; ``kind`` is the control quantity of the table."""
    parts: list[RenderableType] = [
        *heading(recording.source, recording.vehicle, recording.duration_s)
    ]
    for compass, verdict in sorted(verdicts.items()):
        parts.extend(_verdict(verdict.grade, [compass], verdict.reasons))
        rows = [
            Row(words.quantity(row.u, kind), (row.before, row.p95)) for row in verdict.heading_error
        ]
        parts.append(Text())
        parts.append(bars("heading error", ("in force", "at most (95 %)"), rows))
    return render(parts, look)


def render(parts: Iterable[RenderableType], look: Look) -> str:
    """Lay the parts out, one under the other."""
    page = io.StringIO()
    console = Console(
        file=page,
        width=look.columns,
        force_terminal=look.colour,
        color_system="standard" if look.colour else None,
        legacy_windows=False,
        markup=False,
        emoji=False,
        highlight=False,
    )
    console.print(Group(*parts))
    # Rich fills lines with blanks, which only make a copied text untidy.
    return "".join(f"{line.rstrip()}\n" for line in page.getvalue().splitlines())


def heading(source: str, vehicle: Vehicle, duration_s: float) -> Iterator[RenderableType]:
    """Whose recording this is."""
    yield Rule(
        Text(f"magcomp {__version__}", style="bold"), align="left", style="dim", characters="─"
    )
    line = Text(" ")
    line.append(source, style="bold")
    line.append(f", {words.duration(duration_s)} of {words.vehicle(vehicle)}")
    yield line
    if vehicle.device_ids:
        ids = ", ".join(map(str, vehicle.device_ids))
        yield Text(f" compass device ids {ids}", style="dim")


def findings(analysis: Analysis) -> Iterator[RenderableType]:
    """Verdict, reasons and picture of each compass; of compasses that are alike, once."""
    for group in alike(analysis.compasses):
        first = group[0]
        numbers = [result.fit.compass for result in group]
        yield from _verdict(first.verdict.grade, numbers, first.verdict.reasons)
        rows = [
            Row(words.quantity(row.u, first.fit.regressor), (row.before, row.p95))
            for row in first.verdict.heading_error
        ]
        yield Text()
        yield bars(f"heading error by {first.fit.regressor}", ("now", "corrected (95 %)"), rows)


def _verdict(
    grade: Grade, numbers: Sequence[int], reasons: Sequence[str]
) -> Iterator[RenderableType]:
    yield Text()
    title = Text(" ")
    title.append(f"{_GRADE_SIGN[grade]} {grade.value.upper()}", style=GRADE_STYLE[grade])
    title.append(f"  {words.compasses(numbers)}", style="bold")
    if len(numbers) > 1:
        title.append(f" (alike; the numbers are those of compass {numbers[0]})", style="dim")
    yield title
    for reason in reasons:
        yield Padding(Text(words.sentence(reason)), (0, 0, 0, 3))


def alike(results: Sequence[CompassResult]) -> list[list[CompassResult]]:
    """Compasses of the same verdict whose tables of heading error agree, together."""
    groups: list[list[CompassResult]] = []
    for result in results:
        for group in groups:
            if _same(group[0], result):
                group.append(result)
                break
        else:
            groups.append([result])
    return groups


def _same(one: CompassResult, other: CompassResult) -> bool:
    def wording(result: CompassResult) -> list[str]:
        return [_DIGITS.sub("#", reason) for reason in result.verdict.reasons]

    def near(a: float, b: float) -> bool:
        return abs(a - b) <= max(_ALIKE_DEG, _ALIKE_SHARE * max(a, b))

    rows = zip(one.verdict.heading_error, other.verdict.heading_error, strict=False)
    return (
        one.verdict.grade is other.verdict.grade
        and wording(one) == wording(other)
        and len(one.verdict.heading_error) == len(other.verdict.heading_error)
        and all(near(a.before, b.before) and near(a.p95, b.p95) for a, b in rows)
    )


def evidence(analysis: Analysis) -> Iterator[RenderableType]:
    """What was found and what it rests on, a column a compass."""
    yield Text()
    yield tables.evidence(analysis.compasses)
    yield Text()
    for why, numbers in _by_method(analysis.compasses).items():
        of = "" if len(numbers) == len(analysis.compasses) else f"{words.compasses(numbers)}: "
        yield _note(f"{of}{why}")
    for note in analysis.notes:
        yield _note(note)


def _by_method(results: Sequence[CompassResult]) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for result in results:
        fit = result.fit
        why = f"method {fit.method}, because {fit.why}; {fit.regressor} from {fit.origin}"
        found.setdefault(why, []).append(fit.compass)
    return found


def _note(text: str) -> RenderableType:
    return Padding(Text(words.sentence(text), style="dim"), (0, 0, 0, 1))


def _parameters(
    analysis: Analysis, present: Mapping[str, float], *, verbose: bool
) -> Iterator[RenderableType]:
    values: dict[str, float] = {}
    for result in analysis.compasses:
        values.update(result.parameters)
    if values:
        yield Text()
        yield tables.parameters(values, present, verbose=verbose)


def _ending(analysis: Analysis, written: str | None) -> Iterator[RenderableType]:
    yield Text()
    rejected = [c.fit.compass for c in analysis.compasses if c.verdict.grade is Grade.REJECTED]
    if analysis.grade is Grade.REJECTED and written is None:
        yield _next("Nothing to write.", "Mend what the verdict names, record again and fit again.")
        return
    if written is None:
        yield _next(
            "Nothing is written yet.", f"Next: magcomp fit {analysis.source} -o compass.param"
        )
    else:
        yield _next(
            f"Written to {written}.",
            "Next: load it with your ground station (or MAVProxy: param load), fly, and run "
            "magcomp check on the new log.",
        )
    if rejected and analysis.grade is not Grade.REJECTED:
        yield _next("", f"Left out because rejected: {words.compasses(rejected)}.")


def _next(first: str, second: str) -> RenderableType:
    text = Text(first, style="bold")
    text.append(f"{' ' if first else ''}{second}", style="not bold")
    return Padding(text, (0, 0, 0, 1))
