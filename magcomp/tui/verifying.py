"""After a write: the next time the motors ran, what was promised is compared with what came."""

from __future__ import annotations

from dataclasses import replace

from magcomp.model import Verdict
from magcomp.tui.base import BaseApp
from magcomp.tui.promise import promises
from magcomp.tui.services import Progress, judge_since


def watch_flight(app: BaseApp) -> None:
    """Judge what was written once the motors have run with it and stand again."""
    live, writing = app.live, app.writing
    if live is None or not writing.in_force or live.armed is None:
        return
    if live.armed:
        if not writing.flying:
            app.writing = replace(writing, flying=True)
    elif writing.flying and app.busy is None:
        app.writing = replace(writing, flying=False)
        _judge(app)


def _judge(app: BaseApp) -> None:
    session, analysis, since_s = app.session, app.writing.promised, app.writing.since_s
    if session is None or analysis is None:
        return

    def task(_: Progress) -> dict[int, Verdict]:
        return dict(judge_since(session.recording(), since_s))

    def then(verdicts: dict[int, Verdict]) -> None:
        found = promises(analysis, verdicts)
        text = "" if found else "This flight was too short to measure what was written."
        app.writing = replace(app.writing, measured=found, measured_trouble=text)

    app.run_task("judging this flight", task, then)
