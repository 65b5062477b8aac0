"""Headings before and after the correction, side by side."""

from __future__ import annotations

import math

from textual.content import Content

from magcomp.tui.before_after import TRACE_S, HeadingPair, HeadingTrace
from magcomp.tui.widgets.bars import tail
from magcomp.tui.widgets.drawn import Drawn
from magcomp.tui.widgets.live_table import direction
from magcomp.tui.widgets.plots import Picture

_FULL_DEG = 30.0
_TITLE = 12


class HeadingPairs(Drawn[tuple[bool, tuple[HeadingPair, ...]]]):
    """A block a compass: before on the left, corrected on the right."""

    HELP = """\
**Before and after.** *Before* is the heading with the old calibration, *corrected* with the new
one; *takes out* is the difference at this moment.

After a write, fly as before and land: what the fit promised then stands beside what the flight
shows. On the ground the propellers must be off, or the vehicle well tied down and nobody near.

Hold the vehicle still and tied down, press M to mark its heading, then change the throttle:
*before* moves with the motors, *corrected* should stay. In flight hold a heading and watch *takes
out* grow with the throttle.
"""

    def show(self, pairs: tuple[HeadingPair, ...], *, marked: bool) -> None:
        """Draw; with how far each has moved where there is a mark."""
        self.draw_data((marked, pairs))

    def picture(
        self,
        data: tuple[bool, tuple[HeadingPair, ...]],
        width: int,
        height: int,  # noqa: ARG002
    ) -> Content:
        """A block a compass."""
        marked, pairs = data
        if not pairs:
            return Content(" no compass reports yet")
        column = max((width - _TITLE - 10) // 2, 14)
        head = f"{'':{_TITLE}}{'before':<{column}}{'corrected':<{column}}takes out"
        lines = [Content.styled(head, "$quiet")]
        for pair in pairs:
            lines.append(
                Content.assemble(
                    (f" compass {pair.compass}  ", "bold"),
                    f"{direction(pair.before):<{column}}{direction(pair.after):<{column}}",
                    f"{_degrees(pair.correction):>8}",
                )
            )
            if marked:
                lines += self._moved(pair, column)
        return Content("\n").join(lines)

    def _moved(self, pair: HeadingPair, column: int) -> list[Content]:
        width = column - 10
        sides = (
            (pair.moved_before, pair.largest_before, "$error"),
            (pair.moved_after, pair.largest_after, "$success"),
        )
        moved: list[Content | tuple[str, str]] = [(f"{'   moved':<{_TITLE}}", "$quiet")]
        most: list[Content | tuple[str, str]] = [(f"{'   at most':<{_TITLE}}", "$quiet")]
        for now, largest, style in sides:
            share = abs(now or 0.0) / _FULL_DEG
            moved += [
                Content(f"{_degrees(now):>8} "),
                tail(share, width, style=style),
                Content(" "),
            ]
            most += [Content(f"{_degrees(largest, sign=False):>8} {'':{width}} ")]
        return [Content.assemble(*moved), Content.assemble(*most)]


class HeadingPlot(Picture):
    """How far the headings of one compass have moved since the mark, in the last minute.

    Before there is a mark: what the correction takes out of them.
    """

    HELP = HeadingPairs.HELP

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self._trace = HeadingTrace()
        self._marked = False

    def show(self, trace: HeadingTrace, *, marked: bool) -> None:
        """Draw one compass."""
        self._trace, self._marked = trace, marked
        self.draw_plot()

    def draw_plot(self) -> None:
        """Draw with the colours and the size there are now."""
        trace = self._trace
        if not self.is_attached:
            return
        self.begin("seconds")
        moved = (trace.before, "x", "error"), (trace.after, "dot", "success")
        drawn = moved if self._marked else ((trace.taken_out, "dot", "accent"),)
        known = [v for values, _, _ in drawn for v in values if math.isfinite(v)]
        for values, marker, colour in drawn:
            rows = zip(trace.seconds, values, strict=True)
            finite = [(time, value) for time, value in rows if math.isfinite(value)]
            if finite:
                time, value = map(list, zip(*finite, strict=True))
                self.plt.scatter(time, value, color=self.colour(colour), marker=marker)
        low, high = min(known, default=0.0), max(known, default=0.0)
        self.ticks((-TRACE_S, 0.0), (min(low, -1.0), max(high, 1.0)))
        self.refresh()


def _degrees(value: float | None, *, sign: bool = True) -> str:
    if value is None:
        return "–"
    return f"{value:+.1f}°" if sign else f"{value:.1f}°"
