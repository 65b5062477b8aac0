"""Verify: headings before and after the correction side by side, while the throttle changes."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.containers import Container, Vertical
from textual.content import Content
from textual.widget import Widget
from textual.widgets import Static

from magcomp.live.situation import Situation
from magcomp.report import words
from magcomp.tui.before_after import HeadingPair, HeadingWatch, heading_pairs
from magcomp.tui.screens.step import StepScreen
from magcomp.tui.state import State
from magcomp.tui.widgets.heading_pairs import HeadingPairs, HeadingPlot
from magcomp.tui.widgets.live_table import ControlBars
from magcomp.tui.work import Writing

_PLOT_EVERY_S = 0.5
_MARKED_LINES = 3
_EDGES = 2
_LEAST_PLOT = 9
"""Lines: of a compass with a mark, of a panel's border, of a plot worth its room."""


class VerifyScreen(StepScreen):
    """The fifth step."""

    STEP = "verify"
    HELP = HeadingPairs.HELP
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("1", "compass(1)", "Plot", id="compass.1", key_display="1-3"),
        Binding("2", "compass(2)", "Compass 2", id="compass.2", show=False),
        Binding("3", "compass(3)", "Compass 3", id="compass.3", show=False),
        Binding("m", "mark", "Mark heading", id="verify.mark"),
        Binding("f", "app.fly_again", "Fly again", id="verify.fly"),
        Binding("u", "app.undo", "Undo writing", id="review.undo"),
        Binding("b", "app.backward", "Back", id="go.back"),
        Binding("x", "app.disconnect", "Disconnect", id="connect.close"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._watch = HeadingWatch()
        self._pairs: tuple[HeadingPair, ...] = ()
        self._said = ""
        self._compass = 1
        self._plotted_at = -_PLOT_EVERY_S
        self._looks = (False, 0, False)

    def body(self) -> Iterable[Widget]:
        """Motors above, headings below."""
        with Vertical(classes="body"):
            with Container(id="controls", classes="panel"):
                yield ControlBars(id="control")
            with Container(id="pairs", classes="panel"):
                yield HeadingPairs(id="headings")
            with Container(id="trace", classes="panel"):
                yield HeadingPlot(id="trace-plot")
            yield Static(id="held-now")

    def on_mount(self) -> None:
        """Name the panels."""
        self.query_one("#controls").border_title = "Motors"
        self.query_one("#pairs").border_title = "Heading before and after the correction"
        self._name_plot()

    def draw(self) -> None:
        """Draw the newest headings."""
        state = self.state
        if state.live is None:
            self.say("Connect to a vehicle first.")
            return
        now = state.live.elapsed_s
        if state.live.situation is Situation.FLYING:
            self._watch.unmark()
        self._pairs = self._watch.look(heading_pairs(state.live, state.work, state.writing), now)
        self.query_one(ControlBars).show(state.live)
        self.query_one(HeadingPairs).show(self._pairs, marked=self._watch.marked)
        self._show_state()
        self._make_room()
        if abs(now - self._plotted_at) >= _PLOT_EVERY_S and self.has_class("-plot"):
            self._plotted_at = now
            trace = self._watch.trace(self._compass)
            self.query_one(HeadingPlot).show(trace, marked=self._watch.marked)
        self.say(state.busy.sentence if state.busy is not None else self._next())

    def _make_room(self) -> None:
        """Give the headings the lines they need, and the rest to the plot where that is enough."""
        lines = 1 + len(self._pairs) * (_MARKED_LINES if self._watch.marked else 1) + _EDGES
        width = max(self.size.width - 2, 1)
        said = sum(len(textwrap.wrap(line, width)) for line in self._said.split("\n"))
        controls = 4 if self.has_class("-tall") else 2
        room = self.query_one(".body").size.height - controls - said - lines
        plot = room >= _LEAST_PLOT
        looks = (plot, lines, self._watch.marked)
        if looks != self._looks:
            self._looks = looks
            self.set_class(plot, "-plot")
            self.query_one("#pairs").styles.height = lines if plot else "1fr"
            self._name_plot()
            self.refresh_bindings()

    def _show_state(self) -> None:
        said = "\n".join(state_lines(self.state))
        if said != self._said:
            self._said = said
            self.query_one("#held-now", Static).update(Content(said))

    def _next(self) -> str:
        live, writing = self.state.live, self.state.writing
        if live is not None and not live.connected:
            return "The link is lost: stay here, it goes on when the link is back."
        if live is not None and live.armed and live.situation is Situation.FLYING:
            return "Hold a heading, climb and descend: “takes out” grows with the throttle."
        if writing.measured:
            return "Done: Q ends and says where your files are. Fly on to measure again."
        if self._watch.marked:
            after = "Q ends." if writing.in_force else "B goes back to write."
            return f"With the motors “before” moves, “corrected” stays. {after}"
        if writing.in_force:
            return "Fly as before and land: it is then measured. On the ground: M, see F1."
        return "Propellers off or tied down: press M, run the motors, watch “moved”."

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:  # noqa: ARG002
        """Hide the choice of a plot where there is none, and a mark that the next turn spoils."""
        live = self.state.live
        flying = live is not None and live.situation is Situation.FLYING
        shown = {"compass": self.has_class("-plot"), "mark": not flying}
        return shown.get(action, True)

    def action_compass(self, compass: int) -> None:
        """Plot another compass."""
        self._compass = compass
        self._name_plot()

    def _name_plot(self) -> None:
        plot = self.query_one("#trace")
        marked = self._watch.marked
        what = "heading moved since the mark" if marked else "what the correction takes out"
        plot.border_title = f"Compass {self._compass}: {what}, °"
        plot.border_subtitle = "x before   • corrected" if marked else "a minute, till now"

    def action_mark(self) -> None:
        """Measure from the headings as they are."""
        self._watch.mark(self._pairs)
        self.redraw()


def state_lines(state: State) -> tuple[str, ...]:
    """What is in force, and what the flights since have shown."""
    writing = state.writing
    if writing.measured:
        return tuple(promise.sentence for promise in writing.measured)
    if writing.measured_trouble:
        return (writing.measured_trouble,)
    if writing.in_force:
        return _in_force_lines(writing)
    if writing.undone and writing.result:
        return (words.sentence(writing.result),)
    if state.work.analysis is not None:
        return ("Nothing is written yet; “corrected” is worked out from the fit.",)
    return ("Nothing is fitted yet, so there is nothing to compare.",)


def _in_force_lines(writing: Writing) -> tuple[str, ...]:
    if writing.acts:
        return (words.sentence(writing.acts), "“Before” is worked out from the backup.")
    return ("The new parameters are in force; “before” is worked out from the backup.",)
