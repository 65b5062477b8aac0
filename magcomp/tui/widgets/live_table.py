"""Live values: a line a compass, and throttle and current as bars."""

from __future__ import annotations

from dataclasses import dataclass

from textual.content import Content

from magcomp.live.snapshot import CompassNow, LiveSnapshot
from magcomp.tui.widgets.bars import bar
from magcomp.tui.widgets.drawn import Drawn
from magcomp.tui.widgets.verdict_text import grade_so_far

_POINTS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")
_FULL_MGAUSS = 900.0
_WITH_BARS = 68
_SCALES_A = (20.0, 50.0, 100.0, 200.0, 500.0)


@dataclass(frozen=True)
class Compasses:
    """What the compasses say.

    Attributes
    ----------
    each
        By number.
    early
        Too little is recorded yet for a verdict against a compass.
    """

    each: tuple[CompassNow, ...]
    early: bool


class LiveTable(Drawn[Compasses]):
    """Field strength and heading of each compass."""

    HELP = """\
**Compasses now.** *Strength*: length of the field, mGauss; on earth 220 … 670, and it must not
change when the throttle does. *Heading*: magnetic, as the compass says with the calibration in
force; *corrected*: with the newest fit. *Fit so far*: what the judge says of the recording as it
is.
"""

    def show(self, live: LiveSnapshot) -> None:
        """Draw every compass that reports."""
        self.draw_data(Compasses(live.compasses, live.early))

    def picture(self, data: Compasses, width: int, height: int) -> Content:  # noqa: ARG002
        """A line a compass."""
        length = min(width - 62, 60) if width >= _WITH_BARS else 0
        head = f"  compass  strength {'':{length}}   heading   corrected  fit so far"
        lines = [Content.styled(head, "$quiet")]
        lines += [self._row(compass, length, early=data.early) for compass in data.each]
        if not data.each:
            lines.append(Content("  no compass reports yet"))
        return Content("\n").join(lines)

    def _row(self, compass: CompassNow, width: int, *, early: bool) -> Content:
        mark = " " if compass.healthy else "!"
        style = "$primary" if compass.healthy else "$error"
        return Content.assemble(
            f" {mark}   {compass.number}     {compass.strength:5.0f} mG ",
            bar(compass.strength / _FULL_MGAUSS, width, style=style),
            f"  {direction(compass.heading_deg)}   {direction(compass.heading_corrected_deg)}  ",
            Content("–") if compass.grade is None else grade_so_far(compass.grade, early=early),
        )


@dataclass(frozen=True)
class Control:
    """Throttle and current.

    Attributes
    ----------
    throttle, current
        0 … 1 and amperes; None where not known.
    full
        Amperes of a full bar.
    """

    throttle: float | None
    current: float | None
    full: float


class ControlBars(Drawn[Control]):
    """Throttle and current."""

    HELP = """\
**Throttle and current**: what the motors are told and what they draw. The fit finds how the field
moves with one of them.
"""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self._most = _SCALES_A[0]

    def show(self, live: LiveSnapshot) -> None:
        """Draw; the full length of the current's bar grows with the largest current so far."""
        fits = (scale for scale in _SCALES_A if scale >= max(live.current or 0.0, self._most))
        self._most = next(fits, _SCALES_A[-1])
        self.draw_data(Control(live.throttle, live.current, self._most))

    def picture(self, data: Control, width: int, height: int) -> Content:  # noqa: ARG002
        """Two bars."""
        length = max(width - 31, 8)
        throttle, current = data.throttle or 0.0, data.current or 0.0
        share = current / data.full
        lines = [
            _control(
                "throttle", data.throttle, f"{100 * throttle:3.0f} %", throttle, "100 %", length
            ),
            _control(
                "current", data.current, f"{current:5.1f} A", share, f"{data.full:.0f} A", length
            ),
        ]
        return Content("\n").join(lines)


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
