"""Draws the whole road of `magcomp tui` as one picture that steps from screen to screen.

    python docs/road.py [FOLDER]

Takes about three minutes, because a simulated vehicle flies twice; see examples/whole_road.py.
"""

from __future__ import annotations

import itertools
import re
import sys
from io import StringIO
from pathlib import Path

from rich.console import Console
from rich.style import Style
from rich.terminal_theme import MONOKAI
from rich.text import Text

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))

from whole_road import Terminal, drive

STEP_S = 4
OPTIONS = ("--speed", "4", "--seed", "1")
_FONTS = re.compile(r"@font-face \{.*?\}\s*", re.DOTALL)

Cell = tuple[str, Style]


def _style(cell: object) -> Style:
    """What a cell of the emulator looks like."""
    colours = []
    for name in ("fg", "bg"):
        value = getattr(cell, name)
        named = value if value != "default" else None
        is_hex = named is not None and re.fullmatch(r"[0-9a-f]{6}", named)
        colours.append(f"#{named}" if is_hex else named and named.replace("bright", "bright_"))
    fore, back = ("yellow" if colour == "brown" else colour for colour in colours)
    return Style(
        color=fore,
        bgcolor=back,
        bold=getattr(cell, "bold"),  # noqa: B009 - pyte has no types
        reverse=getattr(cell, "reverse"),  # noqa: B009
    )


def screen_of(terminal: Terminal) -> Text:
    """What a terminal shows, with its colours."""
    screen = terminal.screen
    rows = []
    for line in range(screen.lines):
        cells = [screen.buffer[line][column] for column in range(screen.columns)]
        styled = ((cell.data or " ", _style(cell)) for cell in cells)
        runs = itertools.groupby(styled, key=lambda cell: cell[1])
        rows.append(Text.assemble(*(("".join(c for c, _ in run), style) for style, run in runs)))
    return Text("\n").join(rows)


def picture(number: int, title: str, screen: Text, columns: int) -> str:
    """One screen as SVG, without the fonts that all would bring along."""
    console = Console(record=True, width=columns, file=StringIO(), force_terminal=True)
    console.print(screen)
    drawn = console.export_svg(title=f"magcomp tui: {title}", theme=MONOKAI, unique_id=f"r{number}")
    return _FONTS.sub("", drawn)


def film(pictures: list[str]) -> str:
    """The pictures one after the other, for ever; the last one alone where nothing may move."""
    box = pictures[0].partition('viewBox="')[2].partition('"')[0]
    share = 100 / len(pictures)
    steps = "\n".join(
        f'<g class="step" style="animation-delay: {STEP_S * number}s">{each}</g>'
        for number, each in enumerate(pictures)
    )
    return f"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}">
<style>
.step {{ visibility: hidden; animation: step {STEP_S * len(pictures)}s steps(1) infinite; }}
@keyframes step {{ 0% {{ visibility: visible; }} {share:.3f}% {{ visibility: hidden; }} }}
@media (prefers-reduced-motion) {{
  .step {{ animation: none; }}
  .step:last-of-type {{ visibility: visible; }}
}}
</style>
{steps}
</svg>
"""


def main(folder: Path) -> None:
    """Drive, and draw what is seen; leaving shows nothing worth a picture."""
    pictures: list[str] = []

    def keep(title: str, terminal: Terminal) -> None:
        sys.stderr.write(f"{title}\n")
        if not title.startswith("Left"):
            screen = screen_of(terminal)
            pictures.append(picture(len(pictures), title, screen, terminal.screen.columns))

    drive(OPTIONS, keep)
    (folder / "road.svg").write_text(film(pictures), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
