"""A sweep from the screen: the name, the screen while motors spin, and what any key does."""

from __future__ import annotations

import made
import pytest
import scripted
from scripted import PATIENCE_S, ScriptedSession, press, screen, until
from textual.widgets import Input

from magcomp.errors import VehicleRefusedError
from magcomp.live.situation import Situation
from magcomp.live.sweep import Bench
from magcomp.sweeping.events import Begun, Outcome, Reason, Stopping, Told
from magcomp.sweeping.steps import Measured, Step
from magcomp.tui import fitting, opening, sweeping
from magcomp.tui.screens.dialogs import AskText, Message
from magcomp.tui.screens.sweeping import Sweeping

NAME = "copter-1"


def on_the_ground(tmp_path, sweep, make_ready=lambda *_: Bench(made.QUAD, 4, 0.5)):
    session = ScriptedSession(made.snapshot(armed=False, situation=Situation.STILL))
    return scripted.app(tmp_path, session=session, make_ready=make_ready, sweep=sweep)


async def asked(pilot) -> None:
    """Connected, on the record screen, and asked for the name."""
    opening.open_target(pilot.app, "udp:1:2")
    await until(pilot, lambda: pilot.app.work.card is not None and pilot.app.busy is None)
    pilot.app.action_go("record")
    await until(pilot, lambda: pilot.app.current_mode == "record")
    await press(pilot, "g")
    await until(pilot, lambda: isinstance(pilot.app.screen, AskText))


async def named(pilot) -> None:
    """The name is given as it was asked for."""
    await asked(pilot)
    pilot.app.screen.query(Input).first().value = NAME
    await pilot.press("enter")


class Spinning:
    """A sweep that goes on until it is stopped."""

    def __init__(self) -> None:
        self.typed = ""
        self.most = 0.0

    def __call__(self, session, bench, typed, pressed, tell) -> Outcome:
        self.typed, self.most = typed, bench.most
        tell(Told(Measured(Step((1,), 0.3), 1.25)))
        tell(Begun(Step((1, 2, 3, 4), 0.5), 2))
        while (reason := pressed()) is None:
            session.never.wait(0.01)
        tell(Stopping(reason, reason.value))
        return Outcome((), reason, reason.value)


@pytest.mark.parametrize("key", ["space", "x", "escape", "ctrl+c", "f1", "q"])
async def test_any_key_stops(tmp_path, monkeypatch, key):
    # A computer that is busy with other tests may draw late.
    monkeypatch.setattr(sweeping, "DEAF_S", PATIENCE_S)
    sweep = Spinning()
    async with on_the_ground(tmp_path, sweep).run_test() as pilot:
        await named(pilot)
        await until(pilot, lambda: "all 4 motors at 50%" in screen(pilot.app))
        shown = screen(pilot.app)
        assert "motor 1 at 30%: 1.2 A" in shown
        assert "Any key stops at once" in shown
        await pilot.press(key)
        await until(pilot, lambda: isinstance(pilot.app.screen, Message))
        assert "All motors were told to stand still after 0 steps." in screen(pilot.app)
    assert (sweep.typed, sweep.most) == (NAME, 0.5)


async def test_a_screen_that_takes_no_key_any_more_stops_too(tmp_path, monkeypatch):
    sweep = Spinning()
    async with on_the_ground(tmp_path, sweep).run_test() as pilot:
        monkeypatch.setattr(Sweeping, "silent_s", sweeping.DEAF_S + 1.0)
        await named(pilot)
        await until(pilot, lambda: isinstance(pilot.app.screen, Message))
        assert "the screen takes no key any more" in screen(pilot.app)


async def test_another_name_and_another_strength_are_refused_where_they_stand(tmp_path):
    sweep = Spinning()
    async with on_the_ground(tmp_path, sweep).run_test() as pilot:
        await asked(pilot)
        await press(pilot, *"yes", "enter")
        await until(pilot, lambda: "instead received 'yes'" in screen(pilot.app))
        await press(pilot, "ctrl+u", *NAME, "tab", *"95", "enter")
        await until(pilot, lambda: "must be 10 to 90 %" in screen(pilot.app))
        await press(pilot, "escape")
        await until(pilot, lambda: not isinstance(pilot.app.screen, AskText))
    assert sweep.typed == ""


async def test_a_whole_sweep_goes_on_to_its_fit(tmp_path, monkeypatch):
    fitted = []
    monkeypatch.setattr(fitting, "start", lambda _, options: fitted.append(options))

    def sweep(session, bench, typed, pressed, tell):
        return Outcome((Measured(Step((1,), 0.3), 1.25),))

    async with on_the_ground(tmp_path, sweep).run_test() as pilot:
        await asked(pilot)
        await press(pilot, *NAME, "enter")
        await until(pilot, lambda: fitted)
        assert pilot.app.current_mode == "fit"
    assert (fitted[0].method, fitted[0].regressor) == ("sweep", "current")


@pytest.mark.parametrize("reason", [Reason.TILTED, Reason.LINK_LOST])
async def test_what_stopped_it_is_said(tmp_path, reason):
    def sweep(session, bench, typed, pressed, tell):
        return Outcome((), reason, "the vehicle tilted by 8°")

    async with on_the_ground(tmp_path, sweep).run_test() as pilot:
        await named(pilot)
        await until(pilot, lambda: isinstance(pilot.app.screen, Message))
        assert "The sweep was stopped because the vehicle tilted by 8°" in screen(pilot.app)
        assert not any(isinstance(each, Sweeping) for each in pilot.app.screen_stack)


async def test_a_vehicle_that_cannot_be_swept_is_not_asked_for(tmp_path):
    def refuse(*_):
        raise VehicleRefusedError("The vehicle must be disarmed; instead it is armed")

    async with on_the_ground(tmp_path, Spinning(), refuse).run_test() as pilot:
        opening.open_target(pilot.app, "udp:1:2")
        await until(pilot, lambda: pilot.app.work.card is not None and pilot.app.busy is None)
        pilot.app.action_sweep()
        await until(pilot, lambda: isinstance(pilot.app.screen, Message))
        assert "must be disarmed" in screen(pilot.app)
