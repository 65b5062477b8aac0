"""Live values: a line a compass, and throttle and current as bars."""

from __future__ import annotations

from textual.content import Content
from textual.widgets import Static

from magcomp.live.snapshot import CompassNow, LiveSnapshot
from magcomp.tui.widgets.bars import bar
from magcomp.tui.widgets.verdict_text import grade_word

_POINTS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")
_FULL_MGAUSS = 900.0
_SCALES_A = (20.0, 50.0, 100.0, 200.0, 500.0)


class LiveTable(Static):
    """Field strength and heading of each compass."""

    HELP = """\
**Compasses now.** *Strength*: length of the field, mGauss; on earth 220 … 670, and it must not
change when the throttle does. *Heading*: magnetic, as the compass says with the calibration in
force; *corrected*: with the newest fit. *Fit so far*: what the judge says of the recording as it
is.
"""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self._text = ""

    def show(self, live: LiveSnapshot) -> None:
        """Draw; nothing happens where no digit changed."""
        table = self._table(live)
        if table.plain != self._text:
            self._text = table.plain
            self.update(table, layout=False)

    def _table(self, live: LiveSnapshot) -> Content:
        width = max(min(self.size.width - 64, 30), 6)
        head = f"  compass  strength {'':{width}}   heading   corrected  fit so far"
        lines = [Content.styled(head, "$quiet")]
        lines += [self._row(compass, width) for compass in live.compasses]
        if not live.compasses:
            lines.append(Content("  no compass reports yet"))
        return Content("\n").join(lines)

    def _row(self, compass: CompassNow, width: int) -> Content:
        mark = " " if compass.healthy else "!"
        style = "$primary" if compass.healthy else "$error"
        return Content.assemble(
            f" {mark}   {compass.number}     {compass.strength:5.0f} mG ",
            bar(compass.strength / _FULL_MGAUSS, width, style=style),
            f"  {direction(compass.heading_deg)}   {direction(compass.heading_corrected_deg)}  ",
            Content("  –") if compass.grade is None else grade_word(compass.grade),
        )


class ControlBars(Static):
    """Throttle and current."""

    HELP = """\
**Throttle and current**: what the motors are told and what they draw. The fit finds how the field
moves with one of them.
"""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self._text = ""
        self._most = _SCALES_A[0]

    def show(self, live: LiveSnapshot) -> None:
        """Draw; the full length of the current's bar grows with the largest current so far."""
        current = live.current or 0.0
        fits = (scale for scale in _SCALES_A if scale >= max(current, self._most))
        self._most = next(fits, _SCALES_A[-1])
        width = max(self.size.width - 31, 8)
        throttle = live.throttle or 0.0
        lines = [
            _control(
                "throttle", live.throttle, f"{100 * throttle:3.0f} %", throttle, "100 %", width
            ),
            _control(
                "current",
                live.current,
                f"{current:5.1f} A",
                current / self._most,
                f"{self._most:.0f} A",
                width,
            ),
        ]
        content = Content("\n").join(lines)
        if content.plain != self._text:
            self._text = content.plain
            self.update(content, layout=False)


def _control(
    name: str, value: float | None, text: str, share: float, full: str, width: int
) -> Content:
    if value is None:
        return Content.assemble((f"  {name:<9}", "$quiet"), "  not known")
    return Content.assemble(
        (f"  {name:<9}", "$quiet"),
        f"{text:>8} ",
        bar(share, width, style="$accent"),
        (f" {full:>6}", "$quiet"),
    )


def direction(degrees: float | None) -> str:
    """``123° SE``, always eight cells wide."""
    if degrees is None:
        return f"{'–':^8}"
    whole = round(degrees) % 360
    return f"{whole:4d}° {_POINTS[round(whole / 45) % 8]:<2}"
