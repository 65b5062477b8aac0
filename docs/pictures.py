"""Makes the pictures of docs/tui.md: the app itself, on a simulated vehicle, exported as SVG.

    python docs/pictures.py [FOLDER]

Takes about five minutes, because the vehicle really flies.
"""

from __future__ import annotations

import asyncio
import sys
import tempfile
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from magcomp.simulate import Vehicle, scenario, serve
from magcomp.tui import MagcompApp, opening
from magcomp.tui.services import Services, Simulation
from magcomp.tui.settings import Settings

SIZE = (118, 38)
SPEED = 1.5


def simulate(autopilot: str) -> Simulation:
    """A vehicle, a little faster than life: the fits so far must keep up with it."""
    stop, ready, address = threading.Event(), threading.Event(), []

    def announce(reached_at: str) -> None:
        address.append(reached_at)
        ready.set()

    vehicle = Vehicle(scenario("flight", seed=11), wait_for_ground=True, autopilot=autopilot)
    options = {"speed": SPEED, "announce": announce, "stop": stop}
    threading.Thread(
        target=serve, args=("udp:127.0.0.1:0", vehicle), kwargs=options, daemon=True
    ).start()
    ready.wait()
    return Simulation(address[0], stop.set, vehicle.fly_again)


async def until(true: Callable[[], Any]) -> None:
    while not true():
        await asyncio.sleep(0.05)
    await asyncio.sleep(0.5)


async def connect(app: MagcompApp) -> None:
    app.services = replace(app.services, simulate=simulate)
    await until(lambda: app.choices)
    app.action_simulate()
    await until(lambda: app.work.card is not None and app.busy is None)


async def fit(app: MagcompApp) -> None:
    app.action_go("fit")
    await until(lambda: app.work.analysis is not None)


async def fly_and_write(app: MagcompApp, keep: Callable[[str], None]) -> None:
    await connect(app)
    keep("tui-connect")
    app.action_go("record")
    await until(lambda: app.live and app.live.bound and app.live.guidance.share_done > 0.6)
    keep("tui-record")
    app.action_light()
    await asyncio.sleep(0.5)
    keep("tui-record-sun")
    app.action_light()
    await until(lambda: app.live and app.live.armed is False)
    await fit(app)
    keep("tui-fit")
    app.action_go("review")
    await asyncio.sleep(0.5)
    app.action_write()
    await until(lambda: app.screen.query(".dialog"))
    app.screen.dismiss(True)
    await until(lambda: app.work.kept)
    keep("tui-write")
    app.action_go("verify")
    app.action_fly_again()
    await until(lambda: app.writing.measured)
    keep("tui-verify")


async def main(folder: Path, place: Path) -> None:
    app = MagcompApp(folder=place, services=Services(folder=place), settings=Settings())

    def keep(name: str) -> None:
        app.save_screenshot(f"{name}.svg", str(folder))

    async with app.run_test(size=SIZE):
        await fly_and_write(app, keep)
        await asyncio.to_thread(opening.close, app)


if __name__ == "__main__":
    where = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    with tempfile.TemporaryDirectory() as scratch:
        asyncio.run(main(where, Path(scratch)))
