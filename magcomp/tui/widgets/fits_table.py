"""The fits tried, side by side."""

from __future__ import annotations

from collections.abc import Sequence

from textual.content import Content

from magcomp.tui.fits import FitRow, degrees
from magcomp.tui.widgets.drawn import Drawn
from magcomp.tui.widgets.verdict_text import grade_word


class FitsTable(Drawn[tuple[FitRow, ...]]):
    """A row a fit; the one shown has a pointer, and is the one that would be written."""

    HELP = """\
**Fits side by side.** Every way tried is kept: change method (M), regressor (R) or time range (T),
and compare. *At most*: heading error at the largest load reached, not exceeded with 95 %
probability. *Apart*: how far its heading is from that of the fit shown. P shows another one of
them, and that one would be written.

Ways that are honest lie as close together as their bounds say.
"""

    SETS_HEIGHT = True

    def show(self, rows: Sequence[FitRow]) -> None:
        """Draw the fits of one compass."""
        self.draw_data(tuple(rows))

    def picture(self, data: tuple[FitRow, ...], width: int, height: int) -> Content:  # noqa: ARG002
        """A line a fit."""
        room = max((len(row.time) for row in data), default=0) + 1
        head = f"    {'method':<8}{'by':<9}{'time':<{room}}{'at most':>8}{'apart':>7}  verdict"
        lines = [Content.styled(head, "$quiet")]
        for row in data:
            pointer = "▸" if row.shown else " "
            apart = "shown" if row.shown else degrees(row.apart)
            lines.append(
                Content.assemble(
                    f"{pointer} {row.number} {row.method:<8}{row.by:<9}{row.time:<{room}}"
                    f"{degrees(row.bound):>8}{apart:>7}  ",
                    grade_word(row.grade),
                )
            )
        return Content("\n").join(lines)
