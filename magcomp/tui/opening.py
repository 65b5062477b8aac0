"""Opening a log or a vehicle, watching the vehicle come, and closing it again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from magcomp.analysis import Options
from magcomp.errors import MagcompError
from magcomp.link import Replay, SerialPort, parse_address
from magcomp.live.situation import Manoeuvre
from magcomp.model import Recording
from magcomp.report import words
from magcomp.tui.base import BaseApp
from magcomp.tui.choices import choices
from magcomp.tui.screens.dialogs import AskText, Confirm, Fault
from magcomp.tui.services import Progress, Session, Simulation, judge_present
from magcomp.tui.vehicle_card import VehicleCard, card_of_recording
from magcomp.tui.work import Work, Writing


def scan_ports(app: BaseApp) -> None:
    """Look for serial ports, and show everything that can be chosen."""

    def scan() -> None:
        ports = tuple(app.services.ports())
        app.call_from_thread(_show, app, ports)

    app.run_worker(scan, thread=True, exclusive=True, group="ports", exit_on_error=False)


def _show(app: BaseApp, ports: tuple[SerialPort, ...]) -> None:
    app.choices = choices(ports, app.remembered.recent)
    app.redraw()


def ask_log(app: BaseApp) -> None:
    """Ask for the path of a log."""
    recent = (name for name in app.remembered.recent if Path(name).expanduser().is_file())
    dialog = AskText(
        "Open a log",
        "The path of a .tlog, .BIN or .ulg.",
        (("Log", next(recent, "")),),
        check=_log_fault,
    )
    app.push_screen(dialog, lambda answer: open_target(app, answer[0]) if answer else None)


def _log_fault(answer: tuple[str, ...]) -> Fault | None:
    path = Path(answer[0]).expanduser()
    if path.is_file():
        return None
    return Fault(0, f"There must be a log; instead there is no file {answer[0]!r}.")


def open_target(app: BaseApp, target: str) -> None:
    """Open a log, or connect to an address."""
    if not target:
        return
    try:
        address = None if Path(target).expanduser().is_file() else parse_address(target)
    except MagcompError as error:
        app.complain(error)
        return
    if address is None or isinstance(address, Replay):
        _when_free(app, lambda: _open_log(app, Path(target).expanduser()))
    else:
        if str(address) != target:
            app.notify(f"{target} means {address}.")
        _when_free(app, lambda: _connect(app, target))


def simulate(app: BaseApp, autopilot: str) -> None:
    """Start a simulated vehicle and connect to it."""

    def started(simulation: Simulation) -> None:
        app.simulation = simulation
        _connect(app, simulation.address)

    _when_free(
        app,
        lambda: app.run_task(
            "starting the simulated vehicle", lambda _: app.services.simulate(autopilot), started
        ),
    )


def leave(app: BaseApp) -> None:
    """Close vehicle or log; ask where results would be lost."""
    if app.work.source:
        _when_free(app, lambda: None)


def next_manoeuvre(app: BaseApp) -> None:
    """Take the next of the ways to move a vehicle as said; after the last it is found out again."""
    if app.session is not None:
        # The one that is safe in the air comes first, should the key be pressed there.
        ways = (None, Manoeuvre.FLIGHT, Manoeuvre.STAND, Manoeuvre.SWEEP)
        app.session.manoeuvre = ways[(ways.index(app.session.manoeuvre) + 1) % len(ways)]
        app.redraw()


def close(app: BaseApp) -> None:
    """Give everything back; may take a moment."""
    session, simulation = app.forget_session(), app.simulation
    app.simulation = None
    if session is not None:
        session.close()
    if simulation is not None:
        simulation.stop()


def _when_free(app: BaseApp, then: Callable[[], None]) -> None:
    """Let go of what is open, then go on."""

    def free() -> None:
        app.switch_mode("connect")
        app.live = None
        app.writing = Writing()
        app.asked = Options()
        app.set_work(Work())
        if app.session is None and app.simulation is None:
            then()
            return
        app.run_task("disconnecting", lambda _: close(app), lambda _: then())

    if not app.work.unwritten:
        free()
        return
    question = "The results are not written anywhere yet. Let go of them?"
    dialog = Confirm("Close?", question, yes="Close", no="Stay")
    app.push_screen(dialog, lambda sure: free() if sure else None)


# ------------------------------------------------------------------------ a log


def _open_log(app: BaseApp, path: Path) -> None:
    def task(progress: Progress) -> tuple[Recording, VehicleCard]:
        progress("", 0.1)
        recording = app.services.read(path, app.system)
        progress("judging the calibration in force", 0.5)
        return recording, card_of_recording(recording, judge_present(recording))

    def then(found: tuple[Recording, VehicleCard]) -> None:
        recording, card = found
        app.remember_target(str(path))
        app.set_work(Work(source=str(path), card=card, recording=recording))

    app.run_task(f"reading {path.name}", task, then)


# ------------------------------------------------------------------------ a vehicle


def _connect(app: BaseApp, address: str) -> None:
    def task(_: Progress) -> tuple[Session, Path]:
        record = app.services.new_file("recording", ".tlog", None)
        record.parent.mkdir(parents=True, exist_ok=True)
        return app.services.open_live(address, record, app.system), record

    def then(opened: tuple[Session, Path]) -> None:
        session, record = opened
        app.note_file("Recording", record)
        if app.simulation is None:
            app.remember_target(address)
        app.set_work(Work(source=address, live=True))
        app.follow(session)

    app.run_task(f"opening {address}", task, then)


def watch_vehicle(app: BaseApp) -> None:
    """Make the vehicle's card once its calibration is read; keep its warnings fresh."""
    live, session, work = app.live, app.session, app.work
    if live is None or session is None or live.vehicle is None:
        return
    if work.card is None and live.ready and app.busy is None:

        def then(recording: Recording) -> None:
            card = card_of_recording(recording)
            facts = tuple(fact for fact in card.facts if fact[0] != "Readings")
            shown = replace(card, facts=facts, warnings=_warnings(app))
            app.set_work(replace(app.work, card=shown, recording=recording))

        app.run_task("reading the calibration", lambda _: session.recording(), then)
    elif work.card is not None and work.card.warnings != _warnings(app):
        app.work = replace(work, card=replace(work.card, warnings=_warnings(app)))


def _warnings(app: BaseApp) -> tuple[str, ...]:
    return () if app.live is None else tuple(map(words.sentence, app.live.warnings))
