"""The autopilot's parameter store: names, types, values and who may see or write them.

It keeps ArduPilot 4.6's habits (docs/autopilots.md, ArduPilot: parameters): values are
float32 or whole numbers of 8, 16 or 32 bits, names that belong to a switched-off
feature are hidden from the list, and the first name of a vector answers for
all three.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from enum import IntEnum
from importlib import resources

import numpy as np

from magcomp.autopilots import ardupilot
from magcomp.simulate.held import Held
from magcomp.simulate.truth import Truth

DEVICE_IDS = (97539, 131874, 263178)
"""Identities of the three physical compasses."""

_PER_MOTOR_SWITCH = "COMPASS_PMOT_EN"
_PER_MOTOR = ("COMPASS_PMOT_EXP", *(f"COMPASS_PMOT{m}_{a}" for m in "1234" for a in "XYZ"))
_READ_ONLY_FAMILIES = ("COMPASS_DEV_ID", "STAT_")
_WRITABLE_STATISTIC = "STAT_RESET"
# ArduPilot adds this before it cuts a float to a whole number.
_ROUNDING = 0.01


class ParameterType(IntEnum):
    """MAV_PARAM_TYPE of the kinds ArduPilot has."""

    INT8 = 2
    INT16 = 4
    INT32 = 6
    REAL32 = 9


_LIMITS = {
    ParameterType.INT8: (-(2**7), 2**7 - 1),
    ParameterType.INT16: (-(2**15), 2**15 - 1),
    ParameterType.INT32: (-(2**31), 2**31 - 1),
}


class ParameterStore(Held):
    """What is in force, and what a reboot brings back.

    Parameters
    ----------
    values
        What differs from the firmware's defaults.
    storage_s
        Seconds within which a write reaches the memory that survives, in any order.
    seed
        Of that order.
    """

    def __init__(
        self, values: Mapping[str, float], *, storage_s: float = 0.0, seed: int = 0
    ) -> None:
        super().__init__()
        self._storage_s = storage_s
        self._rng = np.random.default_rng([seed, 6])
        self._stored: dict[str, float] = {}
        self._pending: list[tuple[float, str]] = []
        for name, kind, value in _defaults():
            self._types[name] = kind
            self._values[name] = value
            if name == _PER_MOTOR_SWITCH:
                for hidden in _PER_MOTOR:
                    self._types[hidden] = ParameterType.REAL32
                    self._values[hidden] = 0.65 if hidden.endswith("EXP") else 0.0
        for name, value in values.items():
            self.put(name, value)
        self._stored = dict(self._values)

    @property
    def listed(self) -> tuple[str, ...]:
        """The names a ground station is shown, in the order of their indices."""
        if self._values[_PER_MOTOR_SWITCH]:
            return tuple(self._values)
        return tuple(name for name in self._values if name not in _PER_MOTOR)

    def write(self, name: str, value: float, now_s: float) -> None:
        """Take a value into force at once, and into the memory that survives some time later."""
        stored = self._stored[name]
        self.put(name, value)
        self._stored[name] = stored
        self._pending.append((now_s + self._storage_s * self._rng.random(), name))

    def settle(self, now_s: float) -> None:
        """Store what has been waiting long enough: the value that is in force by now."""
        if self._pending:
            for due, name in self._pending:
                if due <= now_s:
                    self._stored[name] = self._values[name]
            self._pending = [each for each in self._pending if each[0] > now_s]

    def reboot(self) -> None:
        """Bring back what had been stored."""
        self._pending.clear()
        self._values.update(self._stored)
        self.version += 1

    def put(self, name: str, value: float) -> None:
        """Hold and store a value as the autopilot's type can hold it."""
        kind = ParameterType(self._types[name])
        if kind is ParameterType.REAL32:
            stored = float(np.float32(value))
        else:
            low, high = _LIMITS[kind]
            stored = float(int(min(max(value + np.copysign(_ROUNDING, value), low), high)))
        self._values[name] = self._stored[name] = stored
        self.version += 1

    def echoed(self, name: str) -> tuple[str, ...]:
        """Names the autopilot reports when ``name`` is set: _X answers for Y and Z too."""
        if not (name.endswith("_X") and name[:-1] + "Z" in self._values):
            return (name,)
        return tuple(name[:-1] + axis for axis in "XYZ")

    def sort_compasses(self) -> None:
        """Put the compass slots in the order of COMPASS_PRIO*_ID, as a boot does."""
        slots = {self._values[f"COMPASS_DEV_ID{s}"]: s for s in ("", "2", "3")}
        wanted = [self._values[f"COMPASS_PRIO{n}_ID"] for n in (1, 2, 3)]
        if set(wanted) != set(slots):
            return
        moved = {
            to_name: self._values[from_name]
            for number, device in enumerate(wanted, start=1)
            for to_name, from_name in zip(
                _slot_names(ardupilot.suffix(number)), _slot_names(slots[device]), strict=True
            )
        }
        for name, value in moved.items():
            self.put(name, value)


def is_read_only(name: str) -> bool:
    """Whether the autopilot denies to write it."""
    return name.startswith(_READ_ONLY_FAMILIES) and name != _WRITABLE_STATISTIC


def initial_values(truth: Truth) -> dict[str, float]:
    """Parameters of a vehicle before anybody calibrates its motors."""
    values = dict(truth.parameters())
    values["BATT_CAPACITY"] = 1000.0 * truth.power.capacity_ah
    values["MOT_BAT_VOLT_MAX"] = truth.power.full_v
    values["MOT_BAT_VOLT_MIN"] = truth.power.empty_v
    for number, compass in enumerate(truth.compasses, start=1):
        if truth.calibrated:
            values |= ardupilot.vector_parameters("OFS", number, compass.offset)
            values |= ardupilot.soft_iron_parameters(compass.soft_iron, number)
        else:
            values |= ardupilot.vector_parameters("OFS", number, truth.start_offset)
        if truth.start_motor is not None:
            values |= ardupilot.vector_parameters("MOT", number, truth.start_motor)
    if truth.start_motor is not None:
        values["COMPASS_MOTCT"] = ardupilot.MotorCompensation.CURRENT
    return values


def _slot_names(suffix: str) -> list[str]:
    vectors = (
        f"COMPASS_{kind}{suffix}_{a}" for kind in ("OFS", "DIA", "ODI", "MOT") for a in "XYZ"
    )
    external = f"COMPASS_EXTERN{suffix or 'AL'}"
    singles = (f"COMPASS_{kind}{suffix}" for kind in ("SCALE", "DEV_ID", "USE", "ORIENT"))
    return [*vectors, *singles, external]


def _defaults() -> list[tuple[str, ParameterType, float]]:
    table = resources.files("magcomp.simulate") / "copter_parameters.csv"
    rows = csv.DictReader(table.read_text(encoding="ascii").splitlines())
    return [(row["name"], ParameterType(int(row["type"])), float(row["value"])) for row in rows]
