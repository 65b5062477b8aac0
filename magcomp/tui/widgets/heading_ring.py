"""The headings flown, as a ring that fills as the vehicle turns."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

from textual.content import Content

from magcomp.live.progress import HEADINGS
from magcomp.live.snapshot import LiveSnapshot
from magcomp.tui.widgets.drawn import Drawn

_NEARLY = 0.8
"""Share of the largest throttle from which a heading counts as seen under load."""

_NEEDLE = (0.25, 0.45, 0.65)
_EIGHTHS = "▁▂▃▄▅▆▇█"
_APART = 3
"""Cells from one pair of digits to the next at which the two can be told apart."""

WANTED = "◇"
"""Marks where to turn next."""


@dataclass(frozen=True)
class Ring:
    """What a ring shows.

    Attributes
    ----------
    best
        Largest throttle in each sector, whole per cent; None where it was never headed.
    heading
        Whole degrees now; None where not known.
    wanted
        Sector to turn to; None where all were seen.
    """

    best: tuple[int | None, ...]
    heading: int | None
    wanted: int | None


class HeadingRing(Drawn[Ring]):
    """A cell a sector of 15°, north on top; a needle for now."""

    HELP = """\
**Headings seen.** North is on top. Each pair of digits is the largest throttle, in per cent, at
which the vehicle was heading there; a small ring has a bar instead, from `▁` to `█` for the largest
throttle of all. `·` was not seen yet. The needle is the heading now, and `◇` is where to turn next.
A flight is enough when the ring is full and climbs and descents are in it.
"""

    def show(self, live: LiveSnapshot) -> None:
        """Draw the headings of a snapshot."""
        yaw = None if live.attitude_deg is None else live.attitude_deg[2]
        self.draw_data(
            Ring(
                tuple(None if math.isnan(b) else round(100 * b) for b in live.headings),
                None if yaw is None else round(yaw) % 360,
                None if live.wanted_heading_deg is None else _sector(live.wanted_heading_deg),
            )
        )

    def picture(self, data: Ring, width: int, height: int) -> Content:
        """A ring as large as the room allows."""
        up = max((height - 1) // 2, 1)
        across = max(min((width - 3) // 2, 3 * up), 4)
        canvas = _Canvas(width, height)
        canvas.put(0.0, -(up - 1), "N", "$quiet")
        if data.heading is not None:
            angle = math.radians(data.heading)
            for share in _NEEDLE:
                x, y = share * across * math.sin(angle), -share * up * math.cos(angle)
                canvas.put(x, y, "•", "bold $accent")
        most = max((best for best in data.best if best is not None), default=0)
        here = None if data.heading is None else _sector(data.heading)
        angles = [(sector + 0.5) * math.tau / HEADINGS for sector in range(HEADINGS)]
        places = [(across * math.sin(a), _off_axis(-up * math.cos(a))) for a in angles]
        cells = 2 if _have_room(places) else 1
        for sector, (best, place) in enumerate(zip(data.best, places, strict=True)):
            text, style = _cell(best, most, cells)
            if sector == data.wanted:
                text, style = cells * WANTED, "bold $accent"
            if sector == here:
                style = f"{style} reverse"
            canvas.put(*place, text, style)
        text = "–" if data.heading is None else f"{data.heading}°"
        canvas.put(-0.5 * (len(text) - 1), 0.0, text, "bold")
        return canvas.content()


class _Canvas:
    """Cells to write on, from the middle."""

    def __init__(self, width: int, height: int) -> None:
        self._cells = [[(" ", "")] * width for _ in range(max(height, 1))]
        self._x, self._y = width // 2 - 1, (max(height, 1) - 1) // 2

    def put(self, x: float, y: float, text: str, style: str) -> None:
        """Write a text that begins so far right of and below the middle."""
        row, column = self._y + round(y), self._x + round(x)
        for index, sign in enumerate(text, start=column):
            if 0 <= row < len(self._cells) and 0 <= index < len(self._cells[row]):
                self._cells[row][index] = (sign, style)

    def content(self) -> Content:
        """All of it."""
        return Content("\n").join(Content.assemble(*_runs(row)) for row in self._cells)


def _runs(row: list[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Neighbours of one style as one text: a ring is drawn ten times a second."""
    for style, cells in itertools.groupby(row, key=lambda cell: cell[1]):
        yield "".join(sign for sign, _ in cells), style


def _off_axis(y: float) -> float:
    """Not on the line through the middle, where a flat ring's neighbours would share a cell."""
    return math.copysign(max(abs(y), 0.51), y)


def _have_room(places: list[tuple[float, float]]) -> bool:
    """Whether two digits at each place stay apart from the next."""
    cells = sorted((round(y), round(x)) for x, y in places)
    return all(
        other - one >= _APART
        for (row, one), (other_row, other) in itertools.pairwise(cells)
        if row == other_row
    )


def _cell(best: int | None, most: int, cells: int) -> tuple[str, str]:
    if best is None:
        return cells * "·", "$quiet"
    share = best / max(most, 1)
    text = f"{min(best, 99):2d}" if cells == 2 else _EIGHTHS[max(math.ceil(8 * share), 1) - 1]
    return text, "$success" if share >= _NEARLY else "$warning"


def _sector(degrees: float) -> int:
    return int(degrees % 360.0 * HEADINGS / 360.0) % HEADINGS
