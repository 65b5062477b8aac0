"""What PX4's settings mean for a calibration: which compass is which, what stands in the way.

Every sentence about a setting stands here once, without its full stop.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from magcomp.autopilots.px4_correction import Compensation, stored
from magcomp.autopilots.px4_names import (
    BOARD_ANGLES,
    BOARD_ROTATION,
    COMPENSATION_SWITCH,
    SLOTS,
    acting_on,
    angle_names,
    parse,
    single_name,
)
from magcomp.autopilots.px4_rotation import rotation_number
from magcomp.autopilots.px4_taking_over import sentences
from magcomp.autopilots.rotations import ROTATIONS
from magcomp.autopilots.terms import Kind
from magcomp.errors import InputError, MissingDataError, ParameterFileError
from magcomp.model import Compass, ParameterHistory

NUMBERS = tuple(slot + 1 for slot in SLOTS)
_BY_ANGLES = 100
_FLATTEST = 0.01
"""A soft iron that leaves less of a direction cannot be undone."""

_MOST = (1e4, math.inf)
"""No gauss and no scale is as large; the firmware takes any switch."""


def compasses(values: Mapping[str, float]) -> tuple[Compass, ...]:
    """By CAL_MAGn_ID; CAL_MAGn_ROT is −1 for internal ones, CAL_MAGn_PRIO 0 for unused ones."""
    found = []
    for number in NUMBERS:
        device = values.get(single_name("ID", number), 0.0)
        if math.isfinite(device) and device:
            turned = single_name("ROT", number) in values
            rotation = rotation_number(values, number)
            priority = values.get(single_name("PRIO", number))
            found.append(
                Compass(
                    slot=number,
                    device_id=int(device) % (1 << 32),
                    external=rotation >= 0 if turned else None,
                    orientation=rotation if turned and rotation >= 0 else None,
                    used=None if priority is None else priority != 0,
                )
            )
    return tuple(found)


def slot_of(values: Mapping[str, float], device: int) -> int | None:
    """The compass number of a device id; None where no slot holds it."""
    known = (compass.slot for compass in compasses(values) if compass.device_id == device)
    return next(known, None)


def left_out(parameters: ParameterHistory) -> dict[int, InputError]:
    """Compasses that cannot be fitted or written, with the error that says so."""
    found: dict[int, InputError] = {}
    values = parameters.latest
    slots = {compass.slot for compass in compasses(values)}
    for number in NUMBERS:
        names = (*acting_on(number), COMPENSATION_SWITCH)
        bad = {
            name: change.value
            for name in names
            for change in parameters.of(name)
            if not abs(change.value) < _MOST[name == COMPENSATION_SWITCH]  # NaN fails
        }
        if bad:
            found[number] = _not_sound(bad)
        elif number not in slots:
            found[number] = MissingDataError(
                f"compass {number} must have a calibration slot of its own; instead "
                f"{single_name('ID', number)} is 0: calibrate the compasses once with the ground "
                "station and record again"
            )
        elif np.linalg.eigvalsh(stored(values, number).soft_iron).min() < _FLATTEST:
            found[number] = ParameterFileError(
                f"SCALE and ODIAG of CAL_MAG{number - 1} must make a soft iron that can be undone; "
                "instead theirs flattens a direction or turns it around: calibrate the compass "
                "anew and record again"
            )
    return found


def _not_sound(values: Mapping[str, float]) -> ParameterFileError:
    listed = ", ".join(values)
    held = ", ".join(dict.fromkeys(str(value) for value in values.values()))
    ones = [(found := parse(name)) is not None and found.kind is Kind.DIAGONAL for name in values]
    neutral = "1" if all(ones) else "0 (those of SCALE to 1)" if any(ones) else "0"
    many = len(values) > 1
    return ParameterFileError(
        f"{listed} must be {'numbers' if many else 'a number'} that a compass can have; instead "
        f"the log holds {held}: set {'them' if many else 'it'} to {neutral}, restart the vehicle "
        "and record again"
    )


def warnings(values: Mapping[str, float]) -> Iterator[str]:
    """What stands in the way of a good calibration."""
    switch = values.get(COMPENSATION_SWITCH, 0.0)
    if switch not in tuple(Compensation):
        yield f"{COMPENSATION_SWITCH} is {switch:g}, which the vehicle takes for 0, off"
    for compass in compasses(values):
        number = compass.slot
        if compass.used is False:
            name = single_name("PRIO", number)
            yield f"compass {number} is not used for the heading ({name} is 0)"
        rotation = rotation_number(values, number)
        if rotation >= 0 and rotation not in (*ROTATIONS, _BY_ANGLES):
            yield (
                f"{single_name('ROT', number)} is {rotation}, which is no rotation known here: "
                f"compass {number} is taken as not turned"
            )


def write_warnings(asked: Mapping[str, float], held: Mapping[str, float]) -> Iterator[str]:
    """What a pilot must know of a write besides."""
    values = {**held, **asked}
    kinds = {
        found.kind for name, value in asked.items() if value and (found := parse(name)) is not None
    }
    if Kind.MOTOR in kinds and values.get(COMPENSATION_SWITCH) == 0:
        yield f"{COMPENSATION_SWITCH} stays 0: the compensation will not be in force"
    yield from sentences(asked, held, tuple(each.slot for each in compasses(values)))


def relevant_names() -> tuple[str, ...]:
    """What to read before a vehicle is fitted or written."""
    vectors = (name for number in NUMBERS for name in acting_on(number))
    single = (single_name(kind, number) for number in NUMBERS for kind in ("ID", "ROT", "PRIO"))
    return (COMPENSATION_SWITCH, *single, *vectors)


def turning_names() -> tuple[str, ...]:
    """What else says how the compasses are turned: not there in every firmware."""
    angles = (name for number in NUMBERS for name in angle_names(number))
    return (BOARD_ROTATION, *BOARD_ANGLES, *angles)


__all__ = [
    "NUMBERS",
    "compasses",
    "left_out",
    "relevant_names",
    "slot_of",
    "turning_names",
    "warnings",
    "write_warnings",
]
