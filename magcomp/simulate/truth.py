"""What a simulated vehicle really is: the numbers a fit is judged against.

The document of :meth:`Truth.as_json` has the form of sitl_fixtures/*.json.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from magcomp.autopilots.ardupilot import soft_iron_matrix
from magcomp.errors import OutputError

FloatArray = NDArray[np.float64]

MOTORS = 4

# With a larger spread no single vector could keep the heading within 0.4° over 0 … 50 A:
# what one motor does differently would be the error, and not the fit.
MOTOR_SPREAD = 0.05

_HOMES = (
    (47.3977, 8.5456, 488.0),
    (-35.363261, 149.16523, 584.0),
    (37.7749, -122.4194, 20.0),
    (-33.45, -70.66, 520.0),
    (31.2304, 121.4737, 4.0),
    (1.3521, 103.8198, 15.0),
)


@dataclass(frozen=True)
class Power:
    """Battery, wiring and motors.

    Attributes
    ----------
    full_a
        What four motors draw together at full thrust and full battery, A.
    exponent
        Motor current grows as thrust to this power.
    idle_a
        What four motors draw together when armed and at zero thrust, A.
    board_a
        What everything else draws, A.
    full_v, empty_v
        Open-circuit voltage of the charged and of the empty battery, V.
    resistance_ohm
        Battery and wiring: the voltage sags by this times the current.
    capacity_ah
        Charge of the full battery, Ah.
    """

    full_a: float = 110.0
    exponent: float = 1.6
    idle_a: float = 2.4
    board_a: float = 0.6
    full_v: float = 25.2
    empty_v: float = 21.0
    resistance_ohm: float = 0.018
    capacity_ah: float = 8.0


BATTERY = Power()
"""What an ordinary quadrotor flies on."""

PAPER_BENCH = Power(
    # 32 A at 200 per mille and 53 A at 300, nothing at 0: docs/method.md, Table 1.
    full_a=32.0 * 5.0 ** (np.log(53.0 / 32.0) / np.log(1.5)),
    exponent=float(np.log(53.0 / 32.0) / np.log(1.5)),
    idle_a=0.0,
    board_a=0.0,
    full_v=25.2,
    empty_v=25.2,
    resistance_ohm=0.0,
    capacity_ah=1000.0,
)
"""The paper's rig: a bench supply instead of a battery, so that a control quantity is a current."""


@dataclass(frozen=True, eq=False)
class CompassTruth:
    """The calibration that undoes one compass exactly.

    Attributes
    ----------
    offset
        Exact COMPASS_OFS, mGauss, shape (3,).
    diagonal, off_diagonal
        Exact COMPASS_DIA and COMPASS_ODI, shape (3,).
    """

    offset: FloatArray
    diagonal: FloatArray
    off_diagonal: FloatArray

    @property
    def soft_iron(self) -> FloatArray:
        """D, shape (3, 3)."""
        return soft_iron_matrix(self.diagonal, self.off_diagonal)

    def raw(self, field: FloatArray) -> FloatArray:
        """What the sensor says of a field in body axes, mGauss, shape (..., 3).

        Notes
        -----
        docs/method.md, Equation 3: D⁻¹·field − OFS.
        """
        return np.asarray(field @ self._distortion.T - self.offset)

    @cached_property
    def _distortion(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self.soft_iron))


@dataclass(frozen=True, eq=False)
class Truth:
    """Everything about a simulated vehicle that nobody on the link is told.

    Attributes
    ----------
    seed, kind
        What it was drawn from; ``kind`` is ``"rig"``, ``"sweep"``, ``"flight"``, ``"mission"``
        or ``"parked"``.
    home
        Latitude and longitude in degrees, metres above sea level.
    interference
        Field added in body axes per ampere of battery current when all motors draw alike,
        mGauss/A, shape (3,). The exact COMPASS_MOT is its negative.
    motors
        The same for each motor's own current, mGauss/A, shape (4, 3); their mean is
        ``interference``.
    compasses
        One for each of the three compasses.
    calibrated
        Whether the exact calibration is in force when the vehicle boots; motors excepted.
    start_offset
        COMPASS_OFS of every compass where it is not.
    start_motor
        COMPASS_MOT in force at boot with COMPASS_MOTCT 2; None for none.
    noise
        Standard deviation of one 10 Hz compass reading, mGauss.
    power
        Battery and motors.
    """

    seed: int
    kind: str
    home: tuple[float, float, float]
    interference: FloatArray
    motors: FloatArray
    compasses: tuple[CompassTruth, CompassTruth, CompassTruth]
    calibrated: bool
    start_offset: FloatArray
    start_motor: FloatArray | None
    noise: float
    power: Power

    def as_json(self) -> dict[str, Any]:
        """The truth in the form of sitl_fixtures/*.json."""
        document: dict[str, Any] = {
            "seed": self.seed,
            "kind": self.kind,
            "mot_mgauss_per_amp": self.interference.tolist(),
            "compass": [
                {
                    "ofs": compass.offset.tolist(),
                    "dia": compass.diagonal.tolist(),
                    "odi": compass.off_diagonal.tolist(),
                }
                for compass in self.compasses
            ],
            "start_ofs": self.start_offset.tolist(),
            "home": list(self.home),
            "calibrated": self.calibrated,
            "noise_mgauss": self.noise,
            "motors_mgauss_per_amp": self.motors.tolist(),
        }
        if self.start_motor is not None:
            document["start_mot"] = self.start_motor.tolist()
        return document

    def parameters(self) -> Mapping[str, float]:
        """SIM_* parameters, by which the firmware's own simulation tells its truth."""
        values = dict(zip(_axes("SIM_MAG_MOT"), self.interference.tolist(), strict=True))
        for number, compass in enumerate(self.compasses, start=1):
            values |= zip(_axes(f"SIM_MAG{number}_OFS"), compass.offset.tolist(), strict=True)
            values |= zip(_axes(f"SIM_MAG{number}_DIA"), compass.diagonal.tolist(), strict=True)
            values |= zip(_axes(f"SIM_MAG{number}_ODI"), compass.off_diagonal.tolist(), strict=True)
        return values | {"SIM_MAG_RND": self.noise, "SIM_BATT_VOLTAGE": self.power.full_v}


def write_truth(path: Path, document: Mapping[str, Any]) -> None:
    """Write a truth file.

    Raises
    ------
    OutputError
        Where the file cannot be written.
    """
    try:
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise OutputError(
            f"{path} must be writable for the simulated vehicle's truth; "
            f"instead received: {error.strerror or error}"
        ) from error


def _axes(name: str) -> tuple[str, str, str]:
    return f"{name}_X", f"{name}_Y", f"{name}_Z"


def draw_truth(
    seed: int,
    kind: str,
    *,
    calibrated: bool,
    compensation: str = "off",
    strength: float | None = None,
    power: Power = BATTERY,
    motor_spread: float = MOTOR_SPREAD,
) -> Truth:
    """Draw a vehicle.

    Parameters
    ----------
    seed
        Same seed, same vehicle.
    kind
        See :class:`Truth`.
    calibrated
        Whether it boots with its exact calibration, motors excepted.
    compensation
        ``"off"``, ``"wrong"`` or ``"exact"``: the motor compensation in force at boot.
    strength
        Length of the interference vector, mGauss/A; drawn between 1.5 and 3.5 where None.
    power
        Battery and motors.
    motor_spread
        How unequally the motors' wires disturb, as a share of the interference.
    """
    rng = np.random.default_rng([seed, 0])
    home = _HOMES[int(rng.integers(len(_HOMES)))]
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    length = rng.uniform(1.5, 3.5) if strength is None else strength
    interference = np.round(direction * length, 4)
    spread = rng.normal(scale=motor_spread * length, size=(MOTORS, 3))
    compasses = tuple(
        CompassTruth(
            offset=np.round(rng.uniform(-150, 150, 3), 2),
            diagonal=np.round(rng.uniform(0.9, 1.1, 3), 4),
            off_diagonal=np.round(rng.uniform(-0.05, 0.05, 3), 4),
        )
        for _ in range(3)
    )
    start_offset = np.round(rng.uniform(-20, 20, 3), 2)
    start_motor = {
        "off": None,
        "wrong": np.round(rng.uniform(-3, 3, 3), 4),
        "exact": -interference,
    }[compensation]
    return Truth(
        seed=seed,
        kind=kind,
        home=home,
        interference=interference,
        motors=interference + spread - spread.mean(axis=0),
        compasses=(compasses[0], compasses[1], compasses[2]),
        calibrated=calibrated,
        start_offset=start_offset,
        start_motor=start_motor,
        noise=1.2,
        power=power,
    )
