"""What the five screens of the road have in common: frame, keys, and how they are drawn."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from typing import ClassVar

from textual.app import ComposeResult
from textual.css.query import NoMatches
from textual.screen import Screen
from textual.widget import Widget

from magcomp.tui import status
from magcomp.tui.messages import StateWanted
from magcomp.tui.state import State
from magcomp.tui.widgets.key_bar import KeyBar
from magcomp.tui.widgets.next_line import NextLine
from magcomp.tui.widgets.top_bar import TopBar


class StepScreen(Screen[None]):
    """A step of the road.

    A subclass names its ``STEP``, gives its ``body`` and draws ``state`` in ``draw``. What the
    pilot wants is posted; the app does it and shows the new state. Nothing is drawn while another
    step is on the screen.
    """

    STEP: ClassVar[str]
    HELP: ClassVar[str | None] = None
    HORIZONTAL_BREAKPOINTS = [(0, "-slim"), (72, "-narrow"), (110, "-wide")]  # noqa: RUF012 - as in Screen
    VERTICAL_BREAKPOINTS = [(0, "-low"), (24, "-short"), (32, "-tall")]  # noqa: RUF012
    AUTO_FOCUS = ""  # what has the focus follows from the state, not from what is mounted first

    def __init__(self) -> None:
        super().__init__()
        self.state = State()
        self._bindings_drawn: object = None

    def compose(self) -> ComposeResult:
        """Frame and body."""
        yield TopBar(self.STEP)
        yield from self.body()
        yield NextLine()
        yield KeyBar()

    def body(self) -> Iterable[Widget]:
        """What stands between the top bar and the next line."""
        raise NotImplementedError

    def draw(self) -> None:
        """Draw the state as it is now."""
        raise NotImplementedError

    def say(self, sentence: str) -> None:
        """Show what to do next."""
        self.query_one(NextLine).say(sentence)

    def show(self, state: State) -> None:
        """Draw a new state."""
        self.state = state
        self.redraw()

    def redraw(self) -> None:
        """Draw, if this screen is there to be drawn on."""
        if not (self.is_mounted and self.is_attached):
            return
        # While the app closes, the parts of a screen go before the screen does.
        with suppress(NoMatches):
            work, live = self.state.work, self.state.live
            done = status.steps_done(work, live)
            self.query_one(TopBar).show(done, status.status(work, live))
            self.draw()
        self._show_keys()

    def _show_keys(self) -> None:
        """Look for the keys anew, but only where they may differ: it is not cheap."""
        work, writing = self.state.work, self.state.writing
        grade = None if work.analysis is None else work.analysis.grade
        bindings = work.source, work.live, bool(writing.in_force), grade, len(work.tried)
        if bindings != self._bindings_drawn:
            self._bindings_drawn = bindings
            self.refresh_bindings()

    def on_resize(self) -> None:
        """Draw what depends on the room there is; some keys do."""
        self._bindings_drawn = None
        self.redraw()

    def on_screen_resume(self) -> None:
        """Draw what changed meanwhile."""
        self.post_message(StateWanted())
