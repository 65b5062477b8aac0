"""Record: what the vehicle says now, what has been seen, and what to do next."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.containers import Container, Horizontal, Vertical
from textual.content import Content
from textual.widget import Widget
from textual.widgets import Static

from magcomp.buffer import LEVELS
from magcomp.live.situation import Manoeuvre, Situation
from magcomp.live.snapshot import LiveSnapshot
from magcomp.report import words
from magcomp.tui.screens.step import StepScreen
from magcomp.tui.widgets.coverage_map import CoverageMap, LevelTable
from magcomp.tui.widgets.heading_ring import WANTED, HeadingRing
from magcomp.tui.widgets.live_facts import LiveFacts, bound_words
from magcomp.tui.widgets.live_table import ControlBars, LiveTable

_SAID = {
    Manoeuvre.FLIGHT: "Taken as flown.",
    Manoeuvre.STAND: "Taken as held on a stand.",
    Manoeuvre.SWEEP: "Taken as tied down.",
}

_MIND = "Mind: "
_FEW = 2
_MANY = 6


class RecordScreen(StepScreen):
    """The second step."""

    STEP = "record"
    HELP = """\
**Recording.** Everything the vehicle says is written to the file as it arrives. Do what the *next*
line says; it speaks of throttle only while the vehicle is held or tied down. When it says that it
is enough, press N. G sweeps a vehicle that stands on the ground: its motors spin, one by one and
together, once you have typed its name. You can fit at any time and come back: the recording goes
on.

Whether the vehicle is flown, turned on a stand or tied down is found out. Where that goes wrong,
press M to say it, once or more, until the *next* line names it.
"""
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("n", "app.forward", "Fit", id="go.next"),
        Binding("m", "app.manoeuvre", "How", id="record.manoeuvre"),
        Binding("b", "app.backward", "Back", id="go.back"),
        Binding("g", "app.sweep", "Sweep", id="record.sweep"),
        Binding("x", "app.disconnect", "Disconnect", id="connect.close"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._mind = ""

    def body(self) -> Iterable[Widget]:
        """Compasses above, control, coverage and levels below."""
        with Vertical(classes="body"):
            with Container(id="now", classes="panel"):
                yield LiveTable(id="compasses")
            with Horizontal(id="middle"):
                with Container(id="turned", classes="panel"):
                    yield HeadingRing(id="ring")
                with Container(id="seen", classes="panel"):
                    yield CoverageMap(id="map")
                with Container(id="held", classes="panel"):
                    yield LevelTable(id="levels")
            with Container(id="controls", classes="panel"):
                yield ControlBars(id="control")
            yield LiveFacts(id="facts")
            yield Static(id="mind")

    def on_mount(self) -> None:
        """Name the panels."""
        self.query_one("#turned").border_title = "Headings, throttle"
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
        self.set_class(live.situation in (Situation.HELD, Situation.STILL), "-held")
        now_panel = self.query_one("#now")
        now_panel.border_title = _compasses_title(live, now_panel.size.width - 2)
        wanted = live.wanted_heading_deg
        self.query_one("#turned").border_subtitle = (
            "all seen" if wanted is None else f"{WANTED} next, {round(wanted) % 360}°"
        )
        self.query_one(LiveTable).show(live)
        self.query_one(ControlBars).show(live)
        self.query_one(HeadingRing).show(live)
        self.query_one(CoverageMap).show(live.coverage)
        share = (live.coverage.counts.sum(axis=0) > 0).mean()
        self.query_one("#seen").border_subtitle = f"{100 * share:.0f} % seen"
        now = None if live.throttle is None else min(int(live.throttle * LEVELS), LEVELS - 1)
        level_table = self.query_one(LevelTable)
        level_table.show(live.coverage, live.level_seconds, live.levels_done, now)
        self.query_one(LiveFacts).show(live)
        self._show_mind(live)
        self.say(busy.sentence if busy is not None else next_sentence(live, self.state.manoeuvre))

    def _show_mind(self, live: LiveSnapshot) -> None:
        room = _MANY if self.has_class("-tall") else _FEW
        mind = mind_text(live.warnings, self.size.width - 2, room)
        if mind.plain != self._mind:
            self._mind = mind.plain
            self.query_one("#mind", Static).update(mind)


def mind_text(warnings: Sequence[str], width: int, lines: int) -> Content:
    """What a pilot should know, in so many lines; what does not fit ends in a sign for that."""
    told: list[Content] = []
    for warning in warnings:
        text = f"{_MIND}{words.sentence(warning)}"
        wrapped = textwrap.wrap(text, width, max_lines=lines - len(told), placeholder=" …")
        first, *others = map(Content, wrapped)
        told += [first.stylize("bold $warning", 0, len(_MIND)), *others]
        if len(told) >= lines:
            break
    return Content("\n").join(told)


def _compasses_title(live: LiveSnapshot, room: int) -> str:
    """The bound stands above everything: it is what the recording is for."""
    title = "Compasses" if live.connected else "Compasses, as last heard"
    return ": ".join(filter(None, (title, bound_words(live, room - len(title) - 2))))


def next_sentence(live: LiveSnapshot, manoeuvre: Manoeuvre | None = None) -> str:
    """What to do next, and what the user said it rests on; a lost link comes before everything."""
    if not live.connected:
        return "The link is lost: stay here, it goes on when the link is back."
    said = "" if manoeuvre is None else f"{_SAID[manoeuvre]} "
    if live.guidance.enough:
        return f"{said}{words.sentence(live.guidance.text)} Then press N."
    return f"{said}{words.sentence(live.guidance.text)}"
