"""The names of PX4's compass parameters (release/1.12 to 1.17).

Slot n = 0 … 3 holds the calibration of the device CAL_MAGn_ID; its compass here is n + 1.
"""

from __future__ import annotations

import re

from magcomp.autopilots.terms import Kind, ParameterName

SLOTS = range(4)
AXES = ("X", "Y", "Z")
COMPENSATION_SWITCH = "CAL_MAG_COMP_TYP"
BOARD_ROTATION = "SENS_BOARD_ROT"
BOARD_ANGLES = ("SENS_BOARD_X_OFF", "SENS_BOARD_Y_OFF", "SENS_BOARD_Z_OFF")
BIASES_LEARNT_ON_GROUND = "MBE_ENABLE"
OLD_ROTATION_SWITCH = "CAL_MAG_ROT_AUTO"
"""To 1.13; SENS_MAG_AUTOROT after it."""

VECTORS = {
    "COMP": Kind.MOTOR,
    "OFF": Kind.OFFSET,
    "SCALE": Kind.DIAGONAL,
    "ODIAG": Kind.OFF_DIAGONAL,
}
_VECTOR = re.compile(r"CAL_MAG([0-3])_([XYZ])(OFF|SCALE|ODIAG|COMP)")
_SINGLE = re.compile(r"CAL_MAG([0-3])_(ID|ROT|PRIO|ROLL|PITCH|YAW)")
KEPT = re.compile(
    r"CAL_\w+_ID|SYS_PARAM_VER|LND_FLIGHT_T_(HI|LO)|COM_FLIGHT_UUID|SENS_DPRES_OFF|\w+_DEVID"
)
"""What the firmware keeps itself."""
_INT32 = 6  # MAV_PARAM_TYPE
_ANGLES = ("ROLL", "PITCH", "YAW")


def vector_names(kind: str, compass: int) -> tuple[str, str, str]:
    """Three names of a vector, for example CAL_MAG1_XCOMP, _YCOMP, _ZCOMP of compass 2.

    Parameters
    ----------
    kind
        ``"COMP"``, ``"OFF"``, ``"SCALE"`` or ``"ODIAG"``.
    """
    x, y, z = (f"CAL_MAG{compass - 1}_{axis}{kind}" for axis in AXES)
    return x, y, z


def single_name(kind: str, compass: int) -> str:
    """Name of a compass's parameter that is no vector, for example CAL_MAG0_ID of compass 1."""
    return f"CAL_MAG{compass - 1}_{kind}"


def angle_names(compass: int) -> tuple[str, str, str]:
    """Names of the roll, pitch and yaw of a rotation that is in no table, in degrees."""
    roll, pitch, yaw = (single_name(angle, compass) for angle in _ANGLES)
    return roll, pitch, yaw


def acting_on(compass: int) -> tuple[str, ...]:
    """Parameters that act on the readings of one compass alone, in alphabetical order."""
    return tuple(sorted(name for kind in VECTORS for name in vector_names(kind, compass)))


def parse(name: str) -> ParameterName | None:
    """Take a name apart; None where it is none of these."""
    if name == COMPENSATION_SWITCH:
        return ParameterName(Kind.SWITCH, 0, name)
    if vector := _VECTOR.fullmatch(name):
        whole = f"CAL_MAG{vector[1]}_{vector[3]}"
        return ParameterName(VECTORS[vector[3]], int(vector[1]) + 1, whole, vector[2])
    if single := _SINGLE.fullmatch(name):
        kind = Kind.DEVICE if single[2] == "ID" else Kind.SETTING
        return ParameterName(kind, int(single[1]) + 1, name)
    return None


def integer_type(name: str) -> int | None:
    """INT32 for all that hold whole numbers, else None."""
    found = parse(name)
    if found is None or found.kind not in (Kind.SWITCH, Kind.DEVICE, Kind.SETTING):
        return None
    return None if name.endswith(_ANGLES) else _INT32
