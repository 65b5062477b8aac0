"""All of the paper's experiments at once, on a simulated vehicle and on recordings."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from magcomp import __version__
from magcomp.experiments.mission import Flights, flights
from magcomp.experiments.paper import TABLE_1
from magcomp.experiments.turntable import Turntable, turntable
from magcomp.model import Recording
from magcomp.report.as_json import SCHEMA
from magcomp.simulate import write_tlog
from magcomp.sources import read
from magcomp.sources.truth import Truth, read_truth

TURNTABLE = "turntable_paper.tlog"
UNCOMPENSATED = "mission_uncompensated.tlog"
COMPENSATED = "mission_compensated.tlog"
RECORDINGS = (TURNTABLE, UNCOMPENSATED, COMPENSATED)
"""Files of the recordings' directory that the experiments are carried out on."""

_DECIMALS = 6

Progress = Callable[[str, float], None]
"""What is being done, and the share done, 0 … 1."""


@dataclass(frozen=True, eq=False)
class Experiments:
    """Both experiments on one kind of vehicle.

    Attributes
    ----------
    turntable
        Figs 3 to 7 and Table 1.
    flights
        Figs 8 and 9.
    """

    turntable: Turntable
    flights: Flights


@dataclass(frozen=True, eq=False)
class Reproduction:
    """The paper's experiments.

    Attributes
    ----------
    simulated
        On magcomp's own simulated vehicle.
    recorded
        On recordings of the real firmware; None where they are not at hand.
    """

    simulated: Experiments
    recorded: Experiments | None

    def document(self) -> dict[str, Any]:
        """The numbers, as table.json holds them: ``recorded`` is empty without recordings."""
        kinds = {"simulated": self.simulated, "recorded": self.recorded}
        rows = {
            name: [] if made is None else [_short(asdict(row)) for row in made.turntable.rows]
            for name, made in kinds.items()
        }
        flown = {
            name: None if made is None else _flights(made.flights) for name, made in kinds.items()
        }
        paper = [asdict(row) for row in TABLE_1]
        head = {"magcomp": __version__, "schema": SCHEMA}
        return {**head, **rows, "paper": paper, "flights": flown}


def reproduce(
    recordings: Path | None,
    *,
    seed: int = 1,
    compass: int = 1,
    progress: Progress = lambda _what, _share: None,
) -> Reproduction:
    """Carry out the paper's experiments.

    Parameters
    ----------
    recordings
        Directory that holds :data:`RECORDINGS`; None to do without.
    seed
        Of the simulated vehicles.
    compass
        1, 2 or 3: the one that is put on the turntable.
    progress
        Called as the work goes on.

    Raises
    ------
    LogError, MissingDataError
        Where a recording cannot be read or is not what its name says.
    """
    steps = 5 if recordings is None else 8
    done = 0

    def begin(what: str) -> None:
        nonlocal done
        progress(what, done / steps)
        done += 1

    with tempfile.TemporaryDirectory(prefix="magcomp-") as directory:
        folder = Path(directory)
        begin("simulating the turntable")
        write_tlog(folder / TURNTABLE, program="turntable_paper", seed=seed)
        begin("simulating the mission without compensation")
        write_tlog(folder / UNCOMPENSATED, program="mission", seed=seed)
        begin("simulating the mission with compensation")
        write_tlog(folder / COMPENSATED, program="mission", seed=seed, compensation="exact")
        simulated = _experiments(folder, compass, "the simulation", begin)
    recorded = None
    if recordings is not None:
        recorded = _experiments(recordings, compass, "the recordings", begin)
    progress("done", 1.0)
    return Reproduction(simulated, recorded)


def _experiments(
    folder: Path, compass: int, whose: str, begin: Callable[[str], None]
) -> Experiments:
    begin(f"turning, {whose}")
    turned = turntable(*_both(folder / TURNTABLE), compass)
    begin(f"flying, {whose}")
    flown = flights(_both(folder / UNCOMPENSATED), _both(folder / COMPENSATED))
    return Experiments(turned, flown)


def _both(path: Path) -> tuple[Recording, Truth]:
    return read(path), read_truth(path)


def _flights(flown: Flights) -> dict[str, Any]:
    courses = {
        "uncompensated": flown.uncompensated.believed,
        "compensated": flown.compensated.believed,
        "fused": flown.fused,
    }
    errors = {
        name: _short({"largest_deg": course.largest_deg, "rms_deg": course.rms_deg})
        for name, course in courses.items()
    }
    return {**errors, "paths_apart_m": round(flown.apart_m, _DECIMALS)}


def _short(row: dict[str, Any]) -> dict[str, Any]:
    return {
        key: round(value, _DECIMALS) if isinstance(value, float) else value
        for key, value in row.items()
    }
