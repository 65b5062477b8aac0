"""The screen while motors spin on the ground: what was done, and that any key stops."""

from __future__ import annotations

import threading
import time

from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widgets import Button, Static

from magcomp.report import words
from magcomp.sweeping.events import Begun, Event, Stopping, Told
from magcomp.tui.screens.dialogs import Dialog

_LINES = 12
_ALIVE_S = 0.2


class Sweeping(Dialog[None]):
    """Lies over everything until all motors stand still. Each key stops, whatever it is.

    Attributes
    ----------
    stop
        Set by a key or the button.
    """

    def __init__(self) -> None:
        super().__init__()
        self.stop = threading.Event()
        self._alive_at = time.monotonic()
        self._lines: list[str] = []
        self._now = "waiting for the vehicle to stand still"

    def compose(self) -> ComposeResult:
        """What was done, what is done now, and the button."""
        with Vertical(classes="dialog") as dialog:
            dialog.border_title = "The motors spin"
            with VerticalScroll(classes="sentence", can_focus=False):
                yield Static(id="steps", markup=False)
            yield Static("Any key stops at once.", classes="step")
            with Horizontal(classes="buttons"):
                yield Button("Any key  Stop", variant="error", id="stop")

    def on_mount(self) -> None:
        """Say what is waited for."""
        self._draw()
        self.set_interval(_ALIVE_S, self._live)

    @property
    def silent_s(self) -> float:
        """Seconds since the screen was last able to take a key; may be asked by any thread."""
        return time.monotonic() - self._alive_at

    def _live(self) -> None:
        self._alive_at = time.monotonic()

    def tell(self, event: Event) -> None:
        """Show what happened."""
        match event:
            case Begun(step=step, number=number):
                self._now = f"step {number}: {words.sweep_step(step)}"
            case Told(measured=measured):
                drawn = f"{measured.current:.1f} A"
                self._lines.append(f"{words.sweep_step(measured.step)}: {drawn}")
                self._now = "all motors stand still"
            case Stopping(why=why):
                self._now = f"stopping because {why}"
            case _:
                self._now = "all motors were told to stand still"
        self._draw()

    def on_button_pressed(self) -> None:
        """Stop."""
        self.stop.set()

    def _draw(self) -> None:
        lines = [*self._lines[-_LINES:], words.sentence(self._now)]
        self.query_one("#steps", Static).update("\n".join(lines))
