"""The programmes by name, each with the vehicle it is flown with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal

from magcomp.errors import UsageError
from magcomp.simulate.flight import Flight
from magcomp.simulate.mission import Mission
from magcomp.simulate.motion import Program
from magcomp.simulate.timeline import paper_turntable, parked, sweep, turntable
from magcomp.simulate.truth import BATTERY, MOTOR_SPREAD, PAPER_BENCH, Power, Truth, draw_truth

Compensation = Literal["off", "wrong", "exact"]

_STABILIZE, _AUTO, _LOITER = 0, 3, 5
_STRONG = 9.0
_BRISK = 5.0


@dataclass(frozen=True)
class Scenario:
    """A vehicle and what it does.

    Attributes
    ----------
    truth
        The vehicle.
    begin
        Makes the programme; each vehicle that carries it out needs its own.
    mode
        ArduCopter's flight mode while it does it.
    """

    truth: Truth
    begin: Callable[[], Program]
    mode: int


@dataclass(frozen=True)
class _Recipe:
    """What is usual for a programme."""

    kind: str
    calibrated: bool
    mode: int
    begin: Callable[[int], Program]
    power: Power = BATTERY
    strength: float | None = None


_RECIPES: Mapping[str, _Recipe] = {
    "turntable": _Recipe("rig", False, _STABILIZE, turntable),
    "turntable_paper": _Recipe(
        "rig", False, _STABILIZE, lambda _: paper_turntable(), power=PAPER_BENCH
    ),
    "sweep": _Recipe("sweep", True, _STABILIZE, sweep),
    "flight": _Recipe("flight", True, _LOITER, Flight),
    "brisk": _Recipe("flight", True, _LOITER, partial(Flight, vigour=_BRISK)),
    "parked": _Recipe("parked", True, _STABILIZE, lambda _: parked()),
    "mission": _Recipe("mission", True, _AUTO, lambda _: Mission(), strength=_STRONG),
}

PROGRAMS: tuple[str, ...] = tuple(_RECIPES)
"""What ``--program`` may name."""


def scenario(
    program: str,
    seed: int,
    *,
    calibrated: bool | None = None,
    compensation: Compensation = "off",
    motor_spread: float | None = None,
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
    compensation
        The motor compensation in force at boot.
    motor_spread
        How unequally the motors' wires disturb, as a share of the interference; None takes what
        is usual, a twentieth.

    Raises
    ------
    UsageError
        For a name that is no programme.
    """
    recipe = _RECIPES.get(program)
    if recipe is None:
        raise UsageError(
            f"The simulated vehicle's programme must be one of {', '.join(PROGRAMS)}; "
            f"instead received {program!r}"
        )
    truth = draw_truth(
        seed,
        recipe.kind,
        calibrated=recipe.calibrated if calibrated is None else calibrated,
        compensation=compensation,
        strength=recipe.strength,
        power=recipe.power,
        motor_spread=MOTOR_SPREAD if motor_spread is None else motor_spread,
    )
    return Scenario(truth, partial(recipe.begin, seed), recipe.mode)
