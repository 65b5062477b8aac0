"""Heading error by control quantity: numbers with bars."""

from __future__ import annotations

from collections.abc import Sequence

from textual.content import Content

from magcomp.tui.pictures import ErrorRow
from magcomp.tui.widgets.bars import tail
from magcomp.tui.widgets.drawn import Drawn

_NUMBERS = 9 + 9 + 10 + 10


class HeadingTable(Drawn[tuple[ErrorRow, ...]]):
    """A row a control quantity: now, corrected, and the 95 % bound."""

    HELP = """\
**Heading error** – how wrong the heading can be over a full turn, at each current or throttle.

- *now*: with the calibration the vehicle has; ≤ where it is no better known than that.
- *corrected*: with this fit, as expected.
- *at most*: with this fit, not exceeded with 95 % probability.

Rows with `*` were not reached in the recording: they are extrapolated. The first line is of the
row in bold.
"""

    SETS_HEIGHT = True
    can_focus = False

    def show(self, rows: Sequence[ErrorRow]) -> None:
        """Draw the rows of one compass."""
        self.draw_data(tuple(rows))

    def picture(self, data: tuple[ErrorRow, ...], width: int, height: int) -> Content:  # noqa: ARG002
        """A line a row, with bars in what room is left."""
        length = max((width - _NUMBERS) // 2, 4)
        largest = max((max(r.before, r.bound) for r in data), default=1.0)
        head = f"{'':9}{'now':>8} {'':{length}}{'corrected':>10}{'at most':>9}"
        lines = [Content.styled(head, "bold")]
        for row in data:
            lines.append(
                Content.assemble(
                    (f"{row.label:>7}", "bold" if row.is_quoted else ""),
                    f"{' ' if row.covered else '*'} ",
                    f"{row.now:>8}° ",
                    tail(max(row.before, row.floor) / largest, length, style="$error"),
                    f"{row.after:9.1f}°",
                    f"{row.bound:8.1f}° ",
                    tail(row.bound / largest, length, style="$success"),
                )
            )
        if any(not row.covered for row in data):
            lines.append(Content.styled("  * reckoned, not flown", "$quiet"))
        return Content("\n").join(lines)
