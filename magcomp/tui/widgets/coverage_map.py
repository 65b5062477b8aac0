"""Attitudes seen, as a map of the sphere that fills as the vehicle turns."""

from __future__ import annotations

import numpy as np
from textual.content import Content
from textual.widgets import Static

from magcomp.buffer import BANDS, LEVELS, SECTORS, Coverage
from magcomp.live.guide import LEVEL_ENOUGH
from magcomp.tui.widgets.bars import bar

_MANY = 20
_NAMES = 6
_SIGNS = (("·", "$quiet"), ("▒", "$warning"), ("█", "$success"))
_BAND_NAMES = ("up", "", "", "", "", "down")


class CoverageMap(Static):
    """Where the earth's field has pointed, as the vehicle sees it."""

    HELP = """\
**Attitudes seen.** The earth's field comes from one direction; as the vehicle turns, it comes from
all around it. Each cell is one direction as seen from the vehicle: `··` not seen yet, `▒▒` a
little, `██` enough. A level turn fills one row; tilting fills the others.
"""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self._shown: object = None

    def show(self, coverage: Coverage) -> None:
        """Draw all levels together; nothing happens where no cell changed."""
        seen = coverage.counts.sum(axis=0)
        grade = ((seen > 0).astype(np.int8) + (seen >= _MANY)).reshape(BANDS, SECTORS)
        wide = min(max((self.size.width - _NAMES) // SECTORS, 2), 4)
        high = min(max((self.size.height - 1) // BANDS, 1), 2)
        key = (grade.tobytes(), wide, high)
        if key == self._shown:
            return
        self._shown = key
        signs = [(sign * wide, style) for sign, style in _SIGNS]
        lines = []
        for name, row in zip(_BAND_NAMES, grade, strict=True):
            cells = [signs[value] for value in row.tolist()]
            lines.append(Content.assemble((f"{name:>5} ", "$quiet"), *cells))
            lines += [Content.assemble(" " * _NAMES, *cells)] * (high - 1)
        sides = "".join(f"{side:<{3 * wide}}" for side in ("front", "right", "back", "left"))
        foot = f"{'':{_NAMES}}{sides}{100 * float((seen > 0).mean()):3.0f} %"
        content = Content("\n").join([*lines, Content.styled(foot, "$quiet")])
        self.update(content, layout=False)


class LevelTable(Static):
    """Which control levels are done: seconds and attitudes at each tenth of throttle."""

    HELP = """\
**Throttle levels.** The shift is seen only at throttles that were held. For each tenth of the
throttle: how long it was held, and the share of attitudes seen there. *done* means enough turns at
this throttle for an ellipsoid of its own; a flight does not need that.
"""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self._shown: object = None

    def show(
        self, coverage: Coverage, seconds: tuple[float, ...], done: tuple[int, ...], now: int | None
    ) -> None:
        """Draw the levels that were held; nothing happens where nothing changed."""
        fractions = coverage.fraction
        rows = tuple(
            (level, round(seconds[level]), round(16 * float(fractions[level])), level in done)
            for level in range(LEVELS)
            if seconds[level] >= 0.5 or level == now or self.size.height > LEVELS
        )
        width = min(max(self.size.width - 28, 8), 24)
        if (rows, now, width) == self._shown:
            return
        self._shown = (rows, now, width)
        lines = [Content.styled(" throttle      held  turned", "$quiet")]
        for level, held, sixteenths, is_done in rows:
            pointer = "▸" if level == now else " "
            word = "done" if is_done else ""
            lines.append(
                Content.assemble(
                    f"{pointer}{10 * level:3d}–{10 * level + 10:3d} % {held:4d} s ",
                    bar(sixteenths / 16 / LEVEL_ENOUGH, width, style="$success"),
                    f" {word}",
                )
            )
        if not rows:
            lines.append(Content.styled(" none yet", "$quiet"))
        self.update(Content("\n").join(lines), layout=False)
