"""A screen for a terminal without Unicode."""

from __future__ import annotations

from rich.segment import Segment
from textual.color import Color
from textual.filter import LineFilter

from magcomp.report.ascii import plain


class AsciiFilter(LineFilter):
    """Draws every line in ASCII."""

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:  # noqa: ARG002
        """The same segments in ASCII, as wide as they were."""
        return [Segment(plain(text), style, control) for text, style, control in segments]
