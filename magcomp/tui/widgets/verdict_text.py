"""The judge's word on one compass, with reasons and evidence, all in words."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

import numpy as np
from textual.app import ComposeResult
from textual.containers import VerticalScroll
from textual.content import Content
from textual.widgets import Static

from magcomp.model import CompassResult, Grade
from magcomp.report import words
from magcomp.tui.pictures import AXIS_WORDS
from magcomp.tui.widgets.drawn import Drawn

MARKS = {Grade.GOOD: "●", Grade.MARGINAL: "◐", Grade.REJECTED: "○"}
_MOST_LINES, _NARROW = 4, 70
"""Lines there are for what to do and why, and columns below which the former needs most of them."""

STYLES = {Grade.GOOD: "$success", Grade.MARGINAL: "$warning", Grade.REJECTED: "$error"}


def grade_word(grade: Grade) -> Content:
    """``● GOOD``: sign, word and colour say the same."""
    return Content.styled(f"{MARKS[grade]} {grade.value.upper()}", f"bold {STYLES[grade]}")


def grade_so_far(grade: Grade, *, early: bool) -> Content:
    """The judge's word; who has recorded too little is not told that a compass is rejected."""
    return Content("… too early") if early and grade is Grade.REJECTED else grade_word(grade)


class ReasonLine(Drawn[tuple[str, str, Grade, str]]):
    """Why a pilot should write a compass's fit, or must not: before any number."""

    SETS_HEIGHT = True

    def show(self, result: CompassResult, line: str, *, early: bool) -> None:
        """Draw the pilot's line, and why one compass is not good; of one that is not, that alone.

        Parameters
        ----------
        result
            Of the compass.
        line
            What to do with the whole fit; see :func:`magcomp.report.plain.pilots_lines`.
        early
            As for :func:`grade_so_far`.
        """
        reasons, grade = result.verdict.reasons, result.verdict.grade
        text = words.sentence(reasons[0]) if reasons else ""
        title = f"Compass {result.fit.compass} is {grade.value}: "
        if early and grade is Grade.REJECTED:
            title = f"Too early for compass {result.fit.compass}: "
        rejected = grade is Grade.REJECTED
        doubt = ("", "") if grade is Grade.GOOD else (title, text)
        self.draw_data(("" if rejected else line, doubt[0], grade, doubt[1]))

    def picture(self, data: tuple[str, str, Grade, str], width: int, height: int) -> Content:  # noqa: ARG002
        """What to do, and in a line or two why; what does not fit stands in the verdict."""
        line, title, grade, reason = data
        most = 1 if line and width < _NARROW else 2

        def laid_out(text: str, most: int) -> Content:
            lines = textwrap.wrap(
                text, max(width - 2, 20), max_lines=most, placeholder=" … (V: verdict)"
            )
            return Content("\n".join(f" {each}" for each in lines))

        parts = [laid_out(line, _MOST_LINES - most)] if line else []
        if title:
            style = f"bold {STYLES[grade]}"
            parts.append(laid_out(f"{title}{reason}", most).stylize(style, 0, len(title) + 1))
        return Content("\n").join(parts)


class VerdictText(VerticalScroll):
    """Verdict, reasons, and the numbers they rest on."""

    HELP = """\
**Verdict** – *good*: worth writing. *Marginal*: usable, with a doubt that is named. *Rejected*: do
not write it; record again as the reasons say.

*Unseen* is the unexplained field on stretches of the recording that the fit was not shown: the
number that cannot flatter.
"""

    def compose(self) -> ComposeResult:
        """One text in a scroll."""
        yield Static(id="verdict-text")

    def show(self, result: CompassResult, notes: Sequence[str]) -> None:
        """Draw one compass."""
        lines = [*_verdict(result), Content(""), *_evidence(result), Content(""), *_why(result)]
        lines += [Content(words.sentence(note)) for note in notes]
        self.query_one("#verdict-text", Static).update(Content("\n").join(lines))
        self.scroll_home(animate=False)


def _verdict(result: CompassResult) -> Iterator[Content]:
    yield grade_word(result.verdict.grade)
    for reason in result.verdict.reasons:
        yield Content(words.sentence(reason))


def _evidence(result: CompassResult) -> Iterator[Content]:
    fit, residual, covered = result.fit, result.verdict.residual, result.verdict.coverage
    yield Content.styled(_title(words.interference_title(fit.regressor)), "bold")
    pairs = zip(AXIS_WORDS, fit.interference, fit.interference_std, strict=True)
    yield from (_row(name, words.with_std(float(v), float(s))) for name, v, s in pairs)
    yield Content.styled("Unexplained field, mGauss", "bold")
    yield _row("now", f"{residual.held_out_before:.1f}")
    yield _row("corrected", f"{residual.after:.1f}")
    yield _row("unseen", f"{residual.held_out:.1f}")
    yield Content.styled("Covered", "bold")
    low, high = (words.quantity(u, fit.regressor) for u in (covered.u_low, covered.u_high))
    yield _row(fit.regressor, f"{low} … {high}")
    yield _row("full turn", f"{100 * covered.heading:.0f} %")
    yield _row("directions", f"{100 * covered.sphere:.0f} %")
    yield _row("tilt, time", f"{covered.tilt_deg:.0f}°, {covered.seconds:.0f} s")
    yield Content.styled("How straight, how late", "bold")
    if fit.line is not None:
        length = float(np.ptp(fit.line.positions))
        yield _row("off a line", f"{fit.line.rms:.2f} of {length:.0f} mGauss")
    lags = (fit.lags.field, fit.lags_std.field), (fit.lags.regressor, fit.lags_std.regressor)
    yield _row("attitude", f"{words.milliseconds(*lags[0])} ms")
    yield _row(fit.regressor, f"{words.milliseconds(*lags[1])} ms")


def _why(result: CompassResult) -> Iterator[Content]:
    fit = result.fit
    yield Content(words.sentence(f"method {fit.method}, because {fit.why}"))
    yield Content(words.sentence(f"{fit.regressor} from {fit.origin}"))


def _row(name: str, value: str) -> Content:
    return Content.assemble((f"  {name:<12}", "$quiet"), value)


def _title(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}"
