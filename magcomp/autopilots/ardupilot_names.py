"""The names of ArduPilot's compass parameters (AP_Compass, checked against ArduCopter 4.6.3).

Compass 1 has no number in its names: COMPASS_MOT_X, then COMPASS_MOT2_X and COMPASS_MOT3_X.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from magcomp.autopilots.terms import Kind, ParameterName

COMPASS_COUNT = 3
NUMBERS = range(1, COMPASS_COUNT + 1)

COMPENSATION_SWITCH = "COMPASS_MOTCT"
PER_MOTOR_SWITCH = "COMPASS_PMOT_EN"
OFFSETS_MAX = "COMPASS_OFFS_MAX"
LEARN = "COMPASS_LEARN"

AXES = ("X", "Y", "Z")

_VECTORS = {
    "MOT": Kind.MOTOR,
    "OFS": Kind.OFFSET,
    "DIA": Kind.DIAGONAL,
    "ODI": Kind.OFF_DIAGONAL,
}
_SINGLES = {
    "SCALE": Kind.SCALE,
    "DEV_ID": Kind.DEVICE,
    "USE": Kind.SETTING,
    "ORIENT": Kind.SETTING,
    "EXTERN": Kind.SETTING,
}
_OTHERS = {
    COMPENSATION_SWITCH: ParameterName(Kind.SWITCH, 0, COMPENSATION_SWITCH),
    PER_MOTOR_SWITCH: ParameterName(Kind.SWITCH, 0, PER_MOTOR_SWITCH),
    OFFSETS_MAX: ParameterName(Kind.SETTING, 0, OFFSETS_MAX),
    LEARN: ParameterName(Kind.SETTING, 0, LEARN),
    "COMPASS_EXTERNAL": ParameterName(Kind.SETTING, 1, "COMPASS_EXTERNAL"),
}
_VECTOR = re.compile(r"(COMPASS_(MOT|OFS|DIA|ODI)([23]?))_([XYZ])")
_SINGLE = re.compile(r"COMPASS_(SCALE|DEV_ID|USE|ORIENT|EXTERN)([23]?)")
_PER_MOTOR = re.compile(r"(COMPASS_PMOT(?:_EXP|[1-4]))(?:_([XYZ]))?")

KEPT = re.compile(
    r"COMPASS_DEV_ID\d?|FORMAT_VERSION|SYSID_SW_MREV|SYS_NUM_RESETS|STAT_\w+"
    r"|GND_(ABS_PRESS|TEMP)|BARO\d?_(GND_PRESS|DEVID)"
    r"|INS_(ACC|GYR)\d?_ID|INS\d_(ACC|GYR)_ID|ARSPD\d?_(OFFSET|DEVID)|GPS\d?_CAN_NODEID\d?"
    r"|LOG_LASTFILE|(MIS|FENCE|RALLY|CMD)_(TOTAL|INDEX)"
)
"""What the firmware keeps itself, much as ground stations leave it out of a file that they load."""

_INT8, _INT16, _INT32 = 2, 4, 6  # MAV_PARAM_TYPE


def suffix(compass: int) -> str:
    """Number in a parameter's name: compass 1 has none."""
    return "" if compass == 1 else str(compass)


def vector_names(kind: str, compass: int) -> tuple[str, str, str]:
    """Three names of a vector, for example COMPASS_MOT2_X, _Y, _Z.

    Parameters
    ----------
    kind
        ``"OFS"``, ``"DIA"``, ``"ODI"`` or ``"MOT"``.
    """
    x, y, z = (f"COMPASS_{kind}{suffix(compass)}_{axis}" for axis in AXES)
    return x, y, z


def single_name(kind: str, compass: int) -> str:
    """Name of a compass's parameter that is no vector, for example COMPASS_SCALE2."""
    if kind == "EXTERN" and compass == 1:
        return "COMPASS_EXTERNAL"
    return f"COMPASS_{kind}{suffix(compass)}"


def acting_on(compass: int) -> tuple[str, ...]:
    """Parameters that act on the readings of one compass alone, in alphabetical order."""
    kinds = ("DIA", "MOT", "ODI", "OFS")
    vectors = (name for kind in kinds for name in vector_names(kind, compass))
    return (*vectors, single_name("SCALE", compass))


ACTING = tuple(
    sorted(
        [
            *(name for compass in NUMBERS for name in acting_on(compass)),
            *(single_name("DEV_ID", compass) for compass in NUMBERS),
            COMPENSATION_SWITCH,
            PER_MOTOR_SWITCH,
        ]
    )
)
"""Every parameter that acts on a reading. Asked for by name: a log may hold any number of
others."""


def parse(name: str) -> ParameterName | None:
    """Take a name apart; None where it is none of these."""
    if vector := _VECTOR.fullmatch(name):
        return ParameterName(_VECTORS[vector[2]], int(vector[3] or 1), vector[1], vector[4])
    if single := _SINGLE.fullmatch(name):
        return ParameterName(_SINGLES[single[1]], int(single[2] or 1), name)
    if each := _PER_MOTOR.fullmatch(name):
        return ParameterName(Kind.PER_MOTOR, 1, each[1], each[2] or "")
    return _OTHERS.get(name)


def integer_type(name: str) -> int | None:
    """MAV_PARAM_TYPE of a name that holds whole numbers, else None."""
    found = parse(name)
    if found is None:
        return _INT32 if re.fullmatch(r"COMPASS_PRIO[123]_ID", name) else None
    by_kind: Mapping[Kind, int] = {
        Kind.SWITCH: _INT8,
        Kind.DEVICE: _INT32,
        Kind.SETTING: _INT16 if name == OFFSETS_MAX else _INT8,
    }
    return by_kind.get(found.kind)
