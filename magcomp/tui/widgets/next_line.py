"""The one line that says what to do next."""

from __future__ import annotations

from textual.content import Content
from textual.widgets import Static


class NextLine(Static):
    """What to do next, in one sentence, above the keys."""

    def __init__(self) -> None:
        super().__init__()
        self._shown = ""

    def say(self, sentence: str) -> None:
        """Show a sentence; nothing happens where it is shown already."""
        if sentence != self._shown:
            self._shown = sentence
            self.update(Content.assemble((" Next ", "bold reverse"), f" {sentence}"))

    @property
    def sentence(self) -> str:
        """What is shown."""
        return self._shown
