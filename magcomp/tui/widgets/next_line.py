"""The one line that says what to do next."""

from __future__ import annotations

import textwrap

from textual.content import Content
from textual.widgets import Static

_TITLE = " Next "
_NARROWEST = 20


class NextLine(Static):
    """What to do next, in one sentence, above the keys."""

    def __init__(self) -> None:
        super().__init__()
        self._shown = ""

    def say(self, sentence: str) -> None:
        """Show a sentence; nothing happens where it is shown already."""
        if sentence != self._shown:
            self._shown = sentence
            self._draw()

    def on_resize(self) -> None:
        """Break the sentence anew."""
        self._draw()

    def _draw(self) -> None:
        """Draw it, its further lines below the first one's words."""
        indent = len(_TITLE) + 1
        room = (self.size.width or self.app.size.width) - indent
        lines = textwrap.wrap(self._shown, max(room, _NARROWEST))
        text = f"\n{' ' * indent}".join(lines)
        self.update(Content.assemble((_TITLE, "bold reverse"), f" {text}"))

    @property
    def sentence(self) -> str:
        """What is shown."""
        return self._shown
