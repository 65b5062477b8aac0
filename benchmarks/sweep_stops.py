"""How long a motor runs on when something befalls a sweep, on a simulated vehicle's own clock.

    python benchmarks/sweep_stops.py

Each row is a sweep of its own: in the middle of its first step something happens, and the vehicle
is watched for 3 s more. The run-on is by the simulated vehicle's own clock, to 10 ms. ArduPilot
lets nobody arm while a motor test runs, so there it is armed between two steps.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from magcomp.errors import MagcompError
from magcomp.sweeping.events import Reason

TESTS = Path(__file__).resolve().parent.parent / "tests"
WATCHED_S = 3.0
STILL_S = 0.25


class Killed(BaseException):
    """The program is gone."""


def kill(bench: Any) -> Reason | None:
    """What a killed program would still say, nobody hears."""
    bench.cable.spoken = False
    raise Killed


def pull(bench: Any) -> Reason | None:
    """No frame passes any more, either way."""
    bench.cable.heard = bench.cable.spoken = False
    return None


def deafen(bench: Any) -> Reason | None:
    """The ground hears nothing any more."""
    bench.cable.heard = False
    return None


def mute(bench: Any) -> Reason | None:
    """The vehicle hears nothing any more."""
    bench.cable.spoken = False
    return None


def arm(bench: Any) -> Reason | None:
    """Somebody arms it, at the transmitter."""
    bench.vehicle.arm()
    return None


class ArmedBetween:
    """Arms the vehicle between the first step and the second.

    Not before the step's own last command has come, which ends a motor test and disarms with it.
    """

    def __init__(self) -> None:
        self.at: float | None = None

    def __call__(self, bench: Any) -> Reason | None:
        """Look whether it is time."""
        spun = [time for time, motors in bench.cable.spun if motors]
        if self.at is None and spun and bench.now > spun[-1] + STILL_S:
            self.at = bench.now
            arm(bench)
        return None


DONE: dict[str, Callable[[Any], Reason | None]] = {
    "a key": lambda _: Reason.KEY,
    "Ctrl-C": lambda _: Reason.INTERRUPTED,
    "kill -9 of magcomp": kill,
    "the cable is pulled": pull,
    "nothing is heard of the vehicle": deafen,
    "the vehicle hears nothing": mute,
}
MOVED = {
    "it is tilted by 8°": {"tilt_rad": np.radians(8.0)},
    "it turns at 60° a second": {"turn_rad_s": np.radians(60.0)},
    "it is moved by 3 m": {"north_m": 3.0},
}


def ended(bench: Any, befalls: Callable[[Any], Reason | None] | None = None) -> str:
    """Carry a sweep out to its end, and say what that was."""
    try:
        outcome = bench.sweep() if befalls is None else bench.sweep(befalls)
    except (Killed, MagcompError) as error:
        return type(error).__name__.lower()
    return "nothing" if outcome.reason is None else str(outcome.reason.value)


def main() -> None:
    sys.path.insert(0, str(TESTS))
    rig = importlib.import_module("sweep_bench")
    print(f"{'what befell':<34}{'autopilot':<12}{'run-on, s':>10}  ended by")
    for autopilot in ("ardupilot", "px4"):
        own = {"autopilot": autopilot, "rates": rig.RATES[autopilot]}
        for name, does in DONE.items():
            bench, once = rig.Bench(**own), rig.Once(does)
            told(bench, name, autopilot, ended(bench, once), once.at)
        bench, armed = (
            rig.Bench(**own),
            ArmedBetween() if autopilot == "ardupilot" else rig.Once(arm),
        )
        told(bench, "it is armed", autopilot, ended(bench, armed), armed.at)
        for name, how in MOVED.items():
            bench = rig.Bench(rig.Befallen(rig.MID_STEP_S, **how), **own)
            told(bench, name, autopilot, ended(bench), rig.MID_STEP_S)


def told(bench: Any, name: str, autopilot: str, by: str, since: float | None) -> None:
    """One row, once the vehicle was watched for a while more."""
    bench.hear(WATCHED_S)
    # What never befell has no run-on.
    run_on = np.nan if since is None else max(bench.cable.last_spun_s - since, 0.0)
    still = "" if not bench.vehicle.spinning else "  STILL SPINS"
    print(f"{name:<34}{autopilot:<12}{run_on:>10.2f}  {by}{still}", flush=True)


if __name__ == "__main__":
    main()
