"""Heading error by control quantity: numbers with bars."""

from __future__ import annotations

from collections.abc import Sequence

from textual.content import Content
from textual.widgets import Static

from magcomp.tui.pictures import ErrorRow
from magcomp.tui.widgets.bars import tail

_NUMBERS = 9 + 8 + 8 + 8 + 3


class HeadingTable(Static):
    """A row a control quantity: now, corrected, and the 95 % bound."""

    HELP = """\
**Heading error** – how wrong the heading can be over a full turn, at each current or throttle.

- *now*: with the calibration the vehicle has.
- *corrected*: with this fit, as expected.
- *at most*: with this fit, not exceeded with 95 % probability.

Rows with `*` were not reached in the recording: they are extrapolated.
"""

    can_focus = False

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self._rows: Sequence[ErrorRow] = ()

    def show(self, rows: Sequence[ErrorRow]) -> None:
        """Draw the rows of one compass."""
        self._rows = rows
        self.update(self._table())

    def on_resize(self) -> None:
        """Fit the bars to the new width."""
        self.update(self._table())

    def _table(self) -> Content:
        width = max((self.size.width - _NUMBERS) // 2, 4)
        largest = max((max(r.before, r.bound) for r in self._rows), default=1.0)
        head = f"{'':9}{'now':>8} {'':{width}}{'corrected':>10}{'at most':>9}"
        lines = [Content.styled(head, "bold")]
        for row in self._rows:
            lines.append(
                Content.assemble(
                    f"{row.label:>7}{' ' if row.covered else '*'} ",
                    f"{row.before:7.1f}° ",
                    tail(row.before / largest, width, style="$error"),
                    f"{row.after:9.1f}°",
                    f"{row.bound:8.1f}° ",
                    tail(row.bound / largest, width, style="$success"),
                )
            )
        if any(not row.covered for row in self._rows):
            lines.append(Content.styled("  * beyond what was recorded", "$quiet"))
        return Content("\n").join(lines)
