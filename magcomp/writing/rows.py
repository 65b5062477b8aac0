"""Rows of parameter files, as ground stations, firmware and people write them.

====================================  ====================================================
NAME,VALUE                            Mission Planner
NAME VALUE, NAME<tab>VALUE            MAVProxy
NAME=VALUE                            ArduPilot's default files, and people
NAME VALUE @READONLY                  ArduPilot's default files: the mark changes no value
VEHICLE COMPONENT NAME VALUE TYPE     QGroundControl
====================================  ====================================================

A value may be hexadecimal, as 0x0F; what is behind ``#`` is a comment, and so is a line that begins
with ``//`` or ``;``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from magcomp.errors import ParameterFileError

AUTOPILOT_COMPONENT = 1

_NAME = re.compile(r"[A-Z0-9_]{1,16}", re.ASCII)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
_HEXADECIMAL = re.compile(r"0[xX][0-9a-fA-F]{1,8}", re.ASCII)
_SEPARATOR = re.compile(r"[ \t]*[,=][ \t]*|[ \t]+")
_READ_ONLY = re.compile(r"[ \t,]+@READONLY$", re.IGNORECASE)
_REMARKS = ("//", ";")


@dataclass(frozen=True)
class Row:
    """One parameter of a file; the vehicle and component where the row says them."""

    line: int
    name: str
    value: float
    system: int | None = None
    component: int | None = None


def as_float32(value: float) -> float:
    """Round to the nearest float32, the precision in which autopilots hold parameters.

    Raises
    ------
    ValueError
        Where the value is not finite, is beyond float32, or would become 0.
    """
    with np.errstate(over="ignore", under="ignore"):
        rounded = float(np.float32(value))
    if not np.isfinite(rounded) or (rounded == 0.0 and value != 0.0):
        raise ValueError(f"a value must fit a 32-bit float; instead received {value!r}")
    return rounded


def is_remark(content: str) -> bool:
    """Whether a line is a comment of a kind other than ``#``."""
    return content.startswith(_REMARKS)


def parse_row(content: str, number: int, where: str) -> Row:
    """Read one line without its comment.

    Raises
    ------
    ParameterFileError
        It is no parameter: a bad name, or a value that is not finite or does not fit float32.
    """
    fields = _SEPARATOR.split(_READ_ONLY.sub("", content).rstrip(", \t"))
    match fields:
        case [name, value]:
            return Row(number, check_name(name, where), _parse_value(value, name, where))
        case [system, component, name, value, _]:
            return Row(
                number,
                check_name(name, where),
                _parse_value(value, name, where),
                _parse_identity(system, "vehicle", where),
                _parse_identity(component, "component", where),
            )
        case _:
            raise ParameterFileError(
                f"{where}: a line must be NAME and VALUE, or QGroundControl's five columns; "
                f"instead received {shown(content)}"
            )


def _parse_identity(text: str, what: str, where: str) -> int:
    if not re.fullmatch(r"\d{1,3}", text, re.ASCII) or int(text) > 255:
        raise ParameterFileError(
            f"{where}: the {what} must be a number from 0 to 255; instead received {shown(text)}"
        )
    return int(text)


def check_name(name: str, where: str) -> str:
    """Refuse what cannot be a parameter's name."""
    if not _NAME.fullmatch(name):
        raise ParameterFileError(
            f"{where}: a parameter name must be 1 to 16 of A-Z, 0-9 and _; "
            f"instead received {shown(name)}"
        )
    return name


def _parse_value(text: str, name: str, where: str) -> float:
    if _NOT_FINITE.fullmatch(text):
        raise ParameterFileError(f"{where}: {name} must be finite; instead received {text}")
    if _HEXADECIMAL.fullmatch(text):
        return rounded(float(int(text, 16)), name, where, text)
    if not _NUMBER.fullmatch(text):
        raise ParameterFileError(
            f"{where}: {name} must be a number; instead received {shown(text)}"
        )
    return rounded(float(text), name, where, text)


def rounded(value: float, name: str, where: str, text: str | None = None) -> float:
    """As `as_float32`, naming the parameter that does not fit."""
    try:
        return as_float32(value)
    except ValueError as error:
        raise ParameterFileError(
            f"{where}: {name} must fit a 32-bit float; "
            f"instead received {shown(text) if text else value}"
        ) from error


def values_of(rows: Sequence[Row], source: str) -> tuple[Mapping[str, float], tuple[str, ...]]:
    """Values by name, and sentences on names that stand twice: ground stations take the last.

    Raises
    ------
    ParameterFileError
        The rows belong to several vehicles.
    """
    if any(row.component == AUTOPILOT_COMPONENT for row in rows):
        rows = [row for row in rows if row.component in {None, AUTOPILOT_COMPONENT}]
    last: dict[str, Row] = {}
    warnings = []
    for row in rows:
        if row.system != rows[0].system:
            raise ParameterFileError(
                f"{source}, line {row.line}: a parameter file must belong to one vehicle; "
                f"instead received {_named_system(row)} after {_named_system(rows[0])}"
            )
        earlier = last.get(row.name)
        if earlier is not None and earlier.value != row.value:
            warnings.append(
                f"{source}: {row.name} stands in line {earlier.line} and, with another value, in "
                f"line {row.line}; the last one counts"
            )
        last[row.name] = row
    return {name: row.value for name, row in last.items()}, tuple(warnings)


def _named_system(row: Row) -> str:
    return "a row without vehicle" if row.system is None else f"vehicle {row.system}"


def shown(text: str) -> str:
    """What a message quotes of a file."""
    text = text.strip()
    return ascii(text if len(text) <= 40 else f"{text[:37]}...")
