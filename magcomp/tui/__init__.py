"""The terminal screen a pilot works in. Only this package knows Textual."""

from __future__ import annotations

import os
import sys
from functools import partial
from pathlib import Path

from magcomp.report.ascii import is_ascii_only
from magcomp.tui.app import MagcompApp
from magcomp.tui.services import Services, open_live, read_log
from magcomp.tui.settings import read_settings, settings_folder


def run(
    target: str = "",
    *,
    folder: Path | None = None,
    system: int | None = None,
    component: int | None = None,
    theme: str = "",
) -> int:
    """Run the app in this terminal until the pilot leaves it.

    Parameters
    ----------
    target
        An address or a log to begin with; empty for none.
    folder
        Where settings and state are; the platform's place by default.
    system, component
        MAVLink system to work with, and its autopilot's component where it is not 1.
    theme
        Theme for this time; that of the settings where empty.

    Returns
    -------
    int
        Exit code.

    Raises
    ------
    UsageError
        The settings file holds what it must not.
    """
    place = settings_folder() if folder is None else folder
    settings = read_settings(place)
    services = Services(
        folder=settings.folder,
        read=partial(read_log, component=component),
        open_live=partial(open_live, component=component),
    )
    terminal = sys.__stderr__  # what Textual draws on
    app = MagcompApp(
        target,
        settings=settings,
        folder=place,
        services=services,
        system=system,
        ascii_only=is_ascii_only(terminal.encoding if terminal else None, os.environ),
    )
    if theme:
        app.theme = theme
    app.run()
    return app.return_code or 0


__all__ = ["MagcompApp", "run"]
