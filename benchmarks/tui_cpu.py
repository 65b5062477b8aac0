"""What the record screen costs, with link, buffer, recorder and refits, at 3 compasses of 50 Hz.

A simulated vehicle runs in a process of its own; the app runs headless here, draws ten times a
second, and the processor time of this process is measured. Promise: under a quarter of one core.

    python benchmarks/tui_cpu.py [SECONDS]
"""

from __future__ import annotations

import asyncio
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from magcomp.simulate import Vehicle, scenario, serve
from magcomp.tui import MagcompApp, opening
from magcomp.tui.services import Services

PROMISE = 0.25
PORT = 14587
SIZES = ((80, 24), (120, 40))


def fly() -> None:
    vehicle = Vehicle(scenario("flight", seed=7), wait_for_ground=True)
    serve(f"udp:127.0.0.1:{PORT}", vehicle)


async def until(true: Callable[[], object]) -> None:
    while not true():
        await asyncio.sleep(0.05)


async def measure(size: tuple[int, int], seconds: float) -> tuple[float, float, float]:
    """Share of a core, frames drawn a second, and compass messages a second."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        app = MagcompApp(
            f"udpout:127.0.0.1:{PORT}", folder=place, services=Services(folder=place / "flights")
        )
        async with app.run_test(size=size):
            await until(lambda: app.work.card is not None and app.busy is None)
            app.action_go("record")
            await asyncio.sleep(5.0)
            drawn, redraw = [0], app.redraw

            def count() -> None:
                drawn[0] += 1
                redraw()

            app.redraw = count  # type: ignore[method-assign]
            cpu, wall = time.process_time(), time.monotonic()
            await asyncio.sleep(seconds)
            share = (time.process_time() - cpu) / (time.monotonic() - wall)
            frames = drawn[0] / (time.monotonic() - wall)
            live = app.live
            names = ("RAW_IMU", "SCALED_IMU2", "SCALED_IMU3")
            rate = sum(live.link.rates.get(name, 0.0) for name in names) if live else 0.0
            await asyncio.to_thread(opening.close, app)
        return share, frames, rate


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
    for size in SIZES:
        vehicle = multiprocessing.get_context("spawn").Process(target=fly, daemon=True)
        vehicle.start()
        share, frames, rate = asyncio.run(measure(size, seconds))
        vehicle.terminate()
        vehicle.join()
        verdict = "kept" if share < PROMISE else "BROKEN"
        print(
            f"{size[0]}x{size[1]}: {100 * share:.1f} % of a core, {frames:.1f} draws/s, "
            f"{rate:.0f} compass messages/s; promise under {100 * PROMISE:.0f} %: {verdict}"
        )


if __name__ == "__main__":
    main()
