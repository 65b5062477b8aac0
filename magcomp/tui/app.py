"""The app: its keys, its palette, and what it does with each message of the screens.

What the keys start stands in opening.py, fitting.py and writing.py; what lies below in base.py.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

from rich.text import Text
from textual.app import SystemCommand
from textual.binding import Binding, BindingType
from textual.events import Event, Key
from textual.screen import Screen

from magcomp.errors import MagcompError, UsageError
from magcomp.model import Grade
from magcomp.tui import fitting, opening, status, sweeping, verifying, writing
from magcomp.tui.base import BaseApp
from magcomp.tui.choices import SIMULATED
from magcomp.tui.help_text import help_text, key_lines
from magcomp.tui.messages import (
    CompassToggled,
    OptionsChosen,
    PortsWanted,
    SnapshotTaken,
    StateWanted,
    SweepTold,
    TargetChosen,
    TimeRangeWanted,
    WatchingFailed,
)
from magcomp.tui.screens.connect import ConnectScreen
from magcomp.tui.screens.dialogs import Help, Message, Quit
from magcomp.tui.screens.fit import FitScreen
from magcomp.tui.screens.record import RecordScreen
from magcomp.tui.screens.review import ReviewScreen
from magcomp.tui.screens.sweeping import Sweeping
from magcomp.tui.screens.verify import VerifyScreen
from magcomp.tui.settings import Settings, write_template
from magcomp.tui.state import Busy
from magcomp.tui.themes import DEFAULT_VARIABLES, THEMES
from magcomp.tui.widgets.top_bar import STEPS


class MagcompApp(BaseApp):
    """Connect → record → fit → write → verify; parameters as of :class:`BaseApp`."""

    TITLE = "magcomp"
    CSS_PATH = "magcomp.tcss"
    ENABLE_COMMAND_PALETTE = True
    MODES: ClassVar[dict[str, Any]] = {
        "connect": ConnectScreen,
        "record": RecordScreen,
        "fit": FitScreen,
        "review": ReviewScreen,
        "verify": VerifyScreen,
    }
    DEFAULT_MODE = "connect"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("f1", "help", "Help", id="app.help", priority=True),
        Binding("l", "light", "Light", id="app.light"),
        Binding("q", "quit", "Quit", id="app.quit"),
        Binding("ctrl+c,ctrl+q", "quit", "Quit", id="app.interrupt", show=False, priority=True),
        Binding("ctrl+p", "command_palette", "Find", id="app.palette"),
    ]

    def __init__(self, target: str = "", **given: Any) -> None:
        super().__init__(target, **given)
        for theme in THEMES:
            self.register_theme(theme)
        self.theme = self._first_theme()
        self.set_keymap(_checked_keys(self.settings, self.known_actions()))

    def on_mount(self) -> None:
        """Begin with what the command line named."""
        self.theme_changed_signal.subscribe(self, lambda theme: self.remember_theme(theme.name))
        if self.target:
            self.call_after_refresh(opening.open_target, self, self.target)

    # ---------------------------------------------------------------- messages

    def on_state_wanted(self, message: StateWanted) -> None:  # noqa: ARG002
        """Draw the screen that came to the front."""
        self.redraw()

    def on_ports_wanted(self, message: PortsWanted) -> None:  # noqa: ARG002
        """Look for serial ports."""
        opening.scan_ports(self)

    def on_target_chosen(self, message: TargetChosen) -> None:
        """Open it."""
        opening.open_target(self, message.target)

    def on_options_chosen(self, message: OptionsChosen) -> None:
        """Fit with them."""
        fitting.change(self, **message.changed)

    def on_time_range_wanted(self, message: TimeRangeWanted) -> None:  # noqa: ARG002
        """Ask which part to fit."""
        fitting.ask_time_range(self)

    def on_compass_toggled(self, message: CompassToggled) -> None:
        """Write it, or leave it out."""
        writing.choose(self, message.compass)

    def on_snapshot_taken(self, message: SnapshotTaken) -> None:
        """Draw the vehicle as it stands."""
        if self.session is not None and message.snapshot is not self.live:
            self.live = message.snapshot
            opening.watch_vehicle(self)
            verifying.watch_flight(self)
            self.redraw()
        self.tell_drawn()

    def on_sweep_told(self, message: SweepTold) -> None:
        """Show how a sweep goes on."""
        if isinstance(self.screen, Sweeping):
            self.screen.tell(message.event)

    async def on_event(self, event: Event) -> None:
        """While motors spin each key stops them, before it does anything else."""
        if isinstance(event, Key) and isinstance(self.screen, Sweeping):
            self.screen.stop.set()
            return
        await super().on_event(event)

    def on_watching_failed(self, message: WatchingFailed) -> None:
        """Say why the vehicle is followed no more."""
        self.complain(message.error)

    # ---------------------------------------------------------------- the road

    def action_go(self, step: str) -> None:
        """Go to a step, or say what is missing."""
        missing = status.missing(step, self.work)
        if missing:
            self.notify(missing, severity="warning")
            return
        outdated = self.current_mode == "record" and self.state.is_outdated
        self.switch_mode(step)
        if step == "fit" and (outdated or self.work.analysis is None) and self.busy is None:
            fitting.start(self, self.work.options)

    def action_forward(self) -> None:
        """Go to the next step of this road: a log has no recording and no verifying."""
        road = status.road(self.work)
        here = road.index(self.current_mode) if self.current_mode in road else 0
        if here + 1 < len(road):
            self.action_go(road[here + 1])
        else:
            self.notify("This is the last step of the road for a log.")

    def action_backward(self) -> None:
        """Go to the step before."""
        road = status.road(self.work)
        here = road.index(self.current_mode) if self.current_mode in road else 0
        self.action_go(road[max(here - 1, 0)])

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:  # noqa: ARG002
        """Hide the keys that have nothing to do on this road."""
        road, work = status.road(self.work), self.work
        here = road.index(self.current_mode) if self.current_mode in road else 0
        following = road[here + 1] if here + 1 < len(road) else ""
        rejected = work.analysis is not None and work.analysis.grade is Grade.REJECTED
        shown = {
            "forward": bool(work.source and following) and not (following == "review" and rejected),
            "other_fit": len(work.tried) > 1,
            "report": work.analysis is not None,
            "backward": self.current_mode != road[0],
            "disconnect": bool(work.source),
            "open_log": not work.source,
            "simulate": not work.source,
            "manoeuvre": work.live,
            "write": work.live,
            "sweep": work.live,
            "fly_again": self.simulation is not None and bool(self.writing.in_force),
            "undo": bool(self.writing.in_force),
        }
        return shown.get(action, True)

    # ---------------------------------------------------------------- keys

    def action_open_log(self) -> None:
        """Ask for a log."""
        opening.ask_log(self)

    def action_simulate(self, autopilot: str = "") -> None:
        """Connect to a simulated vehicle."""
        opening.simulate(self, autopilot or next(iter(SIMULATED.values())))

    def action_disconnect(self) -> None:
        """Close vehicle or log."""
        opening.leave(self)

    def action_manoeuvre(self) -> None:
        """Say how the vehicle is moved, or let it be found out."""
        opening.next_manoeuvre(self)

    def action_fit(self) -> None:
        """Fit what is recorded so far."""
        fitting.again(self)

    def action_other_fit(self) -> None:
        """Show another one of the fits tried."""
        fitting.show_other(self)

    def action_sweep(self) -> None:
        """Spin the motors on the ground, after the vehicle's name was typed."""
        sweeping.ask(self)

    def action_write(self) -> None:
        """Write to the vehicle."""
        writing.ask_write(self)

    def action_save(self) -> None:
        """Save a parameter file."""
        writing.ask_save(self)

    def action_report(self) -> None:
        """Save a report."""
        writing.ask_report(self)

    def action_fly_again(self) -> None:
        """Let the simulated vehicle fly with what was written."""
        if self.simulation is not None:
            self.simulation.fly_again()

    def action_undo(self) -> None:
        """Bring the vehicle back to what it held."""
        writing.ask_undo(self)

    def action_light(self) -> None:
        """Change between the themes for the workshop and for sunlight."""
        self.theme = "night" if self.theme == "sun" else "sun"

    def action_help(self) -> None:
        """Help for what has the focus."""
        if not isinstance(self.screen, Help):
            self.push_screen(Help(help_text(self.screen), key_lines(self.screen)))

    async def action_quit(self) -> None:
        """Quit; ask where results would be lost or a vehicle is being written."""
        doing = self.busy.what if self.busy else ""
        question = status.quit_question(self.work, self.live, doing)
        if isinstance(self.screen, Quit):
            return
        if question:
            self.push_screen(Quit(question), lambda sure: self._leave() if sure else None)
        else:
            self._leave()

    def _leave(self) -> None:
        """Stop what is being done, then give everything back, then end."""
        self.stopping.set()
        if self.busy is None:
            self.close_all()

    def close_all(self) -> None:
        """Give everything back off the screen's thread, then end."""

        def close() -> None:
            opening.close(self)
            self.call_from_thread(self._end)

        self.busy = Busy("closing the link")
        self.redraw()
        self.run_worker(close, thread=True, exit_on_error=False)

    def _end(self) -> None:
        self.exit(message=Text(self.farewell) if self.farewell else None)

    # ---------------------------------------------------------------- palette, themes, keys

    def get_system_commands(self, screen: Screen[Any]) -> Iterable[SystemCommand]:
        """Everything a key does, by name, and what needs no key."""
        yield SystemCommand("Open a log", "A .tlog, .BIN or .ulg", self.action_open_log)
        for name, autopilot in SIMULATED.items():
            yield SystemCommand(
                f"Try a {name}", "Nothing can break", lambda a=autopilot: self.action_simulate(a)
            )
        yield SystemCommand("Disconnect", "Close vehicle or log", self.action_disconnect)
        for step, title in STEPS.items():
            yield SystemCommand(
                f"Go to {title}", "Step of the road", lambda s=step: self.action_go(s)
            )
        yield SystemCommand(
            "How it is moved", "Flown, on a stand, tied down", self.action_manoeuvre
        )
        yield SystemCommand("Fit again", "What is recorded so far", self.action_fit)
        yield SystemCommand("Sweep on the ground", "The motors spin", self.action_sweep)
        yield SystemCommand("Write to vehicle", "After a question", self.action_write)
        yield SystemCommand("Save parameter file", "For a ground station", self.action_save)
        yield SystemCommand("Save report", "As a page, text or JSON", self.action_report)
        yield SystemCommand("Undo writing", "From the backup", self.action_undo)
        yield SystemCommand("Light or dark", "For sun or workshop", self.action_light)
        yield SystemCommand("Edit settings", "Where the settings file is", self.action_settings)
        yield SystemCommand("Help", "For what has the focus", self.action_help)
        kept = ("theme", "screenshot")
        others = super().get_system_commands(screen)
        yield from (c for c in others if any(word in c.title.lower() for word in kept))
        yield SystemCommand("Quit", "Asks where results would be lost", self.action_quit)

    def action_settings(self) -> None:
        """Make a settings file if there is none, and say where it is."""
        try:
            path = write_template(self.settings_folder)
        except MagcompError as error:
            self.complain(error)
            return
        step = "Edit it with any editor; it is read at the next start."
        self.push_screen(Message("Settings", f"The settings file is {path}.", step))

    def known_actions(self) -> frozenset[str]:
        """Names of all actions that have a key, for the settings file."""
        owners: list[Any] = [type(self), *self.MODES.values()]
        bindings = (binding for owner in owners for binding in owner.BINDINGS)
        return frozenset(b.id for b in bindings if isinstance(b, Binding) and b.id)

    def get_theme_variable_defaults(self) -> dict[str, str]:
        """Variables of our themes that Textual's own lack."""
        return DEFAULT_VARIABLES

    def _first_theme(self) -> str:
        wanted = self.settings.theme or self.remembered.theme or "night"
        if wanted in self.available_themes:
            return wanted
        if not self.settings.theme:  # remembered from a version that had it
            return "night"
        raise UsageError(
            f"{self.settings.source}: theme must be one of {', '.join(self.available_themes)}; "
            f"instead received {wanted}"
        )


def _checked_keys(settings: Settings, known: frozenset[str]) -> dict[str, str]:
    unknown = sorted(set(settings.keys) - known)
    if unknown:
        raise UsageError(
            f"{settings.source}: keys must name actions such as {', '.join(sorted(known)[:4])}; "
            f"instead received {', '.join(unknown)}"
        )
    return dict(settings.keys)
