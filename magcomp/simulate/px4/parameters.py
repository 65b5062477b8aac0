"""PX4's parameters: types, which of them are shown, when a change is noticed and when it is saved.

docs/autopilots.md, PX4: parameters. Values are float32 or int32. A change that the firmware does
not notice (to NaN, from NaN, or by less than a float's last digits) is held and sent, and yet
nothing acts on it until another parameter changes.
"""

from __future__ import annotations

import csv
import zlib
from collections.abc import Mapping
from importlib import resources

import numpy as np

from magcomp.autopilots.px4_names import SLOTS, VECTORS, angle_names, single_name, vector_names
from magcomp.mavlink.parameters import REAL32, Encoding, encode_value
from magcomp.simulate.held import Held
from magcomp.simulate.px4.sensors import DEVICE_IDS, EXTERNAL_ROTATION, started
from magcomp.simulate.truth import Truth

INT32 = 6
"""MAV_PARAM_TYPE_INT32."""

_NUMBERS = tuple(slot + 1 for slot in SLOTS)
_DEVICES = {number: single_name("ID", number) for number in _NUMBERS}
_ALWAYS_SHOWN = ("ID", "ROT")
_NOTICED = 1.2e-7
_SAVED_AFTER_S, _SAVED_AGAIN_S = 0.3, 2.0
_NOT_IN_HASH = ("OFF", "SCALE", "ODIAG", "COMP")
_COUNTERS = ("COM_FLIGHT_UUID", "LND_FLIGHT_T_HI", "LND_FLIGHT_T_LO")
_INTERNAL = -1.0


class Parameters(Held):
    """What is held, what was noticed, and what a reboot brings back.

    Parameters
    ----------
    values
        What differs from the firmware's defaults.

    Attributes
    ----------
    version
        Counts the changes that were noticed.
    """

    def __init__(self, values: Mapping[str, float]) -> None:
        super().__init__()
        self._unsaved: dict[str, None] = {}
        self._saves_at: float | None = None
        self._saved_at = -np.inf
        for name, kind, value in _defaults():
            self._types[name], self._values[name] = kind, value
        for name, kind, value in _slots():
            if name not in self._types:
                self._types[name], self._values[name] = kind, value
        self._order = tuple(sorted(self._types))
        self._shown: dict[tuple[int, ...], tuple[str, ...]] = {}
        for name, value in values.items():
            if name in self._types:
                self._values[name] = self._held(name, value)
        self._stored = dict(self._values)

    @property
    def shown(self) -> tuple[str, ...]:
        """The names in the list, by index: of a free slot, its id and rotation only."""
        free = tuple(number for number, name in _DEVICES.items() if not self._values[name])
        if free not in self._shown:
            hidden = {
                name
                for number in free
                for name, _, _ in _slot(number)
                if not name.endswith(_ALWAYS_SHOWN)
            }
            self._shown[free] = tuple(name for name in self._order if name not in hidden)
        return self._shown[free]

    @property
    def unsaved(self) -> tuple[str, ...]:
        """Names that were set since everything was saved last."""
        return tuple(self._unsaved)

    def hash(self) -> int:
        """_HASH_CHECK: of what is shown, without the compasses' own calibration."""
        crc = 0
        for name in self.shown:
            if (name.endswith(_NOT_IN_HASH) and name.startswith("CAL_MAG")) or name in _COUNTERS:
                continue
            field = encode_value(self._values[name], self._types[name], Encoding.BYTEWISE)
            crc = zlib.crc32(field, zlib.crc32(name.encode(), crc))
        return crc

    def set(self, name: str, value: float, now_s: float) -> None:
        """Hold a value, and notice whether it changed."""
        old, new = self._values[name], self._held(name, value)
        self._values[name] = new
        self._unsaved[name] = None
        if abs(new - old) > _NOTICED:  # NaN is never noticed
            self.version += 1
            if self._saves_at is None:
                self._saves_at = max(now_s + _SAVED_AFTER_S, self._saved_at + _SAVED_AGAIN_S)

    def settle(self, now_s: float) -> None:
        """Save everything, if it is time to."""
        if self._saves_at is not None and now_s >= self._saves_at:
            self._stored = dict(self._values)
            self._unsaved.clear()
            self._saved_at, self._saves_at = self._saves_at, None

    def reboot(self) -> None:
        """Bring back what was saved."""
        self._saves_at = None
        self._unsaved.clear()
        self._values = dict(self._stored)
        self.version += 1

    def _held(self, name: str, value: float) -> float:
        return float(int(value)) if self._types[name] == INT32 else float(np.float32(value))


def initial_values(truth: Truth) -> dict[str, float]:
    """Parameters of a vehicle before anybody calibrates its motors."""
    values: dict[str, float] = {}
    for number, device in enumerate(DEVICE_IDS, start=1):
        external = number == len(DEVICE_IDS)
        values[single_name("ID", number)] = device
        values[single_name("ROT", number)] = EXTERNAL_ROTATION if external else _INTERNAL
        calibration = started(truth, number)
        for kind, vector in (
            ("OFF", calibration.offset),
            ("SCALE", calibration.scale),
            ("ODIAG", calibration.off_diagonal),
            ("COMP", calibration.motor),
        ):
            values |= dict(zip(vector_names(kind, number), vector.tolist(), strict=True))
    values["CAL_MAG_COMP_TYP"] = 0.0 if truth.start_motor is None else 2.0
    return values


def _slot(number: int) -> list[tuple[str, int, float]]:
    """Names, types and defaults of one calibration slot."""
    whole = [(single_name(kind, number), INT32, value) for kind, value in _SINGLES]
    turns = [(name, REAL32, 0.0) for name in angle_names(number)]
    vectors = [
        (name, REAL32, float(kind == "SCALE"))
        for kind in VECTORS
        for name in vector_names(kind, number)
    ]
    return [*whole, *turns, *vectors]


_SINGLES = (("ID", 0.0), ("ROT", _INTERNAL), ("PRIO", -1.0))


def _slots() -> list[tuple[str, int, float]]:
    return [row for number in _NUMBERS for row in _slot(number)]


def _defaults() -> list[tuple[str, int, float]]:
    table = resources.files("magcomp.simulate.px4") / "px4_parameters.csv"
    rows = csv.DictReader(table.read_text(encoding="ascii").splitlines())
    return [(row["name"], int(row["type"]), float(row["value"])) for row in rows]
