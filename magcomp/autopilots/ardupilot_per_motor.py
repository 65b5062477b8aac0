"""ArduPilot's correction motor by motor, of compass 1, in firmware built with it.

docs/autopilots.md, ArduPilot: control quantity: Σ COMPASS_PMOTn · (duty of motor n · volts) to the
power of COMPASS_PMOT_EXP, in the place of COMPASS_MOT · u.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from magcomp.autopilots.ardupilot_names import AXES, PER_MOTOR_SWITCH
from magcomp.autopilots.terms import MotorLaw
from magcomp.model import DRIVE, FloatArray, InForce, ParameterHistory

EXPONENT = "COMPASS_PMOT_EXP"
LAW = MotorLaw(numbers=(1, 2, 3, 4), most_exponent=2.0)
NAMES = (EXPONENT, *(f"COMPASS_PMOT{motor}_{axis}" for motor in LAW.numbers for axis in AXES))

_USUAL_EXPONENT = 0.65
_COMPASS = 1


def law(compass: int, values: Mapping[str, float]) -> MotorLaw | None:
    """What the firmware can do for a compass; None where it was built without it."""
    return LAW if compass == _COMPASS and PER_MOTOR_SWITCH in values else None


def parameters(vectors: FloatArray, exponent: float) -> dict[str, float]:
    """COMPASS_PMOT of vectors, shape (3, 4), in mGauss per volt to the exponent, and its switch."""
    columns = (float(np.float32(value)) for value in vectors.T.reshape(-1))
    made = dict(zip(NAMES[1:], columns, strict=True))
    return {**made, EXPONENT: float(np.float32(exponent)), PER_MOTOR_SWITCH: 1.0}


def over(found: InForce, compass: int, values: Mapping[str, float]) -> InForce:
    """What is in force, with the correction motor by motor where that is switched on.

    Parameters
    ----------
    found
        What the other parameters say.
    compass, values
        Whose, and every parameter that is known.
    """
    if compass != _COMPASS or not values.get(PER_MOTOR_SWITCH, 0.0):
        return found
    vectors = np.array([values.get(name, 0.0) for name in NAMES[1:]]).reshape(-1, 3)
    exponent = min(max(values.get(EXPONENT, _USUAL_EXPONENT), 0.0), LAW.most_exponent)
    return replace(
        found,
        correction=replace(found.correction, motor=vectors.T),
        regressor=DRIVE,
        exponent=exponent,
        unseen=(*found.unseen, *(name for name in NAMES if name not in values)),
    )


def over_at(found: InForce, compass: int, history: ParameterHistory, time: float) -> InForce:
    """The same at a time of a history."""
    names: Sequence[str] = (PER_MOTOR_SWITCH, *NAMES)
    return over(found, compass, dict(_told(history, names, time)))


def _told(
    history: ParameterHistory, names: Sequence[str], time: float
) -> Iterator[tuple[str, float]]:
    for name in names:
        if history.of(name):
            yield name, history.at(name, time, 0.0)
