"""Fitting: in a thread, with progress; again at once where the pilot changes an option."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from magcomp.analysis import Options
from magcomp.errors import UsageError
from magcomp.model import Analysis, Recording
from magcomp.report.strip import loads
from magcomp.tui import writing
from magcomp.tui.base import BaseApp
from magcomp.tui.pictures import CompassPicture
from magcomp.tui.screens.dialogs import Fault
from magcomp.tui.screens.time_range import TimeRange
from magcomp.tui.services import Progress, fit
from magcomp.tui.widgets.flight_strip import Strip

_Answer = tuple[Recording, Analysis, Mapping[int, CompassPicture]]


def start(app: BaseApp, options: Options) -> None:
    """Fit the log, or what was recorded so far; the old answer stays until there is a new one."""
    session, recording = app.session, app.work.recording
    app.asked = options

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


def show_other(app: BaseApp) -> None:
    """Show another one of the fits tried."""
    if app.busy is None:
        app.set_work(app.work.with_other_fit())
        app.asked = app.work.options
        writing.prepare(app)


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
    strip = Strip(() if recording is None else loads(recording), whole, start_s, end_s)
    dialog = TimeRange(strip, check=partial(_range_fault, whole))

    def take(answer: tuple[str, ...] | None) -> None:
        if answer is None:
            return
        first, last = map(float, answer)
        change(
            app,
            start=first if first > 0.0 else -math.inf,
            end=last if last < whole else math.inf,
        )

    app.push_screen(dialog, take)


def _range_fault(whole: float, answer: tuple[str, ...]) -> Fault | None:
    """What is wrong with a time range of a recording ``whole`` seconds long."""
    seconds = []
    for line, text in enumerate(answer):
        try:
            seconds.append(float(text))
        except ValueError:
            return Fault(line, f"A time must be seconds such as 12.5; instead received {text!r}.")
    first, last = seconds
    if not 0.0 <= first < whole:
        return Fault(0, f"The start must be from 0 to {whole:.0f} s; instead received {first:g} s.")
    if not first < last:
        return Fault(1, f"The end must be after the start; instead received {last:g} s.")
    return None
