"""The two lines at the top: where the pilot is on the road, and what is connected."""

from __future__ import annotations

from dataclasses import dataclass

from textual.app import ComposeResult
from textual.containers import Vertical
from textual.content import Content
from textual.widgets import Static

STEPS = {
    "connect": "Connect",
    "record": "Record",
    "fit": "Fit",
    "review": "Write",
    "verify": "Verify",
}
"""Screens of the road, in order, and what they are called."""


@dataclass(frozen=True)
class Status:
    """The second line.

    Attributes
    ----------
    left
        The vehicle or log.
    right
        The link.
    alarm
        The link is lost: ``right`` must be seen from afar.
    """

    left: str = ""
    right: str = ""
    alarm: bool = False


class TopBar(Vertical):
    """Steps and status.

    Parameters
    ----------
    step
        The screen this bar stands on; a key of `STEPS`.
    """

    def __init__(self, step: str) -> None:
        super().__init__()
        self._step = step
        self._shown: tuple[frozenset[str], Status] | None = None

    def compose(self) -> ComposeResult:
        """The two lines."""
        yield Static(id="steps")
        yield Static(id="status")

    def show(self, done: frozenset[str], status: Status) -> None:
        """Draw; nothing happens where nothing changed."""
        if (done, status) == self._shown:
            return
        self._shown = (done, status)
        self.query_one("#steps", Static).update(self._steps(done))
        self.query_one("#status", Static).update(self._status(status))

    def _steps(self, done: frozenset[str]) -> Content:
        parts = [Content.styled(" magcomp ", "bold")]
        for name, title in STEPS.items():
            parts.append(Content.styled(" › " if name != "connect" else "  ", "$quiet"))
            here = name == self._step
            mark = "✓ " if name in done and not here else ""
            text = f" {title} " if here else f"{mark}{title}"
            style = "bold reverse" if here else ""
            parts.append(Content.styled(text, f"{style} @click=app.go('{name}')".strip()))
        return Content.assemble(*parts)

    def _status(self, status: Status) -> Content:
        left = Content(f" {status.left}")
        if not status.right:
            return left
        right = Content.styled(
            f" {status.right} ", "bold reverse $error" if status.alarm else "$foreground"
        )
        room = self.size.width - left.cell_length - right.cell_length
        if room < 1:
            left = left.truncate(max(self.size.width - right.cell_length - 1, 0), ellipsis=True)
            room = 1
        return Content.assemble(left, " " * max(room, 1), right)

    def on_resize(self) -> None:
        """Lay the second line out anew."""
        if self._shown is not None:
            self.query_one("#status", Static).update(self._status(self._shown[1]))
