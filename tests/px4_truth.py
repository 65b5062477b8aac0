"""What a PX4 recording's .json says about its vehicle, and what parameters leave of heading error.

Everything here is written down from the firmware's own order and dead zones (release/1.15), not
taken from magcomp: these are what its answers are held against.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from truth import TILTS, YAWS

from magcomp.geometry import body_from_earth, heading, wrap_angle

SHARED = Path(__file__).parents[2] / "shared"
RECORDINGS = SHARED / "recordings_px4"

FLOWN_THRUST = 0.8
"""The most that flight_thrust asks for."""

FloatArray = NDArray[np.float64]

AT_START = {"OFF": (0.0, 0.0, 0.0), "SCALE": (1.0, 1.0, 1.0), "ODIAG": (0.0, 0.0, 0.0)}
ZONES = {"OFF": 0.005, "SCALE": 0.01, "ODIAG": 0.01}


@dataclass(frozen=True, eq=False)
class Sensor:
    """A compass as it really is: sensor = S⁻¹ Rᵀ body + OFF − P · COMP, gauss."""

    device: int
    offset: FloatArray
    soft_iron: FloatArray
    motor: FloatArray
    rotation: FloatArray

    def reading(self, body: FloatArray, power: float) -> FloatArray:
        """What it says of body fields, gauss, shape (n, 3)."""
        linear = np.linalg.solve(self.soft_iron, self.rotation.T @ body.T).T
        return linear + self.offset - power * self.motor


@dataclass(frozen=True, eq=False)
class Truth:
    sensors: tuple[Sensor, ...]
    earth: FloatArray
    declination: float
    top: float


def matrix(scale: object, off_diagonal: object) -> FloatArray:
    (x, y, z), (xy, xz, yz) = np.asarray(scale, float), np.asarray(off_diagonal, float)
    return np.array([[x, xy, xz], [xy, y, yz], [xz, yz, z]])


def of_document(path: Path) -> Truth:
    document = json.loads(path.read_text())
    sensors = tuple(
        Sensor(
            device=each["device_id"],
            offset=np.array(each["exact_OFF"]),
            soft_iron=matrix(each["exact_SCALE"], each["exact_ODIAG"]),
            motor=np.array(each["exact_COMP"]),
            rotation=np.array(each["rotation_sensor_to_body"]),
        )
        for each in document["magnetometers"]
    )
    by_thrust = document["interference_follows"] == "thrust"
    return Truth(
        sensors=sensors,
        earth=np.array(document["earth_ned_gauss"]),
        declination=np.radians(document["declination_deg"]),
        top=FLOWN_THRUST if by_thrust else document["current_A"][1] / 1000.0,
    )


def slot_of(values: Mapping[str, float], device: int) -> int:
    return next(n for n in range(4) if values.get(f"CAL_MAG{n}_ID") == device)


def vector(values: Mapping[str, float], slot: int, kind: str) -> FloatArray:
    return np.array([values[f"CAL_MAG{slot}_{axis}{kind}"] for axis in "XYZ"])


def through_dead_zones(
    before: Mapping[str, FloatArray], values: Mapping[str, float], slot: int
) -> dict[str, FloatArray]:
    """What of the stored values a disarmed firmware goes over to."""
    found = {"COMP": vector(values, slot, "COMP")}
    for kind, zone in ZONES.items():
        wanted, present = vector(values, slot, kind), np.asarray(before[kind])
        found[kind] = wanted if np.linalg.norm(wanted - present) > zone else present
    return found


def left_deg(
    truth: Truth, sensor: Sensor, correct: Callable[[FloatArray, float], FloatArray]
) -> float:
    """The largest heading error from no power to the top, level and tilted, degrees.

    ``correct`` makes the vehicle's field of what the sensor says, gauss, shape (n, 3), at a power.
    """
    worst = 0.0
    for power in np.linspace(0.0, truth.top, 5):
        for roll, pitch in TILTS:
            body = body_from_earth(roll, pitch, YAWS) @ truth.earth
            corrected = correct(sensor.reading(body, power), power)
            found = heading(corrected, roll, pitch, truth.declination)
            worst = max(worst, float(np.abs(wrap_angle(found - YAWS)).max()))
    return float(np.degrees(worst))


def heading_error_deg(
    truth: Truth, sensor: Sensor, stored: Mapping[str, float], emitted: Mapping[str, float]
) -> float:
    """That of the emitted parameters, whether the vehicle is restarted or not, degrees."""
    slot = slot_of(stored, sensor.device)
    after = {**stored, **emitted}
    running = through_dead_zones(AT_START, stored, slot)

    def firmware(force: Mapping[str, FloatArray]) -> Callable[[FloatArray, float], FloatArray]:
        soft_iron = matrix(force["SCALE"], force["ODIAG"])

        def correct(sensed: FloatArray, power: float) -> FloatArray:
            moved = sensed + power * force["COMP"] - force["OFF"]
            return np.asarray(moved @ soft_iron.T @ sensor.rotation.T)

        return correct

    return max(
        left_deg(truth, sensor, firmware(through_dead_zones(before, after, slot)))
        for before in (running, AT_START)
    )
