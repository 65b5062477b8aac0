"""Writing: which compasses, a file, the vehicle with confirmation and progress, and undoing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from magcomp.errors import MagcompError
from magcomp.model import Grade
from magcomp.report import words
from magcomp.report.files import SUFFIXES as REPORT_SUFFIXES
from magcomp.tui.base import BaseApp
from magcomp.tui.changes import ChangeRow, after_event, change_rows, left_out_warnings
from magcomp.tui.screens.dialogs import AskText, Confirm, Message
from magcomp.tui.services import Progress, Session, save_report
from magcomp.tui.status import WRITING
from magcomp.tui.work import Work, Writing
from magcomp.writing.events import Event, Outcome
from magcomp.writing.files import format_value, write_parameter_file
from magcomp.writing.plan import WritePlan
from magcomp.writing.writer import raise_for_failure

_THE_VEHICLE = "the vehicle"


def prepare(app: BaseApp) -> None:
    """Work out what would change, for what is chosen now."""
    work = app.work
    if work.analysis is None:
        app.writing = Writing()
        return
    app.writing = replace(  # what was written stays known, so that it can be undone
        app.writing,
        rows=change_rows(work.present, work.parameters),
        warnings=tuple(left_out_warnings(work.analysis, work.chosen, work.present)),
        result="",
    )
    app.redraw()


def choose(app: BaseApp, compass: int) -> None:
    """Write a compass, or leave it out."""
    work = app.work
    results = {} if work.analysis is None else {c.fit.compass: c for c in work.analysis.compasses}
    if app.busy is not None or compass not in results:
        return
    if results[compass].verdict.grade is Grade.REJECTED:
        app.notify(f"Compass {compass} is rejected: its fit is not written.", severity="warning")
        return
    app.set_work(replace(work, chosen=work.chosen ^ {compass}, kept=""))
    prepare(app)


# ------------------------------------------------------------------------ a file


def ask_save(app: BaseApp, proposed: str = "") -> None:
    """Ask where to, and save the parameters of the chosen compasses."""
    if app.work.parameters is None:
        app.notify("There is nothing to save: no compass is chosen.", severity="warning")
        return
    dialog = AskText(
        "Save a parameter file",
        "Mission Planner takes .param, QGroundControl .params, MAVProxy .parm.",
        (("File", proposed or str(_proposed(app.work, ".param"))),),
    )
    _ask_file(app, dialog, _save_now)


class _Save(Protocol):
    def __call__(self, app: BaseApp, path: Path, *, force: bool) -> None: ...


def _ask_file(app: BaseApp, dialog: AskText, save: _Save) -> None:
    """Save to the file that the dialog asks for."""

    def answered(answer: Sequence[str] | None) -> None:
        if answer:
            _to_file(app, answer[0], save)

    app.push_screen(dialog, answered)


def _to_file(app: BaseApp, text: str, save: _Save) -> None:
    """Save to the file named, after a question where it exists."""
    path = Path(text).expanduser()
    if path.is_file():
        question = f"{path} exists already. Overwrite it?"
        dialog = Confirm("Overwrite?", question, yes="Overwrite", no="Keep")
        app.push_screen(dialog, lambda sure: save(app, path, force=True) if sure else None)
    else:
        save(app, path, force=False)


def _proposed(work: Work, suffix: str) -> Path:
    return Path(f"compass{suffix}") if work.live else Path(work.source).with_suffix(suffix)


def _save_now(app: BaseApp, path: Path, *, force: bool) -> None:
    parameters = app.work.parameters
    if parameters is None:
        return
    try:
        write_parameter_file(path, parameters, force=force)
    except MagcompError as error:
        app.complain(error, lambda: ask_save(app, str(path)))
        return
    app.note_file("Parameters", path)
    app.set_work(replace(app.work, kept=str(path)))
    app.writing = replace(app.writing, result=f"saved to {path}")
    app.redraw()


def ask_report(app: BaseApp, proposed: str = "") -> None:
    """Ask where to, and save a report of the fit shown."""
    if app.work.analysis is None:
        app.notify("There is nothing to report: fit first.", severity="warning")
        return
    dialog = AskText(
        "Save a report",
        f"Its end chooses its form: {words.listed(REPORT_SUFFIXES)}.",
        (("File", proposed or str(_proposed(app.work, ".html"))),),
    )
    app.push_screen(
        dialog, lambda answer: _to_file(app, answer[0], _make_report) if answer else None
    )


def _make_report(app: BaseApp, path: Path, *, force: bool) -> None:
    work = app.work

    def task(_: Progress) -> None:
        save_report(path, work.recording, work.analysis, work.options, force=force)

    def then(_: None) -> None:
        app.note_file("Report", path)
        app.notify(f"The report is in {path}.")

    app.run_task("making the report", task, then, again=lambda: ask_report(app, str(path)))


# ------------------------------------------------------------------------ the vehicle


def ask_write(app: BaseApp) -> None:
    """Read what the vehicle holds, show what would happen, and ask."""
    session, wanted = app.session, app.work.parameters
    if session is None:
        app.notify("This is a log: connect to the vehicle to write to it, or press S to save.")
    elif wanted is None:
        app.notify("There is nothing to write: no compass is chosen.", severity="warning")
    elif _may_write(app):
        app.run_task(
            "reading what the vehicle holds",
            lambda _: session.upload_plan(wanted),
            lambda plan: _confirm(app, plan),
        )


def _may_write(app: BaseApp) -> bool:
    live = app.live
    if live is not None and not live.connected:
        message = Message(
            "Not now", "The link to the vehicle is lost.", "Wait until it is back, then press W."
        )
    elif live is not None and live.armed:
        message = Message("Not now", "The vehicle is armed.", "Land and disarm it, then press W.")
    else:
        return True
    app.push_screen(message)
    return False


def _confirm(app: BaseApp, plan: WritePlan) -> None:
    rows = tuple(
        ChangeRow(change.name, format_value(change.old), format_value(change.new))
        for change in plan.changes
    )
    backup = _backup(app)
    app.writing = replace(app.writing, rows=rows, warnings=(*app.writing.warnings, *plan.warnings))
    app.redraw()
    if not rows or backup is None:
        app.notify("The vehicle holds these values already: nothing is to be written.")
        return
    compasses = words.compasses(sorted(app.work.chosen))
    count, vehicle = words.counted(len(rows), "parameter"), words.vehicle(plan.vehicle)
    lines = [
        f"Write {count} of {compasses} to {vehicle}?",
        f"The old values are saved first, in {backup}",
        *app.writing.warnings,
    ]
    dialog = Confirm("Write to the vehicle?", "\n".join(lines), yes="Write", no="Cancel")
    app.push_screen(dialog, lambda sure: _write(app, plan, backup) if sure else None)


def _write(app: BaseApp, plan: WritePlan, backup: Path) -> None:
    session = app.session
    if session is None:
        return

    def task(progress: Progress) -> tuple[Outcome, str, float]:
        backup.parent.mkdir(parents=True, exist_ok=True)
        outcome = session.upload(plan, backup, _follow(app, progress), app.stopping.is_set)
        if not outcome.good:
            return outcome, "", 0.0
        return outcome, _what_acts(session, plan), session.recording().duration_s

    def then(ended: tuple[Outcome, str, float]) -> None:
        outcome, acts, since_s = ended
        app.note_file("Backup", backup)
        app.writing = replace(app.writing, backup=backup)
        if _ended(app, outcome, backup):
            now = {**plan.old, **plan.new, **plan.switches}
            app.writing = replace(
                app.writing,
                result=f"all {len(app.writing.rows)} parameters read back as written",
                acts=acts,
                before=plan.old,
                in_force=now,
                promised=app.work.analysis,
                since_s=since_s,
                measured=(),
                measured_trouble="",
            )
            app.set_work(replace(app.work, kept=app.work.kept or _THE_VEHICLE))

    app.run_task(WRITING, task, then)


def _what_acts(session: Session, plan: WritePlan) -> str:
    """What the vehicle shows of it: that it cannot be looked at is no failure of the write."""
    try:
        return session.what_acts(plan)
    except MagcompError as error:
        return f"what is in force could not be looked at: {str(error).rstrip('.')}"


def _follow(app: BaseApp, progress: Progress) -> Callable[[Event], None]:
    """Make rows of what the writer tells; called on the writer's thread."""
    share = 0.0

    def show(event: Event) -> None:
        rows = after_event(app.writing.rows, event)
        app.writing = replace(app.writing, rows=rows)

    def follow(event: Event) -> None:
        nonlocal share
        app.call_from_thread(show, event)
        done = sum(1 for row in app.writing.rows if row.done) / max(len(app.writing.rows), 1)
        share = max(share, done)
        progress("", share)

    return follow


def _ended(app: BaseApp, outcome: Outcome, backup: Path) -> bool:
    """Say how a write ended; tell whether it was good."""
    try:
        raise_for_failure(outcome, backup, app.work.source)
    except MagcompError as error:
        app.writing = replace(app.writing, result=f"not written; {outcome.standing.value}")
        app.complain(error)
        return False
    return True


# ------------------------------------------------------------------------ undo


def ask_undo(app: BaseApp) -> None:
    """Compare the vehicle with the backup, and ask."""
    session, backup = app.session, app.writing.backup
    if session is None or backup is None or not app.writing.in_force:
        app.notify("Nothing was written to a vehicle, so there is nothing to undo.")
    elif _may_write(app):
        app.run_task(
            "reading what the vehicle holds",
            lambda _: session.restore_plan(backup),
            lambda plan: _confirm_undo(app, plan, backup),
        )


def _confirm_undo(app: BaseApp, plan: WritePlan, backup: Path) -> None:
    lines = f"Bring back {words.counted(len(plan.changes), 'parameter')} from the backup?\n{backup}"
    dialog = Confirm("Undo?", lines, yes="Undo", no="Keep")
    app.push_screen(dialog, lambda sure: _undo(app, plan, backup) if sure else None)


def _undo(app: BaseApp, plan: WritePlan, backup: Path) -> None:
    session = app.session
    second = _backup(app)
    if session is None or second is None:
        return
    app.writing = replace(
        app.writing,
        rows=tuple(
            ChangeRow(change.name, format_value(change.old), format_value(change.new))
            for change in plan.changes
        ),
    )

    def then(outcome: Outcome) -> None:
        app.note_file("Backup", second)
        if _ended(app, outcome, second):
            app.writing = Writing()
            prepare(app)
            result = "undone: everything is as it was before"
            app.writing = replace(app.writing, result=result, undone=True)
            kept = app.work.kept  # a file that was saved as well is still there
            app.set_work(replace(app.work, kept="" if kept == _THE_VEHICLE else kept))

    app.run_task(
        WRITING,
        lambda progress: session.restore(
            backup, plan, second, _follow(app, progress), app.stopping.is_set
        ),
        then,
    )


def _backup(app: BaseApp) -> Path | None:
    vehicle = app.live.vehicle if app.live is not None else None
    try:
        return app.services.new_file("backup", ".param", vehicle)
    except MagcompError as error:
        app.complain(error)
        return None
