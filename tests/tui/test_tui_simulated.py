"""The whole road on the simulated vehicle: connect, record, fit, write, verify, undo."""

from __future__ import annotations

from functools import partial

import live_vehicle
import numpy as np
import pytest
import scripted
from scripted import screen

from magcomp.live.session import LiveSession
from magcomp.sources import read
from magcomp.tui import opening, watcher
from magcomp.tui.screens.dialogs import Confirm
from magcomp.tui.services import Services


async def until(pilot, true) -> None:
    """Pilot's own way waits for an idle process, and the simulated vehicle never is."""
    await scripted.until(pilot, true, idle=False, look_s=0.05)


async def tap(pilot, key: str) -> None:
    """Press a key, and let the app finish what it starts."""
    pilot.app.simulate_key(key)
    await pilot.pause(0.05)
    await until(pilot, lambda: pilot.app.busy is None)


@pytest.fixture(autouse=True)
def _little_to_do(monkeypatch):
    """A busy computer has to simulate, receive, fit and draw at once: less of each will do."""
    slower = partial(LiveSession.open, rates=live_vehicle.RATES, refit_share=0.0)
    monkeypatch.setattr(LiveSession, "open", slower)
    monkeypatch.setattr(watcher, "EVERY_S", 0.5)


async def test_the_whole_road(tmp_path):
    usual = Services()
    with live_vehicle.alive("sweep", seed=4, speed=20.0) as flown:
        before = dict(flown.vehicle.parameters)
        app = scripted.app(tmp_path, flown.address, open_live=usual.open_live)
        async with app.run_test(size=(120, 40)) as pilot:
            await until(pilot, lambda: app.work.card is not None and app.busy is None)
            await tap(pilot, "n")
            await until(pilot, lambda: app.live.armed and "ARMED" in screen(app))
            await until(pilot, lambda: app.live.armed is False)
            await tap(pilot, "n")
            await until(pilot, lambda: app.work.analysis is not None)
            assert app.work.analysis.grade == "marginal"
            await tap(pilot, "n")
            await tap(pilot, "w")
            await until(pilot, lambda: isinstance(app.screen, Confirm))
            await tap(pilot, "y")
            await until(pilot, lambda: app.work.kept)
            for row in app.writing.rows:
                assert np.float32(flown.vehicle.parameters[row.name]) == np.float32(row.new)
            found = [flown.vehicle.parameters[f"COMPASS_MOT_{axis}"] for axis in "XYZ"]
            exact = -flown.vehicle.truth.interference
            assert np.linalg.norm(found - exact) < 0.1 * np.linalg.norm(exact)

            await tap(pilot, "n")
            await until(pilot, lambda: "worked out from the backup" in screen(app))
            await tap(pilot, "b")
            await tap(pilot, "u")
            await until(pilot, lambda: isinstance(app.screen, Confirm))
            await tap(pilot, "y")
            await until(pilot, lambda: "Undone" in screen(app))
            after = flown.vehicle.parameters
            assert {name: after[name] for name in before} == before
            recorded = app.live.recording_path
            opening.close(app)
        assert read(recorded).duration_s > 60.0
