"""A sweep on the ground: asked for by the vehicle's name, stopped by any key, fitted at its end."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from magcomp.analysis import Options
from magcomp.errors import MagcompError
from magcomp.live.sweep import Bench, raise_for_failure
from magcomp.model import CURRENT
from magcomp.report import words
from magcomp.sweeping.events import Event, Outcome, Reason
from magcomp.sweeping.steps import LEAST_MOST, MOST_MOST
from magcomp.tui import fitting
from magcomp.tui.base import BaseApp
from magcomp.tui.messages import SweepTold
from magcomp.tui.screens.dialogs import AskText, Fault, Message
from magcomp.tui.screens.sweeping import Sweeping

DEAF_S = 2.0
"""A screen that draws nothing for so long takes no key either: the sweep stops."""

_DEFAULT_MOST = 0.5
_WARNING = (
    "The motors will spin, each alone and all together. Take the propellers off, or hold the "
    "vehicle down so that it cannot move or tilt. Any key stops at once."
)


def ask(app: BaseApp) -> None:
    """Look whether the vehicle can be swept, and ask for its name."""
    session = app.session
    if session is None:
        app.notify("Connect to a vehicle first.", severity="warning")
        return
    app.run_task(
        "looking at the motors",
        lambda _: app.services.make_ready(session, None, _DEFAULT_MOST),
        lambda bench: _ask_name(app, bench),
    )


def _ask_name(app: BaseApp, bench: Bench) -> None:
    dialog = AskText(
        "Sweep on the ground",
        _WARNING,
        (
            (f"Type {bench.name} to begin", ""),
            ("Strongest step, % of the motor outputs' range", f"{100 * bench.most:.0f}"),
        ),
        check=partial(_fault, bench),
    )
    app.push_screen(dialog, lambda answer: _begin(app, bench, answer) if answer else None)


def _fault(bench: Bench, answer: tuple[str, ...]) -> Fault | None:
    """What is wrong with a name and a strongest step."""
    if not bench.is_name(answer[0]):
        told = f"What is typed must be {bench.name}; instead received {answer[0]!r}"
        return Fault(0, f"{told}, and no motor spins.")
    least, most = 100 * LEAST_MOST, 100 * MOST_MOST
    try:
        share = float(answer[1])
    except ValueError:
        share = 0.0
    if not least <= share <= most:
        told = f"The strongest step must be {least:.0f} to {most:.0f} %"
        return Fault(1, f"{told}; instead received {answer[1]!r}.")
    return None


def _begin(app: BaseApp, bench: Bench, answer: tuple[str, ...]) -> None:
    session, screen = app.session, Sweeping()
    if session is None:
        return
    chosen = replace(bench, most=float(answer[1]) / 100)

    def pressed() -> Reason | None:
        if app.stopping.is_set() or not app.is_running:
            return Reason.INTERRUPTED
        if screen.silent_s > DEAF_S:
            return Reason.DEAF
        return Reason.KEY if screen.stop.is_set() else None

    def tell(event: Event) -> None:
        # Only posted: the thread that feeds the motors must not wait for a screen.
        app.post_message(SweepTold(event))

    def work() -> tuple[Outcome, float]:
        begun = session.recording().duration_s
        try:
            return app.services.sweep(session, chosen, answer[0], pressed, tell), begun
        finally:
            app.call_from_thread(_close, app, screen)

    app.push_screen(screen)
    app.run_task("sweeping", lambda _: work(), partial(_end, app))


def _close(app: BaseApp, screen: Sweeping) -> None:
    if screen in app.screen_stack:
        screen.dismiss()


def _end(app: BaseApp, swept: tuple[Outcome, float]) -> None:
    outcome, begun = swept
    if outcome.reason is None:
        app.switch_mode("fit")
        # What came before may hold the vehicle being carried to where it stands.
        fitting.start(app, Options(method="sweep", regressor=CURRENT, start=begun))
        return
    try:
        raise_for_failure(outcome)
    except MagcompError as error:
        app.complain(error)
        return
    told = f"All motors were told to stand still after {words.counted(len(outcome.done), 'step')}."
    app.push_screen(Message("Stopped", told, "Press G to sweep anew; the recording goes on."))
