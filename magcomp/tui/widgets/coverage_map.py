"""Attitudes seen, as a map of the sphere that fills as the vehicle turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from textual.content import Content

from magcomp.buffer import BANDS, LEVELS, SECTORS, Coverage
from magcomp.live.guide import LEVEL_ENOUGH
from magcomp.tui.widgets.bars import bar
from magcomp.tui.widgets.drawn import Drawn

_MANY = 20
_NAMES = 6
_SIGNS = (("·", "$quiet"), ("▒", "$warning"), ("█", "$success"))
_BAND_NAMES = ("up", "", "", "", "", "down")


@dataclass(frozen=True)
class Seen:
    """Attitudes seen.

    Attributes
    ----------
    grades
        0 not seen, 1 a little, 2 enough, for each band and in it each sector.
    """

    grades: tuple[tuple[int, ...], ...]


class CoverageMap(Drawn[Seen]):
    """Where the earth's field has pointed, as the vehicle sees it."""

    HELP = """\
**Attitudes seen.** The earth's field comes from one direction; as the vehicle turns, it comes from
all around it. Each cell is one direction as seen from the vehicle: `··` not seen yet, `▒▒` a
little, `██` enough. A level turn fills one row; tilting fills the others.
"""

    def show(self, coverage: Coverage) -> None:
        """Draw all levels together."""
        seen = coverage.counts.sum(axis=0)
        grades = ((seen > 0).astype(np.int8) + (seen >= _MANY)).reshape(BANDS, SECTORS)
        self.draw_data(Seen(tuple(map(tuple, grades.tolist()))))

    def picture(self, data: Seen, width: int, height: int) -> Content:
        """A map whose cells grow with the room."""
        wide = min(max((width - _NAMES - 5) // SECTORS, 1), 6)
        high = min(max((height - 1) // BANDS, 1), 4)
        signs = [(sign * wide, style) for sign, style in _SIGNS]
        lines = []
        for name, row in zip(_BAND_NAMES, data.grades, strict=True):
            cells = [signs[value] for value in row]
            lines.append(Content.assemble((f"{name:>5} ", "$quiet"), *cells))
            lines += [Content.assemble(" " * _NAMES, *cells)] * (high - 1)
        names = ("front", "right", "back", "left")
        sides = "".join(f"{side[: 3 * wide - 1]:<{3 * wide}}" for side in names)
        return Content("\n").join([*lines, Content.styled(f"{'':{_NAMES}}{sides}", "$quiet")])


@dataclass(frozen=True)
class LevelRow:
    """One tenth of the throttle.

    Attributes
    ----------
    level
        0 … 9.
    held_s
        Seconds at this throttle, to a tenth.
    sixteenths
        Of the sphere that was seen here.
    done
        Enough turns for an ellipsoid of its own.
    now
        The throttle is here.
    """

    level: int
    held_s: float
    sixteenths: int
    done: bool
    now: bool


class LevelTable(Drawn[tuple[LevelRow, ...]]):
    """Which control levels are done: seconds and attitudes at each tenth of throttle."""

    HELP = """\
**Throttle levels.** The shift is seen only at throttles that were held. For each tenth of the
throttle: how long it was held, and the share of attitudes seen there. *done* means enough turns at
this throttle for an ellipsoid of its own; a flight does not need that.
"""

    def show(
        self, coverage: Coverage, seconds: tuple[float, ...], done: tuple[int, ...], now: int | None
    ) -> None:
        """Draw the levels, those that were held where there is no room for all."""
        fractions = coverage.fraction
        rows = (
            LevelRow(
                level,
                round(seconds[level], 1),
                round(16 * float(fractions[level])),
                level in done,
                level == now,
            )
            for level in range(LEVELS)
        )
        self.draw_data(tuple(rows))

    def picture(self, data: tuple[LevelRow, ...], width: int, height: int) -> Content:
        """A line a level."""
        rows = _in_room(data, height - 1)
        length = min(max(width - 26, 4), 24)
        lines = [Content.styled(" throttle      held  turned", "$quiet")]
        roomy = height > 2 * LEVELS
        for row in rows:
            lines += [Content("")] if roomy else []
            pointer = "▸" if row.now else " "
            span = f"{10 * row.level:3d}–{10 * row.level + 10:3d} %"
            lines.append(
                Content.assemble(
                    f"{pointer}{span} {row.held_s:4.0f} s ",
                    bar(row.sixteenths / 16 / LEVEL_ENOUGH, length, style="$success"),
                    " done" if row.done else "",
                )
            )
        if not rows:
            lines.append(Content.styled(" none yet", "$quiet"))
        return Content("\n").join(lines)


def _in_room(data: Sequence[LevelRow], room: int) -> Sequence[LevelRow]:
    """The levels there is room for: what was held, and of that what lies about the throttle now."""
    if len(data) <= room:
        return data
    rows = [row for row in data if row.held_s >= 0.5 or row.now]
    here = next((index for index, row in enumerate(rows) if row.now), 0)
    first = min(max(here - room // 2, 0), max(len(rows) - room, 0))
    return rows[first : first + max(room, 1)]
