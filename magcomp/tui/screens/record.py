"""Record: what the vehicle says now, what has been seen, and what to do next."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.containers import Container, Horizontal, Vertical
from textual.content import Content
from textual.widget import Widget
from textual.widgets import Static

from magcomp.buffer import LEVELS
from magcomp.live.snapshot import LiveSnapshot
from magcomp.report import words
from magcomp.tui.screens.step import StepScreen
from magcomp.tui.widgets.bars import bar
from magcomp.tui.widgets.coverage_map import CoverageMap, LevelTable
from magcomp.tui.widgets.live_table import ControlBars, LiveTable

_FIELD_MESSAGES = ("RAW_IMU", "SCALED_IMU2", "SCALED_IMU3")
_FEW = 2
_MANY = 6


class RecordScreen(StepScreen):
    """The second step."""

    STEP = "record"
    HELP = """\
**Recording.** Everything the vehicle says is written to the file as it arrives. Do what the *next*
line says; it speaks of throttle only while the vehicle is held or tied down. When it says that it
is enough, press N. You can fit at any time and come back: the recording goes on.
"""
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("n", "app.forward", "Fit", id="go.next"),
        Binding("b", "app.backward", "Back", id="go.back"),
        Binding("x", "app.disconnect", "Disconnect", id="connect.close"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._facts = ""
        self._mind = ""

    def body(self) -> Iterable[Widget]:
        """Compasses above, control, coverage and levels below."""
        with Vertical(classes="body"):
            with Container(id="now", classes="panel"):
                yield LiveTable(id="compasses")
            with Horizontal(id="middle"):
                with Container(id="seen", classes="panel"):
                    yield CoverageMap(id="map")
                with Container(id="held", classes="panel"):
                    yield LevelTable(id="levels")
            with Container(id="controls", classes="panel"):
                yield ControlBars(id="control")
            yield Static(id="facts")
            yield Static(id="mind")

    def on_mount(self) -> None:
        """Name the panels."""
        self.query_one("#now").border_title = "Compasses"
        self.query_one("#seen").border_title = "Attitudes seen"
        self.query_one("#held").border_title = "Throttle levels"
        self.query_one("#controls").border_title = "Motors"

    def draw(self) -> None:
        """Draw the newest snapshot."""
        live, busy = self.state.live, self.state.busy
        if live is None:
            self.say("Connect to a vehicle first: press B.")
            return
        self.set_class(not live.connected, "-stale")
        self.query_one("#now").border_title = (
            "Compasses" if live.connected else "Compasses, as last heard"
        )
        self.query_one(LiveTable).show(live)
        self.query_one(ControlBars).show(live)
        self.query_one(CoverageMap).show(live.coverage)
        now = None if live.throttle is None else min(int(live.throttle * LEVELS), LEVELS - 1)
        level_table = self.query_one(LevelTable)
        level_table.show(live.coverage, live.level_seconds, live.levels_done, now)
        self._show_facts(live)
        self.say(busy.sentence if busy is not None else next_sentence(live))

    def _show_facts(self, live: LiveSnapshot) -> None:
        facts = facts_line(live)
        if facts.plain != self._facts:
            self._facts = facts.plain
            self.query_one("#facts", Static).update(facts, layout=False)
        room = _MANY if self.has_class("-tall") else _FEW
        mind = Content("\n").join(
            Content.assemble((" Mind: ", "bold $warning"), words.sentence(text))
            for text in live.warnings[:room]
        )
        if mind.plain != self._mind:
            self._mind = mind.plain
            self.query_one("#mind", Static).update(mind)


def next_sentence(live: LiveSnapshot) -> str:
    """What to do next; a lost link comes before everything."""
    if not live.connected:
        return "The link is lost: stay here, it goes on when the link is back."
    if live.guidance.enough:
        return f"{words.sentence(live.guidance.text)} Then press N."
    return words.sentence(live.guidance.text)


def facts_line(live: LiveSnapshot) -> Content:
    """How far, how long, where to, and how well it arrives."""
    minutes, seconds = divmod(int(live.recorded_s), 60)
    share = live.guidance.share_done
    field = max((live.link.rates.get(name, 0.0) for name in _FIELD_MESSAGES), default=0.0)
    first = Content.assemble(
        (" enough   ", "$quiet"),
        bar(share, 20, style="$success"),
        f" {100 * share:3.0f} %   time {minutes:02d}:{seconds:02d}",
        f"   compass {field:.0f} Hz   lost {100 * live.link.loss:.0f} %",
    )
    if live.recording_path is None:
        file = "nothing is written to a file"
    else:
        state = "" if live.recording else "stopped: "
        file = f"{state}{live.recording_path.name}  {live.recording_bytes / 1e6:.1f} MB"
    return Content("\n").join([first, Content.assemble((" file     ", "$quiet"), file)])
