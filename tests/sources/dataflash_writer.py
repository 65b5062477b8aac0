"""Write dataflash logs, binary and in text, as the firmware does."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

_CODES = {
    "b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "q": "q", "Q": "Q", "f": "f",
    "d": "d", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B", "n": "4s", "N": "16s",
    "Z": "64s", "a": "64s", "g": "e",
}  # fmt: skip
_SCALES = {"c": 100, "C": 100, "e": 100, "E": 100, "L": 1e7}
HEAD = b"\xa3\x95"


@dataclass
class Form:
    """A message as the format table has it."""

    number: int
    name: str
    kinds: str
    columns: str

    @property
    def code(self) -> str:
        return "<" + "".join(_CODES[kind] for kind in self.kinds)

    def definition(self, length: int | None = None) -> bytes:
        size = 3 + struct.calcsize(self.code) if length is None else length
        texts = (self.name.encode(), self.kinds.encode(), self.columns.encode())
        return HEAD + struct.pack("<BBB4s16s64s", 128, self.number, size, *texts)

    def record(self, values: Sequence[float | str | bytes]) -> bytes:
        stored = [
            value.encode() if isinstance(value, str)
            else value if isinstance(value, bytes) or kind in "fdg"
            else round(value * _SCALES.get(kind, 1))
            for kind, value in zip(self.kinds, values, strict=True)
        ]  # fmt: skip
        return HEAD + bytes([self.number]) + struct.pack(self.code, *stored)

    def line(self, values: Sequence[object]) -> str:
        return ", ".join([self.name, *map(str, values)])


FMT = Form(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
PARM = Form(32, "PARM", "QNf", "TimeUS,Name,Value")
MSG = Form(59, "MSG", "QZ", "TimeUS,Message")
MAG = Form(
    113, "MAG", "QBhhhhhhhhhBI",
    "TimeUS,I,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,MOX,MOY,MOZ,Health,S",
)  # fmt: skip
ATT = Form(72, "ATT", "QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw")
BAT = Form(88, "BAT", "QBff", "TimeUS,Inst,Volt,Curr")
CTUN = Form(0, "CTUN", "Qff", "TimeUS,ThI,ThO")
RCOU = Form(62, "RCOU", "QHHHH", "TimeUS,C1,C2,C3,C4")


@dataclass
class Writer:
    """A log being written, in both forms."""

    forms: tuple[Form, ...] = (FMT, PARM, MSG, MAG, ATT, BAT, CTUN, RCOU)
    rows: list[tuple[Form, tuple]] = field(default_factory=list)

    def add(self, form: Form, *values: float | str | bytes) -> None:
        self.rows.append((form, values))

    def binary(self) -> bytes:
        table = b"".join(form.definition() for form in self.forms)
        return table + b"".join(form.record(values) for form, values in self.rows)

    def text(self) -> bytes:
        table = [
            f"FMT, {f.number}, {3 + struct.calcsize(f.code)}, {f.name}, {f.kinds}, {f.columns}"
            for f in self.forms
        ]
        return "\r\n".join([*table, *(f.line(values) for f, values in self.rows), ""]).encode()


def short_flight(seconds: float = 12.0) -> Writer:
    """Two compasses at 10 Hz, two batteries, 250 parameters."""
    log = Writer()
    log.add(MSG, 1000, "ArduCopter V4.5.7 (2a3dc4b7)")
    log.add(MSG, 1100, "CubeOrange 0037003A 30325116 38393532")
    log.add(MSG, 1200, "Frame: HEXA/X")
    for n in range(250):
        log.add(PARM, 2000 + n, f"A_{n}", float(n))
    log.add(PARM, 3000, "COMPASS_OFS_X", 12.75)
    log.add(PARM, 3001, "COMPASS_DEV_ID", 97539.0)
    log.add(PARM, 3002, "SIM_MAG_MOT_X", 1.0)
    for k in range(round(10 * seconds)):
        t = 1_000_000 + 100_000 * k
        log.add(CTUN, t, 0.5, 0.25 + 0.001 * k)
        log.add(ATT, t + 10, 0, 10.5, 0, -3.25, 0, (2.0 * k) % 360)
        log.add(BAT, t + 20, 0, 16.5, 10.0 + k)
        log.add(BAT, t + 25, 1, 12.0, 1.5)
        log.add(RCOU, t + 30, 1500 + k, 1400, 1300, 1200)
        for i in (0, 1):
            log.add(MAG, t + 40 + i, i, 200 + k, -k, 400 + i, 12, -8, 0, 3, 0, -2, 1, t)
    return log
