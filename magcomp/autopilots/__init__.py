"""What each autopilot does to a compass reading, and the names of the parameters that say so."""

from __future__ import annotations

from collections.abc import Mapping

from magcomp.autopilots.ardupilot import ArduPilot
from magcomp.autopilots.protocol import Autopilot
from magcomp.autopilots.px4 import Px4
from magcomp.autopilots.terms import Kind, Leeway, ParameterName
from magcomp.errors import MissingDataError
from magcomp.model import Recording, Vehicle

ALL: tuple[Autopilot, ...] = (ArduPilot(), Px4())
"""Every firmware magcomp knows."""

_BY_KEY: Mapping[str, Autopilot] = {autopilot.key: autopilot for autopilot in ALL}

TITLES = " or ".join(autopilot.title for autopilot in ALL)
"""Their names for people, as alternatives."""


def of(source: Vehicle | Recording) -> Autopilot:
    """The firmware of a vehicle, or of the vehicle that made a recording.

    Raises
    ------
    MissingDataError
        It is none that magcomp knows.
    """
    vehicle = source.vehicle if isinstance(source, Recording) else source
    return named(vehicle.autopilot)


def named(key: str) -> Autopilot:
    """The firmware that ``Vehicle.autopilot`` names.

    Raises
    ------
    MissingDataError
        It is none that magcomp knows.
    """
    if key not in _BY_KEY:
        raise MissingDataError(
            f"The autopilot must be one of {', '.join(_BY_KEY)}; instead received {key!r}"
        )
    return _BY_KEY[key]


def title(key: str) -> str:
    """Name for people of what ``Vehicle.autopilot`` says, known here or not."""
    return _BY_KEY[key].title if key in _BY_KEY else key


def parse(name: str) -> ParameterName | None:
    """Take apart a compass parameter's name, whichever firmware it is of; None where of none."""
    return next((found for each in ALL if (found := each.parse(name)) is not None), None)


def offset_decimals(name: str) -> int:
    """So many decimals of an offset of any firmware are finer than a heading can tell."""
    return next((each.offset_decimals for each in ALL if each.parse(name) is not None), 2)


def integer_type(name: str) -> int | None:
    """MAV_PARAM_TYPE of a compass parameter of any firmware that holds whole numbers, else None."""
    return next((kind for each in ALL if (kind := each.integer_type(name)) is not None), None)


__all__ = [
    "ALL",
    "TITLES",
    "Autopilot",
    "Kind",
    "Leeway",
    "ParameterName",
    "integer_type",
    "named",
    "of",
    "parse",
    "title",
]
