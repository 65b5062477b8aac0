"""The programmes by name, each with the vehicle it is flown with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from magcomp.errors import UsageError
from magcomp.simulate.flight import Flight
from magcomp.simulate.motion import Program
from magcomp.simulate.timeline import paper_turntable, sweep, turntable
from magcomp.simulate.truth import Truth, draw_truth, on_the_papers_bench

STABILIZE, GUIDED, LOITER = 0, 4, 5


@dataclass(frozen=True)
class Scenario:
    """A vehicle and what it does.

    Attributes
    ----------
    truth
        The vehicle.
    program
        What it does.
    mode
        ArduCopter's flight mode while it does it.
    """

    truth: Truth
    program: Program
    mode: int


def _turntable(seed: int, calibrated: bool | None, wrong_motor: bool) -> Scenario:
    truth = draw_truth(seed, "rig", calibrated=bool(calibrated), wrong_motor=wrong_motor)
    return Scenario(truth, turntable(seed), STABILIZE)


def _paper(seed: int, calibrated: bool | None, wrong_motor: bool) -> Scenario:
    truth = draw_truth(seed, "rig", calibrated=bool(calibrated), wrong_motor=wrong_motor)
    return Scenario(on_the_papers_bench(truth), paper_turntable(), STABILIZE)


def _sweep(seed: int, calibrated: bool | None, wrong_motor: bool) -> Scenario:
    known = calibrated is not False
    truth = draw_truth(seed, "sweep", calibrated=known, wrong_motor=wrong_motor)
    return Scenario(truth, sweep(seed), STABILIZE)


def _flight(seed: int, calibrated: bool | None, wrong_motor: bool) -> Scenario:
    known = calibrated is not False
    truth = draw_truth(seed, "flight", calibrated=known, wrong_motor=wrong_motor)
    return Scenario(truth, Flight(seed), LOITER)


PROGRAMS: Mapping[str, Callable[[int, bool | None, bool], Scenario]] = {
    "turntable": _turntable,
    "turntable_paper": _paper,
    "sweep": _sweep,
    "flight": _flight,
}
"""What ``--program`` may name."""


def scenario(
    program: str, seed: int, *, calibrated: bool | None = None, wrong_motor: bool = False
) -> Scenario:
    """Draw the vehicle of a programme.

    Parameters
    ----------
    program
        A name of :data:`PROGRAMS`.
    seed
        Same seed, same vehicle, same movements.
    calibrated
        Whether the exact offsets and soft iron are in force at boot; None takes what is usual:
        not on a turntable, else yes.
    wrong_motor
        Whether a wrong motor compensation is in force at boot.

    Raises
    ------
    UsageError
        For a name that is no programme.
    """
    if program not in PROGRAMS:
        raise UsageError(
            f"The simulated vehicle's programme must be one of {', '.join(PROGRAMS)}; "
            f"instead received {program!r}"
        )
    return PROGRAMS[program](seed, calibrated, wrong_motor)
