"""The verdicts of a text: grade, reasons and picture of each compass; of those alike, once."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import RenderableType
from rich.padding import Padding
from rich.text import Text

from magcomp.judge.judge import error_at
from magcomp.model import Analysis, Grade, HeadingError, Verdict
from magcomp.report import as_json, plain, words
from magcomp.report.bars import BEFORE_AFTER, Row, bars

GRADE_STYLE = {Grade.GOOD: "bold green", Grade.MARGINAL: "bold yellow", Grade.REJECTED: "bold red"}
_GRADE_SIGN = {Grade.GOOD: "●", Grade.MARGINAL: "◐", Grade.REJECTED: "○"}

_ALIKE_DEG, _ALIKE_SHARE = 0.5, 0.05
"""Compasses whose heading errors differ by less share one picture."""

_DIGITS = re.compile(r"\d+(\.\d+)?")


@dataclass(frozen=True)
class Finding:
    """One compass' verdict as it is told.

    Attributes
    ----------
    compass
        1, 2 or 3.
    verdict, regressor
        The verdict, and the control quantity its table is against.
    quoted
        The row that the sentences quote.
    verbose
        Whether the judge's summary is told too.
    compares
        Whether the table is of what is in force and what comes after it, not of the former and
        its bound.
    """

    compass: int
    verdict: Verdict
    regressor: str
    quoted: HeadingError | None = None
    verbose: bool = True
    compares: bool = True

    @property
    def reasons(self) -> Sequence[str]:
        """What is said of it: without the judge's summary where the pilot's line says that."""
        every = self.verdict.reasons
        return every if self.verbose else plain.doubts(every, self.verdict.grade)


def of_analysis(
    analysis: Analysis, document: Mapping[str, Any] | None = None, *, verbose: bool = True
) -> Iterator[RenderableType]:
    """Those of an analysis."""
    document = as_json.analysis_object(analysis) if document is None else document
    results = [
        Finding(
            c.fit.compass, c.verdict, c.fit.regressor, as_json.quoted_row(found["quoted"]), verbose
        )
        for c, found in zip(analysis.compasses, document["compasses"], strict=True)
    ]
    return of_findings(results, ("now", "corrected, at most (95 %)"), BEFORE_AFTER)


def of_check(
    verdicts: Mapping[int, Verdict], document: Mapping[str, Any]
) -> Iterator[RenderableType]:
    """Those of a check of the calibration in force."""
    results = []
    for found in document["compasses"]:
        row, verdict = found["quoted"], verdicts[found["compass"]]
        at = None if row is None else error_at(verdict.heading_error, row["u"])
        results.append(Finding(found["compass"], verdict, found["regressor"], at, compares=False))
    return of_findings(results, ("in force", "at most (95 %)"), ("red", "yellow"))


def of_findings(
    results: Sequence[Finding], columns: tuple[str, str], styles: tuple[str, str]
) -> Iterator[RenderableType]:
    """Those given, with the titles and styles of both columns of the pictures."""
    for group in _alike(results):
        first = group[0]
        yield Text()
        title = _title(first.verdict.grade, [result.compass for result in group])
        yield Padding(title, (0, 0, 0, 1))
        for reason in first.reasons:
            yield Padding(Text(words.sentence(reason)), (0, 1, 0, 3))
        if rows := list(_rows(first)):
            yield Text()
            yield bars("heading error", columns, rows, styles)
        covered, table = first.verdict.coverage, first.verdict.heading_error
        low, high = (words.quantity(u, first.regressor) for u in (covered.u_low, covered.u_high))
        if not all(words.is_flown(row.u, covered.u_low, covered.u_high) for row in table):
            note = f"in brackets: reckoned, not flown; the log covers {low} to {high}"
            yield Padding(Text(note, style="dim"), (0, 0, 0, 6))


def _rows(finding: Finding) -> Iterator[Row]:
    """The table, with the row that the sentences quote in its place."""
    quoted, covered = finding.quoted, finding.verdict.coverage
    table = list(finding.verdict.heading_error)
    if quoted is not None:
        table = plain.with_quoted(table, quoted, finding.regressor)
    for row in table:
        u = words.quantity(row.u, finding.regressor)
        flown = words.is_flown(row.u, covered.u_low, covered.u_high)
        # What is in force is known no better than the fit is: below the fit's bound, its own
        # error is that bound, and the correction must not look worse.
        bounded = finding.compares and row.before <= row.p95
        yield Row(
            u if flown else f"({u})",
            (max(row.before, row.p95) if bounded else row.before, row.p95),
            is_bound=bounded,
            is_marked=row is quoted,
        )


def _title(grade: Grade, numbers: Sequence[int]) -> Text:
    title = Text()
    title.append(f"{_GRADE_SIGN[grade]} {grade.value.upper()}", style=GRADE_STYLE[grade])
    title.append(f"  {words.compasses(numbers)}", style="bold")
    if len(numbers) > 1:
        title.append(f" (alike; the numbers are those of compass {numbers[0]})", style="dim")
    return title


def _alike(results: Sequence[Finding]) -> list[list[Finding]]:
    """Compasses of the same verdict whose tables of heading error agree, together."""
    groups: list[list[Finding]] = []
    for result in results:
        group = next((group for group in groups if _same(group[0], result)), None)
        if group is None:
            groups.append([result])
        else:
            group.append(result)
    return groups


def _same(one: Finding, other: Finding) -> bool:
    def wording(finding: Finding) -> list[str]:
        return [_DIGITS.sub("#", reason) for reason in finding.verdict.reasons]

    def near(a: float, b: float) -> bool:
        return abs(a - b) <= max(_ALIKE_DEG, _ALIKE_SHARE * max(a, b))

    tables_of = (one.verdict.heading_error, other.verdict.heading_error)
    return (
        one.verdict.grade is other.verdict.grade
        and wording(one) == wording(other)
        and len(tables_of[0]) == len(tables_of[1])
        and all(
            near(a.before, b.before) and near(a.p95, b.p95) for a, b in zip(*tables_of, strict=True)
        )
    )
