"""What the app is made of below its keys: what is in hand, work off its thread, and drawing."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from rich.text import Text
from textual.app import App

from magcomp.analysis import Options
from magcomp.live.snapshot import LiveSnapshot
from magcomp.tui.ascii import AsciiFilter
from magcomp.tui.choices import Choice
from magcomp.tui.messages import SnapshotTaken, WatchingFailed
from magcomp.tui.next_step import explain
from magcomp.tui.screens.dialogs import Message
from magcomp.tui.screens.step import StepScreen
from magcomp.tui.services import Progress, Services, Session, Simulation
from magcomp.tui.settings import Settings, read_remembered, settings_folder, write_remembered
from magcomp.tui.state import Busy, State
from magcomp.tui.watcher import Watcher
from magcomp.tui.work import Work, Writing

_T = TypeVar("_T")


class BaseApp(App[None]):
    """Holds what the pilot has in hand and gives it to the screens.

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
    ascii_only
        The terminal has no Unicode.
    """

    def __init__(
        self,
        target: str = "",
        *,
        settings: Settings | None = None,
        folder: Path | None = None,
        services: Services | None = None,
        system: int | None = None,
        ascii_only: bool = False,
    ) -> None:
        super().__init__()
        if ascii_only:
            self._filters.append(AsciiFilter())
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
        self.asked = Options()
        self.files: list[tuple[str, Path]] = []
        self._watcher: Watcher | None = None

    # ---------------------------------------------------------------- drawing

    @property
    def state(self) -> State:
        """What the screens draw."""
        said = None if self.session is None else self.session.manoeuvre
        return State(self.work, self.writing, self.live, self.busy, self.choices, self.asked, said)

    def redraw(self) -> None:
        """Draw the step on the screen, whatever lies over it."""
        for screen in self.screen_stack:
            if isinstance(screen, StepScreen):
                screen.show(self.state)

    def set_work(self, work: Work) -> None:
        """Take new work in hand and draw it."""
        self.work = work
        self.redraw()

    # ---------------------------------------------------------------- the vehicle

    def follow(self, session: Session) -> None:
        """Take a session in hand and follow it."""
        self.forget_session()
        self.session = session
        self._watcher = Watcher(
            session.snapshot,
            lambda snapshot: self.post_message(SnapshotTaken(snapshot)),
            lambda error: self.post_message(WatchingFailed(error)),
        )

    def tell_drawn(self) -> None:
        """Ask for the next snapshot, once what was drawn is on the screen."""
        if self._watcher is not None:
            self.call_after_refresh(self._watcher.drawn)

    def forget_session(self) -> Session | None:
        """Follow the session no more; whoever takes it closes it."""
        session, self.session = self.session, None
        if self._watcher is not None:
            self._watcher.close()
            self._watcher = None
        return session

    # ---------------------------------------------------------------- work off the thread

    def run_task(
        self,
        what: str,
        task: Callable[[Progress], _T],
        then: Callable[[_T], None],
        again: Callable[[], object] | None = None,
    ) -> None:
        """Do something long in a thread; then draw its result, or say what went wrong.

        Parameters
        ----------
        what
            In words.
        task
            Runs in the thread; tells how far it is.
        then
            Given its result, on the app's thread.
        again
            Asks anew after an error has been told, where the pilot was asked for something.
        """
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
                self.call_from_thread(self._failed, error, again)
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
            self.close_all()
            return
        then(result)
        self.redraw()

    def _failed(self, error: Exception, again: Callable[[], object] | None) -> None:
        self.busy = None
        if self.stopping.is_set():
            self.close_all()
            return
        self.redraw()
        self.complain(error, again)

    def close_all(self) -> None:
        """Give everything back, then end."""
        raise NotImplementedError

    def complain(self, error: Exception, again: Callable[[], object] | None = None) -> None:
        """Say what went wrong and what to do next; then ``again`` asks anew where it is given."""
        sentence, step = explain(error)
        message = Message("That did not work", sentence, step)

        def go_on(_: None) -> None:
            if again is not None:
                again()

        self.push_screen(message, go_on)

    def _fatal_error(self) -> None:
        """End with a sentence where Textual would print a traceback."""
        error = self._exception
        sentence, step = explain(error if error is not None else RuntimeError("unknown"))
        self._exit_renderables.append(Text(f"magcomp: {sentence} {step}"))
        self._close_messages_no_wait()

    # ---------------------------------------------------------------- what is remembered

    def note_file(self, kind: str, path: Path) -> None:
        """Say where a file is when the pilot leaves."""
        self.files.append((kind, path))

    @property
    def farewell(self) -> str:
        """Where everything is that was made, a line a file; empty where nothing was."""
        rows = [f"{kind:<11} {path}" for kind, path in self.files if path.exists()]
        if self.writing.in_force:
            rows.append("The vehicle holds the new parameters.")
        return "\n".join(rows)

    def remember_target(self, target: str) -> None:
        """Put an address or a log at the head of those used lately."""
        self.remembered = self.remembered.with_recent(target)
        write_remembered(self.settings_folder, self.remembered)

    def remember_theme(self, name: str) -> None:
        """Begin with this theme the next time."""
        if name != self.remembered.theme:
            self.remembered = replace(self.remembered, theme=name)
            write_remembered(self.settings_folder, self.remembered)
