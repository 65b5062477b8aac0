"""Parts of a text that are drawn for the width they get."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult


@dataclass(frozen=True)
class ByWidth:
    """A part that is made when its width is known; ``make`` takes the columns there are."""

    make: Callable[[int], Iterable[RenderableType]]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """What Rich calls to draw it."""
        yield from self.make(options.max_width)
