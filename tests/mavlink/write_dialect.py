"""Write ``magcomp/mavlink/dialect.txt`` from the installed pymavlink.

    python tests/mavlink/write_dialect.py

A line a message: its number, its CRC_EXTRA, and its fields in the order of the wire as
``name:type`` or ``name:type:count``, the type in NumPy's letters.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pymavlink.dialects.v20.ardupilotmega import mavlink_map

TABLE = Path(__file__).parents[2] / "magcomp" / "mavlink" / "dialect.txt"
TYPES = {
    "b": "i1",
    "B": "u1",
    "h": "i2",
    "H": "u2",
    "i": "i4",
    "I": "u4",
    "q": "i8",
    "Q": "u8",
    "f": "f4",
    "d": "f8",
}


def lines() -> Iterator[str]:
    """The table's lines as pymavlink has them, in order of the numbers."""
    for number, message in sorted(mavlink_map.items()):
        codes = bytes(message.native_format).decode("ascii").lstrip("<")
        of_fields = zip(message.ordered_fieldnames, codes, message.array_lengths, strict=True)
        fields = (_field(name, code, count) for name, code, count in of_fields)
        yield " ".join([str(number), str(message.crc_extra), *fields])


def _field(name: str, code: str, count: int) -> str:
    if code == "c":
        return f"{name}:S{count}"
    return f"{name}:{TYPES[code]}:{count}" if count else f"{name}:{TYPES[code]}"


if __name__ == "__main__":
    TABLE.write_text("".join(f"{line}\n" for line in lines()), encoding="ascii")
