"""A small PX4 for parameters: integers as bytes, one echo with its true index.

Faithful to docs/autopilots.md, PX4: parameters.

It saves everything at once, some time after a change, and not again for two seconds.
"""

from __future__ import annotations

import struct
from typing import Any

from fake_autopilot import BOOT_TIME, COMPONENT, SYSTEM, UID, FakeAutopilot, float32
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.mavlink.parameters import Encoding, as_float, encode_value
from magcomp.model import Compass, ParameterSet, Vehicle

DEVICES = (197388, 197644)
INT32, REAL32 = 6, 9
SWITCH = "CAL_MAG_COMP_TYP"
QUAD = Vehicle(
    "px4",
    "copter",
    SYSTEM,
    COMPONENT,
    "1.15.4",
    tuple(
        Compass(slot + 1, device, external=False, used=True) for slot, device in enumerate(DEVICES)
    ),
    board="board 140",
    capabilities=16,
    uid=UID.hex(),
)


def calibration(seed: float, compensation: int) -> dict[str, float]:
    """COMP, ODIAG, OFF and SCALE of two compasses, and the switch."""
    values: dict[str, float] = {}
    for slot in range(2):
        for kind, base in (("COMP", -2.0), ("OFF", 0.1), ("SCALE", 1.0), ("ODIAG", 0.01)):
            for step, axis in enumerate("XYZ"):
                seed += 0.01
                values[f"CAL_MAG{slot}_{axis}{kind}"] = float32(base + seed + 0.1 * step)
    values[SWITCH] = float(compensation)
    return values


OLD = calibration(0.5, 2)
NEW = calibration(0.9, 1)
WANTED = ParameterSet(NEW, QUAD)


class FakePx4(FakeAutopilot):
    """Holds parameters and answers like PX4 1.15."""

    def __init__(self, values: dict[str, float]) -> None:
        super().__init__({})
        singles = {
            f"CAL_MAG{slot}_{kind}": float(value)
            for slot in range(4)
            for kind, value in (
                ("ID", DEVICES[slot] if slot < len(DEVICES) else 0),
                ("ROT", -1),
                ("PRIO", 50),
            )
        }
        empty = {
            f"CAL_MAG{slot}_{axis}{kind}": float(kind == "SCALE")
            for slot in (2, 3)
            for kind in ("COMP", "OFF", "SCALE", "ODIAG")
            for axis in "XYZ"
        }
        self.values = {**singles, **empty, **values}
        self.stored = dict(self.values)
        self.saves_at: float | None = None
        self.saved_at = -1e9

    def calibration(self) -> dict[str, float]:
        return {name: self.values[name] for name in OLD}

    def listed(self) -> list[str]:
        return list(self.values)

    def heartbeat(self) -> Any:
        return mavlink.MAVLink_heartbeat_message(2, 12, 128 if self.armed else 0, 0, 4, 3)

    def reboot(self, now: float, stored: bool = True) -> None:
        self.save(now)
        if stored:
            self.stored = dict(self.values)
        self.saves_at = None
        self.values = dict(self.stored)
        self.states.append(self.calibration())
        self.booted_at = now + BOOT_TIME

    def save(self, now: float) -> None:
        if self.saves_at is not None and now >= self.saves_at:
            self.stored, self.saved_at, self.saves_at = dict(self.values), self.saves_at, None

    def answer(self, message: Any, now: float) -> list[Any]:
        self.save(now)
        if message.get_type() != "PARAM_SET":
            return super().answer(message, now)
        name = message.param_id
        if name not in self.values or message.param_type != self.kind(name):
            return []
        field = struct.pack("<f", message.param_value)
        integer = self.kind(name) == INT32
        value = float(struct.unpack("<i" if integer else "<f", field)[0])
        self.writes.append((name, value))
        self.values[name] = value
        self.states.append(self.calibration())
        if self.saves_at is None:
            self.saves_at = max(now + 0.3, self.saved_at + 2.0)
        return [self._value(name)]

    @staticmethod
    def kind(name: str) -> int:
        whole = name.endswith(("_ID", "_ROT", "_PRIO")) or name == SWITCH
        return INT32 if whole else REAL32

    def _value(self, name: str, index: int | None = None) -> Any:
        kind = self.kind(name)
        field = as_float(encode_value(self.values[name], kind, Encoding.BYTEWISE))
        place = self.listed().index(name) if index is None else index
        return mavlink.MAVLink_param_value_message(
            name.encode(), field, kind, len(self.values), place
        )
