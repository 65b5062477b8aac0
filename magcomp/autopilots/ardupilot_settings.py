"""What ArduPilot's settings mean for a calibration: which compass is which, what stands in the way.

Every sentence about a setting stands here once, without its full stop.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from magcomp.autopilots.ardupilot_correction import is_scale_used, not_finite, not_undoable
from magcomp.autopilots.ardupilot_names import (
    ACTING,
    COMPENSATION_SWITCH,
    LEARN,
    NUMBERS,
    OFFSETS_MAX,
    PER_MOTOR_SWITCH,
    acting_on,
    parse,
    single_name,
    vector_names,
)
from magcomp.autopilots.terms import Kind
from magcomp.errors import InputError
from magcomp.model import Compass, ParameterHistory

_OFFSETS_MAX_DEFAULT = 1800.0
_LEARN_FROM_ESTIMATOR = 2.0


def compasses(values: Mapping[str, float]) -> tuple[Compass, ...]:
    """The compasses whose device ids are known and not 0, in the order of their slots."""
    found = []
    for number in NUMBERS:
        device = _whole(values, single_name("DEV_ID", number))
        if not device:
            continue
        external = _whole(values, single_name("EXTERN", number))
        used = _whole(values, single_name("USE", number))
        found.append(
            Compass(
                slot=number,
                device_id=device,
                external=None if external is None else external > 0,
                orientation=_whole(values, single_name("ORIENT", number)),
                used=None if used is None else used > 0,
            )
        )
    return tuple(found)


def _whole(values: Mapping[str, float], name: str) -> int | None:
    value = values.get(name)
    return None if value is None or not math.isfinite(value) else int(value)


def left_out(parameters: ParameterHistory) -> dict[int, InputError]:
    """Compasses whose correction cannot be undone, with the error that says so."""
    found: dict[int, InputError] = {}
    for number in NUMBERS:
        names = (*acting_on(number), COMPENSATION_SWITCH)
        bad = {
            name: change.value
            for name in names
            for change in parameters.of(name)
            if not math.isfinite(change.value)
        }
        if bad:
            found[number] = not_finite(bad)
        elif (error := not_undoable(parameters, number)) is not None:
            found[number] = error
    return found


def warnings(values: Mapping[str, float]) -> Iterator[str]:
    """What stands in the way of a good calibration."""
    if values.get(PER_MOTOR_SWITCH, 0.0):
        yield (
            f"{PER_MOTOR_SWITCH} is on: compass 1 is corrected motor by motor and ignores "
            f"COMPASS_MOT and {COMPENSATION_SWITCH}"
        )
    learn = values.get(LEARN, 0.0)
    if learn:
        when = "in flight" if learn >= _LEARN_FROM_ESTIMATOR else "while the vehicle runs"
        yield f"{LEARN} is {learn:.0f}: the offsets may move {when}; set it to 0 while you record"
    for number in NUMBERS:
        yield from _of_compass(values, number)


def _of_compass(values: Mapping[str, float], number: int) -> Iterator[str]:
    use = single_name("USE", number)
    if values.get(use, 1.0) == 0.0:
        yield f"compass {number} is not used for the heading ({use} is 0)"
    scale = single_name("SCALE", number)
    if scale in values and not is_scale_used(values[scale]) and values[scale] != 0.0:
        yield f"{scale} {_short(values[scale])} is out of limits and will be ignored"
    orient, extern = single_name("ORIENT", number), single_name("EXTERN", number)
    if values.get(orient, 0.0) and values.get(extern, 1.0) == 0.0:
        yield (
            f"{orient} is {values[orient]:.0f} but compass {number} is internal ({extern} is 0): "
            "the vehicle turns it with the board and ignores it; if it is mounted apart, set "
            f"{extern} to 1 and calibrate anew"
        )
    yield from _long_offset(values, number)


def _long_offset(values: Mapping[str, float], number: int) -> Iterator[str]:
    """COMPASS_OFFS_MAX limits the length of the offsets, not each of them (AP_Arming)."""
    limit = values.get(OFFSETS_MAX, _OFFSETS_MAX_DEFAULT)
    names = vector_names("OFS", number)
    offset = np.array([values.get(name, 0.0) for name in names])
    length = float(np.linalg.norm(offset))
    if not length > limit:
        return
    refuses = "the vehicle will refuse to arm"
    largest = int(np.argmax(np.abs(offset)))
    if abs(offset[largest]) > limit:
        value = _short(float(offset[largest]))
        yield f"{names[largest]} {value} is beyond {OFFSETS_MAX} {_short(limit)}: {refuses}"
    else:
        yield (
            f"the length of {names[0][:-2]}, {length:.0f} mGauss, is beyond {OFFSETS_MAX} "
            f"{_short(limit)}: {refuses}"
        )


def write_warnings(asked: Mapping[str, float], held: Mapping[str, float]) -> Iterator[str]:
    """What a pilot must know of a write besides."""
    values = {**held, **asked}
    vectors = any(
        value and (found := parse(name)) is not None and found.kind in (Kind.MOTOR, Kind.PER_MOTOR)
        for name, value in asked.items()
    )
    if vectors and values.get(COMPENSATION_SWITCH) == 0 and not values.get(PER_MOTOR_SWITCH):
        yield f"{COMPENSATION_SWITCH} stays 0: the compensation will not be in force"


def _short(value: float) -> str:
    """As few digits as tell a float32."""
    return str(np.float32(value)).removesuffix(".0")


def relevant_names() -> tuple[str, ...]:
    """What to read before a vehicle is fitted or written."""
    settings = (single_name(kind, n) for n in NUMBERS for kind in ("USE", "ORIENT", "EXTERN"))
    return tuple(dict.fromkeys([COMPENSATION_SWITCH, *ACTING, OFFSETS_MAX, LEARN, *settings]))
