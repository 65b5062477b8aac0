"""The app: holds what the pilot has in hand, runs work off the screen's thread, draws the result.

Screens draw ``work``, ``live``, ``busy`` and what else is frozen here. What the keys start stands
in opening.py, fitting.py and writing.py.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from rich.text import Text
from textual.app import App, SystemCommand
from textual.binding import Binding, BindingType
from textual.screen import Screen

from magcomp.errors import MagcompError, UsageError
from magcomp.live.snapshot import LiveSnapshot
from magcomp.tui import fitting, opening, status, writing
from magcomp.tui.choices import Choice
from magcomp.tui.help_text import help_text, key_lines
from magcomp.tui.next_step import explain
from magcomp.tui.screens.connect import ConnectScreen
from magcomp.tui.screens.dialogs import Confirm, Help, Message
from magcomp.tui.screens.fit import FitScreen
from magcomp.tui.screens.record import RecordScreen
from magcomp.tui.screens.review import ReviewScreen
from magcomp.tui.screens.step import StepScreen
from magcomp.tui.screens.verify import VerifyScreen
from magcomp.tui.services import Progress, Services, Session, Simulation
from magcomp.tui.settings import (
    Settings,
    read_remembered,
    settings_folder,
    write_remembered,
    write_template,
)
from magcomp.tui.themes import DEFAULT_VARIABLES, THEMES
from magcomp.tui.widgets.top_bar import STEPS, Status
from magcomp.tui.work import Work, Writing

TICK_S = 0.1
"""The live screens are drawn ten times a second."""

_T = TypeVar("_T")


@dataclass(frozen=True)
class Busy:
    """What is being done.

    Attributes
    ----------
    what
        In words.
    share
        Done, 0 … 1.
    """

    what: str
    share: float = 0.0

    @property
    def sentence(self) -> str:
        """For the next line."""
        return f"Wait: {self.what} … {100 * self.share:.0f} %"


class MagcompApp(App[None]):
    """Connect → record → fit → write → verify.

    Parameters
    ----------
    target
        An address or a log to begin with; empty for none.
    settings
        What stands in the settings file.
    folder
        Where settings and state are kept; the platform's place by default.
    services
        What the app calls; replaced by tests.
    system
        MAVLink system to work with, where several are on a link or in a log.
    """

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
        Binding("ctrl+p", "command_palette", "Palette", id="app.palette", show=False),
    ]

    def __init__(
        self,
        target: str = "",
        *,
        settings: Settings | None = None,
        folder: Path | None = None,
        services: Services | None = None,
        system: int | None = None,
    ) -> None:
        super().__init__()
        self.target = target
        self.system = system
        self.settings = Settings() if settings is None else settings
        self.settings_folder = settings_folder() if folder is None else folder
        self.services = Services() if services is None else services
        self.remembered = read_remembered(self.settings_folder)
        self.work = Work()
        self.writing = Writing()
        self.live: LiveSnapshot | None = None
        self.session: Session | None = None
        self.simulation: Simulation | None = None
        self.busy: Busy | None = None
        self.stopping = threading.Event()
        self.choices: tuple[Choice, ...] = ()
        for theme in THEMES:
            self.register_theme(theme)
        self.theme = self._first_theme()
        self.set_keymap(_checked_keys(self.settings, self.known_actions()))

    # ---------------------------------------------------------------- life

    def on_mount(self) -> None:
        """Begin with what the command line named."""
        self.set_interval(TICK_S, self.tick)
        self.theme_changed_signal.subscribe(self, lambda theme: self._remember_theme(theme.name))
        if self.target:
            self.call_after_refresh(opening.open_target, self, self.target)

    def tick(self) -> None:
        """Take a snapshot of the vehicle and draw it."""
        if self.session is not None:
            self.live = self.session.snapshot()
            opening.watch_vehicle(self)
            self.redraw()

    def redraw(self) -> None:
        """Draw the step on the screen, whatever lies over it."""
        for screen in self.screen_stack:
            if isinstance(screen, StepScreen):
                screen.redraw()

    def set_work(self, work: Work) -> None:
        """Take new work in hand and draw it."""
        self.work = work
        self.redraw()

    # ---------------------------------------------------------------- work off the thread

    def run_task(
        self, what: str, task: Callable[[Progress], _T], then: Callable[[_T], None]
    ) -> None:
        """Do something long in a thread; then draw its result, or say what went wrong."""
        if self.busy is not None:
            self.notify(f"Wait a moment: {self.busy.what}.")
            return
        self.busy = Busy(what)

        def progress(name: str, share: float) -> None:
            self.call_from_thread(self._progress, Busy(f"{what}, {name}" if name else what, share))

        def run() -> None:
            try:
                result = task(progress)
            except Exception as error:  # whatever it is, the pilot must hear of it in words
                self.call_from_thread(self._failed, error)
            else:
                self.call_from_thread(self._done, then, result)

        self.run_worker(run, thread=True, name=what, exit_on_error=False)
        self.redraw()

    def _progress(self, busy: Busy) -> None:
        if self.busy is not None:
            self.busy = busy
            self.redraw()

    def _done(self, then: Callable[[_T], None], result: _T) -> None:
        self.busy = None
        if self.stopping.is_set():
            self._close()
            return
        then(result)
        self.redraw()

    def _failed(self, error: Exception) -> None:
        self.busy = None
        if self.stopping.is_set():
            self._close()
            return
        self.redraw()
        self.complain(error)

    def complain(self, error: Exception) -> None:
        """Say what went wrong, and what to do next."""
        sentence, step = explain(error)
        self.push_screen(Message("That did not work", sentence, step))

    def _fatal_error(self) -> None:
        """End with a sentence where Textual would print a traceback."""
        error = self._exception
        sentence, step = explain(error if error is not None else RuntimeError("unknown"))
        self._exit_renderables.append(Text(f"magcomp: {sentence} {step}"))
        self._close_messages_no_wait()

    # ---------------------------------------------------------------- what the screens draw

    @property
    def status(self) -> Status:
        """The second line of every screen."""
        return status.status(self.work, self.live)

    @property
    def steps_done(self) -> frozenset[str]:
        """Steps that need no more work."""
        return status.steps_done(self.work, self.live)

    @property
    def binding_state(self) -> object:
        """What `check_action` looks at."""
        return self.current_mode, self.work.source, self.work.live, bool(self.writing.in_force)

    # ---------------------------------------------------------------- the road

    def action_go(self, step: str) -> None:
        """Go to a step, or say what is missing."""
        missing = status.missing(step, self.work)
        if missing:
            self.notify(missing, severity="warning")
            return
        self.switch_mode(step)
        if step == "fit" and self.work.analysis is None and self.busy is None:
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
        shown = {
            "forward": bool(work.source) and self.current_mode != road[-1],
            "backward": self.current_mode != road[0],
            "disconnect": bool(work.source),
            "open_log": not work.source,
            "simulate": not work.source,
            "write": work.live,
            "undo": bool(self.writing.in_force),
        }
        return shown.get(action, True)

    # ---------------------------------------------------------------- keys

    def action_open_log(self) -> None:
        """Ask for a log."""
        opening.ask_log(self)

    def action_simulate(self) -> None:
        """Connect to a simulated vehicle."""
        opening.simulate(self)

    def action_disconnect(self) -> None:
        """Close vehicle or log."""
        opening.leave(self)

    def action_fit(self) -> None:
        """Fit what is recorded so far."""
        fitting.again(self)

    def action_write(self) -> None:
        """Write to the vehicle."""
        writing.ask_write(self)

    def action_save(self) -> None:
        """Save a parameter file."""
        writing.ask_save(self)

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
        question = status.quit_question(self.work, self.busy.what if self.busy else "")
        if question and not isinstance(self.screen, Confirm):
            dialog = Confirm("Quit?", question, yes="Quit", no="Stay")
            self.push_screen(dialog, lambda sure: self._leave() if sure else None)
        else:
            self._leave()

    def _leave(self) -> None:
        """Stop what is being done, then give everything back, then end."""
        self.stopping.set()
        if self.busy is None:
            self._close()

    def _close(self) -> None:
        def close() -> None:
            opening.close(self)
            self.call_from_thread(self.exit)

        self.busy = Busy("closing the link")
        self.redraw()
        self.run_worker(close, thread=True, exit_on_error=False)

    # ---------------------------------------------------------------- palette, themes, keys

    def get_system_commands(self, screen: Screen[Any]) -> Iterable[SystemCommand]:
        """Everything a key does, by name, and what needs no key."""
        yield SystemCommand("Open a log", "A .tlog of a flight", self.action_open_log)
        yield SystemCommand("Simulated vehicle", "Try everything", self.action_simulate)
        yield SystemCommand("Disconnect", "Close vehicle or log", self.action_disconnect)
        for step, title in STEPS.items():
            yield SystemCommand(
                f"Go to {title}", "Step of the road", lambda s=step: self.action_go(s)
            )
        yield SystemCommand("Fit again", "What is recorded so far", self.action_fit)
        yield SystemCommand("Write to vehicle", "After a question", self.action_write)
        yield SystemCommand("Save parameter file", "For a ground station", self.action_save)
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

    def _remember_theme(self, name: str) -> None:
        if name != self.remembered.theme:
            self.remembered = replace(self.remembered, theme=name)
            write_remembered(self.settings_folder, self.remembered)

    def remember_target(self, target: str) -> None:
        """Put an address or a log at the head of those used lately."""
        self.remembered = self.remembered.with_recent(target)
        write_remembered(self.settings_folder, self.remembered)


def _checked_keys(settings: Settings, known: frozenset[str]) -> dict[str, str]:
    unknown = sorted(set(settings.keys) - known)
    if unknown:
        raise UsageError(
            f"{settings.source}: keys must name actions such as {', '.join(sorted(known)[:4])}; "
            f"instead received {', '.join(unknown)}"
        )
    return dict(settings.keys)
