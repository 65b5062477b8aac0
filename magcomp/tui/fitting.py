"""Fitting: in a thread, with progress; again at once where the pilot changes an option."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from magcomp.analysis import Options
from magcomp.errors import UsageError
from magcomp.model import Analysis, Recording
from magcomp.tui import writing
from magcomp.tui.base import BaseApp
from magcomp.tui.pictures import CompassPicture
from magcomp.tui.screens.dialogs import AskText
from magcomp.tui.services import Progress, fit

_Answer = tuple[Recording, Analysis, Mapping[int, CompassPicture]]


def start(app: BaseApp, options: Options) -> None:
    """Fit the log, or what was recorded so far; the old answer stays until there is a new one."""
    session, recording = app.session, app.work.recording

    def task(progress: Progress) -> _Answer:
        used = session.recording() if session is not None else recording
        if used is None:
            raise UsageError("There must be a recording to fit; instead nothing is open")
        return used, *fit(used, options, progress)

    def then(answer: _Answer) -> None:
        used, analysis, pictures = answer
        work = replace(app.work, recording=used, options=options)
        app.set_work(work.with_analysis(analysis, pictures))
        writing.prepare(app)

    app.run_task("fitting", task, then)


def again(app: BaseApp) -> None:
    """Fit once more, with what came since."""
    start(app, app.work.options)


def change(app: BaseApp, **changed: Any) -> None:
    """Fit with other options."""
    try:
        options = replace(app.work.options, **changed)
    except UsageError as error:
        app.complain(error)
        return
    start(app, options)


def ask_time_range(app: BaseApp) -> None:
    """Ask which part of the recording to fit, and fit it."""
    options, recording = app.work.options, app.work.recording
    whole = 0.0 if recording is None else recording.duration_s
    start_s, end_s = max(options.start, 0.0), min(options.end, whole)
    dialog = AskText(
        "Time range",
        f"Which part to fit, in seconds; the recording is {whole:.0f} s long.",
        (("From", f"{start_s:g}"), ("To", f"{end_s:.0f}")),
    )

    def take(answer: tuple[str, ...] | None) -> None:
        if answer is None:
            return
        try:
            start_, end = (_seconds(text) for text in answer)
            bounds = (start_ if start_ > 0.0 else -float("inf"), end)
            change(app, start=bounds[0], end=bounds[1] if end < whole else float("inf"))
        except UsageError as error:
            app.complain(error)

    app.push_screen(dialog, take)


def _seconds(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise UsageError(
            f"A time must be seconds such as 12.5; instead received {text!r}"
        ) from error
