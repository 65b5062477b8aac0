"""Every screen with made-up content, for snapshots and for the pictures of the documentation."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import scripted
from scripted import ScriptedSession, steady, until

from magcomp.analysis import Options
from magcomp.live.situation import Situation
from magcomp.model import Grade
from magcomp.tui import MagcompApp, writing
from magcomp.tui.changes import READ_BACK
from magcomp.tui.promise import Promise
from magcomp.tui.screens.dialogs import Confirm, Message
from magcomp.tui.status import STEPS
from magcomp.tui.work import Work

BACKUP = Path("backup-ardupilot-1-20250615T150640Z.param")
SIZES = ((80, 24), (120, 40))

Stage = Callable[[Any], Awaitable[None]]


def app(folder: Path) -> MagcompApp:
    """An app whose vehicle stands still in time."""
    return scripted.app(folder)


async def _live(pilot: Any, step: str, work: Work, **changes: object) -> None:
    app = pilot.app
    await until(pilot, lambda: app.choices)
    app.set_work(work)
    app.follow(ScriptedSession(made.snapshot(**changes)))
    await until(pilot, lambda: app.live)
    writing.prepare(app)
    app.action_go(step)
    await until(pilot, lambda: app.current_mode == step and app.screen.is_current)


async def _log(pilot: Any, step: str, *grades: Grade) -> None:
    app = pilot.app
    await until(pilot, lambda: app.choices)
    app.set_work(made.work(*grades))
    writing.prepare(app)
    app.action_go(step)
    await until(pilot, lambda: app.current_mode == step)


async def connect(pilot: Any) -> None:
    await until(pilot, lambda: pilot.app.choices)


async def connect_vehicle(pilot: Any) -> None:
    await _live(pilot, "connect", made.work(live=True))


async def record(pilot: Any) -> None:
    await _live(pilot, "record", made.work(live=True))


async def record_link_lost(pilot: Any) -> None:
    await _live(pilot, "record", made.work(live=True), connected=False)


async def fit_heading(pilot: Any) -> None:
    await _log(pilot, "fit")


async def fit_shift(pilot: Any) -> None:
    await _log(pilot, "fit")
    await pilot.press("v")


async def fit_unexplained(pilot: Any) -> None:
    await _log(pilot, "fit")
    await pilot.press("v", "v")


async def fit_verdict(pilot: Any) -> None:
    await _log(pilot, "fit", Grade.GOOD, Grade.MARGINAL, Grade.REJECTED)
    await pilot.press("v", "v", "v", "2")


async def fit_fits(pilot: Any) -> None:
    await _log(pilot, "fit", Grade.GOOD, Grade.GOOD)
    app = pilot.app
    for method, grade in (("levels", Grade.MARGINAL), ("sweep", Grade.REJECTED)):
        other = made.analysis(grade, Grade.GOOD)
        work = replace(app.work, options=Options(method=method))
        app.set_work(work.with_analysis(other, made.pictures(other)))
    app.action_other_fit()
    await pilot.press("v", "v", "v", "v")


async def review_log(pilot: Any) -> None:
    await _log(pilot, "review", Grade.GOOD, Grade.GOOD, Grade.REJECTED)


async def review(pilot: Any) -> None:
    await _live(pilot, "review", made.work(live=True), armed=False)


async def review_question(pilot: Any) -> None:
    await review(pilot)
    lines = (
        f"Write 13 parameters of compasses 1, 2 and 3?\nThe old values are saved first, in {BACKUP}"
    )
    pilot.app.push_screen(Confirm("Write to the vehicle?", lines, yes="Write", no="Cancel"))
    await until(pilot, lambda: isinstance(pilot.app.screen, Confirm))


async def review_written(pilot: Any) -> None:
    await review(pilot)
    app = pilot.app
    rows = tuple(replace(row, state=READ_BACK) for row in app.writing.rows)
    result = f"all {len(rows)} parameters read back as written"
    held = made.parameters()
    app.writing = replace(
        app.writing, rows=rows, result=result, before=held, in_force=held, backup=BACKUP
    )
    app.set_work(replace(app.work, kept="the vehicle"))
    app.redraw()
    await pilot.pause()


async def verify(pilot: Any) -> None:
    await _live(pilot, "verify", made.work(live=True), situation=Situation.STILL)


async def verify_moved(pilot: Any) -> None:
    await verify(pilot)
    app = pilot.app
    app.session.change(current=0.0, throttle=0.0)
    await until(pilot, lambda: app.live is app.session.shown)
    await pilot.press("m")
    compasses = []
    for compass in app.session.shown.compasses:
        x, y, z = compass.field
        moved = (x + 24.0 * 1.5, y - 24.0 * 2.25, z + 12.0)
        compasses.append(replace(compass, field=moved, heading_deg=compass.heading_deg + 12.0))
    app.session.change(current=24.0, throttle=0.42, elapsed_s=95.0, compasses=tuple(compasses))
    await until(pilot, lambda: app.live is app.session.shown)


async def verify_measured(pilot: Any) -> None:
    await _live(pilot, "verify", made.work(live=True), armed=False, situation=Situation.FLYING)
    app = pilot.app
    held = made.parameters()
    app.writing = replace(
        app.writing,
        before=held,
        in_force=held,
        measured=tuple(
            Promise(compass, 24.0, "current", 0.4, measured, 0.1)
            for compass, measured in ((1, 0.3), (2, 0.45), (3, 1.2))
        ),
    )
    app.redraw()


async def trouble(pilot: Any) -> None:
    await fit_heading(pilot)
    await steady(pilot)  # what lies behind a dialog stays as it was drawn last
    message = Message(
        "That did not work",
        "made.tlog must hold a throttle that changes; instead it holds only current.",
        "Record again with what is missing, or choose another regressor.",
    )
    pilot.app.push_screen(message)
    await until(pilot, lambda: isinstance(pilot.app.screen, Message))


async def help_for_fit(pilot: Any) -> None:
    await fit_heading(pilot)
    await steady(pilot)
    await pilot.press("f1")


async def fit_in_sunlight(pilot: Any) -> None:
    await fit_heading(pilot)
    await pilot.press("l")


async def record_in_sunlight(pilot: Any) -> None:
    await record(pilot)
    await pilot.press("l")


STAGES: tuple[Stage, ...] = (
    connect,
    connect_vehicle,
    record,
    record_link_lost,
    record_in_sunlight,
    fit_heading,
    fit_shift,
    fit_unexplained,
    fit_verdict,
    fit_fits,
    fit_in_sunlight,
    review_log,
    review,
    review_question,
    review_written,
    verify,
    verify_moved,
    verify_measured,
    trouble,
    help_for_fit,
)

__all__ = ["SIZES", "STAGES", "STEPS", "app"]
