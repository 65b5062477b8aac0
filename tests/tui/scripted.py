"""A vehicle that does what the test says, and an app that works with it."""

from __future__ import annotations

import asyncio
import re
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import made
from textual.strip import Strip

from magcomp.errors import LinkError
from magcomp.live.situation import Manoeuvre
from magcomp.live.snapshot import LiveSnapshot
from magcomp.model import ParameterSet, Recording
from magcomp.tui import MagcompApp
from magcomp.tui.services import Services, Simulation
from magcomp.tui.settings import Settings
from magcomp.writing.events import (
    Event,
    Intends,
    Mismatch,
    Outcome,
    Progress,
    Reason,
    RollingBack,
    Stage,
    Standing,
    Written,
)
from magcomp.writing.files import read_parameter_file, write_parameter_file
from magcomp.writing.plan import WritePlan, plan

PATIENCE_S = 300.0
DEVICES = dict(zip(("", "2", "3"), made.QUAD.device_ids, strict=True))


@dataclass
class ScriptedSession:
    """A live session whose vehicle is a dictionary.

    Attributes
    ----------
    shown
        What `snapshot` gives.
    recorded
        What `recording` gives.
    held
        The vehicle's parameters.
    refuses
        A parameter it never takes; the write is rolled back then.
    trouble
        Raised by everything that speaks with the vehicle.
    acts
        What it shows of what was written, or why that cannot be looked at.
    slow
        A write does not end by itself; ``writing`` is set while it goes on.
    """

    shown: LiveSnapshot = field(default_factory=made.snapshot)
    recorded: Recording = field(default_factory=made.recording)
    held: dict[str, float] = field(default_factory=made.parameters)
    refuses: str = ""
    trouble: Exception | None = None
    closed: bool = False
    manoeuvre: Manoeuvre | None = None
    slow: bool = False
    acts: str | Exception = ""
    writing: threading.Event = field(default_factory=threading.Event)
    never: threading.Event = field(default_factory=threading.Event)

    def snapshot(self) -> LiveSnapshot:
        return self.shown

    def recording(self) -> Recording:
        return self.recorded

    def upload_plan(self, wanted: ParameterSet) -> WritePlan:
        if self.trouble is not None:
            raise self.trouble
        ids = {f"COMPASS_DEV_ID{number}": float(value) for number, value in DEVICES.items()}
        return plan({**self.held, **ids}, wanted, made.QUAD)

    def upload(
        self,
        plan: WritePlan,
        backup_path: Path,
        on_event: Callable[[Event], None],
        stop: Callable[[], bool],
    ) -> Outcome:
        write_parameter_file(backup_path, plan.backup)
        wanted = {change.name: change.new for change in plan.changes}
        on_event(Intends(Stage.WRITE, wanted))
        for number, (name, value) in enumerate(wanted.items(), start=1):
            while self.slow and not stop():
                self.writing.set()
                self.never.wait(0.01)
            if stop():
                return Outcome(Standing.OLD, Reason.STOPPED, "it was stopped")
            if name == self.refuses:
                on_event(Mismatch(name, value, self.held[name]))
                on_event(RollingBack(Reason.MISMATCH, f"{name} must read back"))
                outcome = Outcome(Standing.OLD, Reason.MISMATCH, f"{name} must read back")
                on_event(outcome)
                return outcome
            on_event(Written(name, value))
            on_event(Progress(Stage.VERIFY, name, number, len(wanted)))
        self.held.update(wanted)
        on_event(Outcome(Standing.NEW))
        return Outcome(Standing.NEW)

    def what_acts(self, plan: WritePlan) -> str:
        if isinstance(self.acts, Exception):
            raise self.acts
        return self.acts

    def restore_plan(self, backup: Path) -> WritePlan:
        return self.upload_plan(read_parameter_file(backup))

    def restore(
        self,
        backup: Path,
        plan: WritePlan,
        backup_path: Path,
        on_event: Callable[[Event], None],
        stop: Callable[[], bool],
    ) -> Outcome:
        return self.upload(plan, backup_path, on_event, stop)

    def close(self) -> None:
        self.closed = True

    def change(self, **changes: Any) -> None:
        """Let the vehicle say something else from now on."""
        self.shown = replace(self.shown, **changes)


def app(
    folder: Path,
    target: str = "",
    *,
    session: ScriptedSession | None = None,
    settings: Settings | None = None,
    ascii_only: bool = False,
    **services: Any,
) -> MagcompApp:
    """An app on made-up ports, a frozen clock, and a session where one is given."""

    def open_live(address: str, record: Path, system: int | None) -> ScriptedSession:
        if session is None:
            raise LinkError(f"{address} cannot be opened: nobody is there.")
        return session

    usual = {
        "ports": lambda: made.PORTS,
        "open_live": open_live,
        "simulate": lambda autopilot: Simulation("udp:127.0.0.1:14599", lambda: None),
        "now": lambda: datetime(2025, 6, 15, 15, 6, 40, tzinfo=UTC),
        "folder": folder / "flights",
    }
    return MagcompApp(
        target,
        settings=settings,
        ascii_only=ascii_only,
        folder=folder / "settings",
        services=Services(**{**usual, **services}),
    )


async def until(
    pilot: Any, true: Callable[[], object], *, idle: bool = True, look_s: float = 0.01
) -> None:
    """Let the app work until a condition holds, and then until there is nothing more to do."""
    deadline = time.monotonic() + PATIENCE_S
    while not true():
        if time.monotonic() > deadline:
            raise TimeoutError(f"the condition never held; the screen says:\n{picture(pilot.app)}")
        if pilot.app._exception is not None:
            raise pilot.app._exception
        await asyncio.sleep(look_s)
    if idle:
        await pilot.pause()


async def steady(pilot: Any) -> None:
    """Let the app work until nothing waits to be laid out or drawn, and the picture stays.

    However busy the machine is: what counts is that no message is on its way, not that the
    process has been quiet for a moment.
    """
    seen: list[list[Strip]] = []
    while len(seen) < 3 or any(each != seen[-1] for each in seen[-3:]):
        await pilot.pause()
        if _waits(pilot.app):
            seen.clear()
        else:
            seen.append(pilot.app.screen._compositor.render_strips())


def _waits(app: MagcompApp) -> bool:
    """Whether a message, a layout or a part of a screen, seen behind another or not, waits."""
    screens = app.screen_stack
    nodes = [app, *(node for each in screens for node in each.walk_children(with_self=True))]
    return bool(
        app.workers._workers
        or any(each._layout_required or each._layout_widgets for each in screens)
        or app.screen._dirty_widgets
        or any(node._message_queue is None or node._message_queue.qsize() for node in nodes)
    )


async def press(pilot: Any, *keys: str) -> None:
    """Press keys, and let the app finish what they started."""
    for key in keys:
        await pilot.press(key)
        await until(pilot, lambda: pilot.app.busy is None)


def picture(app: MagcompApp) -> str:
    """What stands on the screen or in the dialog over it, without colours, line by line."""
    strips = app.screen._compositor.render_strips()
    for dialog in app.screen.query(".dialog"):
        x, y, width, height = dialog.region
        strips = [strip.crop(x, x + width) for strip in strips[y : y + height]]
    return "\n".join("".join(part.text for part in strip).rstrip() for strip in strips) + "\n"


def screen(app: MagcompApp) -> str:
    """The words on the screen in order, wherever their lines end."""
    return " ".join(re.sub("[\u2500-\u257f\u2594\u2581]", " ", picture(app)).split())
