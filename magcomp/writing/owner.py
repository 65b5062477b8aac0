"""Whose parameters a file holds: a vehicle as JSON, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, TypeVar

from magcomp.model import Compass, Vehicle, compasses_of

_T = TypeVar("_T")


def document(vehicle: Vehicle) -> dict[str, Any]:
    """What a file says of a vehicle.

    The compasses stand there only if they tell more than their ids in order. What a live vehicle
    says of itself each time (how its parameters travel) does not.
    """
    said: dict[str, Any] = {
        "autopilot": vehicle.autopilot,
        "kind": vehicle.kind,
        "system": vehicle.system,
        "component": vehicle.component,
        "firmware": vehicle.firmware,
        "device_ids": list(vehicle.device_ids),
        "board": vehicle.board,
    }
    if vehicle.compasses != compasses_of(vehicle.device_ids):
        said["compasses"] = [asdict(compass) for compass in vehicle.compasses]
    if vehicle.uid:
        said["uid"] = vehicle.uid
    return said


def vehicle_of(text: str) -> Vehicle:
    """The vehicle a file says.

    Raises
    ------
    ValueError
        The text is not as :func:`document` makes it.
    """
    try:
        found = json.loads(text)
        return Vehicle(
            autopilot=_typed(found["autopilot"], str),
            kind=_typed(found["kind"], str),
            system=_typed(found["system"], int),
            component=_typed(found["component"], int),
            firmware=_typed(found["firmware"], str),
            compasses=_compasses(found),
            board=_typed(found.get("board", ""), str),
            uid=_typed(found.get("uid", ""), str),
        )
    except (LookupError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(str(error)) from error


def _compasses(found: Mapping[str, Any]) -> tuple[Compass, ...]:
    """By slot where the file tells it; older ones list the ids alone, in order."""
    ids = [_typed(device, int) for device in _typed(found["device_ids"], list)]
    if "compasses" not in found:
        return compasses_of(ids)
    return tuple(
        Compass(
            slot=_typed(each["slot"], int),
            device_id=_typed(each["device_id"], int),
            external=_if_known(each["external"], bool),
            orientation=_if_known(each["orientation"], int),
            used=_if_known(each["used"], bool),
        )
        for each in _typed(found["compasses"], list)
    )


def _if_known(value: object, kind: type[_T]) -> _T | None:
    return None if value is None else _typed(value, kind)


def _typed(value: object, kind: type[_T]) -> _T:
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise TypeError(f"a value must be {kind.__name__}; instead received {value!r}")
    return value
