"""What this vehicle's firmware can multiply a correction by, and what that means for a fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from magcomp import autopilots
from magcomp.errors import MissingDataError
from magcomp.model import SPEED_CONTROLLERS, FloatArray, Recording, Series, quantity_of

_USUAL = ("copter", "unknown")
_LEAST_SHARE = 0.1
_LEAST_CORRELATION = 0.8
_LEAST_ROWS = 30


def kinds_to_try(recording: Recording, kinds: Sequence[str]) -> list[str]:
    """Those control quantities of a recording that its firmware can multiply.

    Raises
    ------
    MissingDataError
        Where it can multiply none of them.
    """
    autopilot = autopilots.of(recording)
    can = autopilot.multiplied(recording.vehicle)
    found = [kind for kind in kinds if kind in can]
    if not found:
        raise MissingDataError(
            f"{recording.source} must hold a {' or '.join(can)}, which is all that "
            f"{autopilot.title} multiplies in a {recording.vehicle.kind}; instead it holds only "
            f"{', '.join(kinds)}: {autopilot.how_to_record(can[0], recording.format)}"
        )
    return found


def why_only_to_look_at(recording: Recording, kind: str) -> str:
    """Why a fit against a control quantity cannot be written; empty where it can."""
    autopilot = autopilots.of(recording)
    can = autopilot.multiplied(recording.vehicle)
    if quantity_of(kind).single not in can:
        return (
            f"{autopilot.title} multiplies only the {' or '.join(can)} in a "
            f"{recording.vehicle.kind}: a fit by {kind} is to look at, and cannot be written"
        )
    if not quantity_of(kind).is_throttle and recording.battery not in autopilot.batteries:
        numbers = " or ".join(map(str, autopilot.batteries))
        whose = f"battery {recording.battery}"
        if recording.battery == SPEED_CONTROLLERS:
            whose = "the speed controllers"
        return (
            f"{autopilot.title} multiplies only the current of battery {numbers}: a fit by that of "
            f"{whose} is to look at, and cannot be written"
        )
    return ""


def multiplied_notes(recording: Recording, kind: str) -> Iterator[str]:
    """What a user should know of the control quantity that was fitted."""
    vehicle = recording.vehicle
    if vehicle.kind not in _USUAL:
        autopilot = autopilots.of(recording)
        can = " or ".join(autopilot.multiplied(vehicle))
        yield f"the vehicle is a {vehicle.kind}, in which {autopilot.title} multiplies the {can}"
    if not quantity_of(kind).is_throttle:
        yield from _other_batteries(recording)
    if why_not := why_only_to_look_at(recording, kind):
        yield why_not


def _other_batteries(recording: Recording) -> Iterator[str]:
    """Other batteries that feed the motors too, so that the fitted one tells only a part."""
    main = recording.current
    if main is None or len(main) < _LEAST_ROWS:
        return
    feeding = [
        number
        for number, other in sorted(recording.other_currents.items())
        if len(other) >= _LEAST_ROWS and _rises_with(main, other)
    ]
    if feeding:
        autopilot = autopilots.of(recording)
        named = " and ".join(f"battery {number}" for number in feeding)
        yield (
            f"the current of {named} rises with that of battery {recording.battery}, so the motors "
            f"draw from more than the fitted one: "
            f"{autopilot.how_to_record('all currents', recording.format)}"
        )


def _rises_with(main: Series, other: Series) -> bool:
    value: FloatArray = np.interp(main.time, other.time, other.value)
    spread, by_main = float(np.std(value)), float(np.std(main.value))
    if not spread > _LEAST_SHARE * by_main or not by_main > 0.0:
        return False
    return bool(np.corrcoef(value, main.value)[0, 1] > _LEAST_CORRELATION)
