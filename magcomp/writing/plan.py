"""What a write will do: the difference between a vehicle and a parameter set.

Motor compensation is switched by one parameter for all compasses (and, where
per-motor compensation is built in, by one of its own). These are *switches*;
offsets, soft iron and compensation vectors are *values*. Everything else in a
parameter file is none of magcomp's business and is left out, unless asked for.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

from magcomp import autopilots
from magcomp.autopilots import Autopilot, Kind
from magcomp.errors import ParameterFileError, VehicleRefusedError, WriteError
from magcomp.mavlink.version import is_numbered_board
from magcomp.model import Compass, ParameterSet, Vehicle
from magcomp.writing.files import format_value
from magcomp.writing.rows import as_float32

_BOTH = 2


@dataclass(frozen=True)
class Change:
    """One parameter, before and after, as float32."""

    name: str
    old: float
    new: float


@dataclass(frozen=True)
class WritePlan:
    """Everything a safe write needs to know.

    Attributes
    ----------
    vehicle
        The vehicle to be written, with the device ids read from it.
    old
        Every calibration parameter it holds now: the backup.
    new
        Values that differ, as they shall be; without switches.
    switches
        What the switches shall be at the end, changed or not.
    identity
        Device ids by parameter name; must read the same before each write.
    left_out
        Names of the parameter set that are not written: no compass calibration, or not known.
    warnings
        Sentences for the pilot.
    """

    vehicle: Vehicle
    old: Mapping[str, float]
    new: Mapping[str, float]
    switches: Mapping[str, float]
    identity: Mapping[str, float]
    left_out: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def changes(self) -> tuple[Change, ...]:
        """What differs, switches last."""
        wanted = {**self.new, **self.switches}
        return tuple(
            Change(name, self.old[name], value)
            for name, value in wanted.items()
            if value != self.old[name]
        )

    @property
    def backup(self) -> ParameterSet:
        """What `restore` needs to bring the vehicle back to where it is now."""
        return ParameterSet(self.old, self.vehicle)


def relevant_names(
    autopilot: str, wanted: ParameterSet, *, everything: bool = False
) -> tuple[str, ...]:
    """Names to read from a vehicle before a plan can be made.

    Parameters
    ----------
    autopilot
        As in ``Vehicle.autopilot``.
    wanted
        What shall be written; its compass parameters are asked for as well.
    everything
        As for `plan`; all its parameters are asked for.
    """
    firmware = autopilots.named(autopilot)
    of_file = [
        n for n in wanted.values if _is_of_compass(n) or (everything and _is_rest(n, firmware))
    ]
    return tuple(dict.fromkeys((*firmware.relevant_names(), *of_file)))


def plan(
    current: Mapping[str, float],
    wanted: ParameterSet,
    vehicle: Vehicle,
    *,
    any_vehicle: bool = False,
    everything: bool = False,
) -> WritePlan:
    """Compare a vehicle with what is wanted.

    Parameters
    ----------
    current
        What the vehicle holds, at least `relevant_names` as far as it knows them.
    wanted
        What shall be written, and the vehicle it belongs to.
    vehicle
        The vehicle at the other end of the link.
    any_vehicle
        Write to a vehicle other than the set's.
    everything
        Write what is no compass calibration too, as far as the vehicle knows it and does not keep
        it itself.

    Raises
    ------
    VehicleRefusedError
        Where the set belongs to another vehicle, or does not say whose it is.
    WriteError
        Where the vehicle does not know a wanted calibration parameter, or holds one that no
        backup could bring back.
    ParameterFileError
        Where nothing of the set is compass calibration, a value does not fit
        float32, or a switch has no such position.
    """
    autopilot = autopilots.of(vehicle)
    rest = {
        name
        for name in wanted.values
        if everything and _is_rest(name, autopilot) and math.isfinite(current.get(name, math.nan))
    }
    held = _held(current, rest)
    identity = {name: current[name] for name in autopilot.device_id_names if name in current}
    read = autopilot.compasses(current)
    vehicle = replace(vehicle, compasses=read) if read else vehicle
    warnings = _check_identity(wanted, vehicle, any_vehicle=any_vehicle)
    unknown = [name for name in wanted.values if _is_calibration(name) and name not in current]
    if unknown:
        raise WriteError(
            f"{', '.join(unknown)} must exist on the vehicle; instead the vehicle does not know "
            f"{'it' if len(unknown) == 1 else 'them'}"
        )
    asked = _asked(wanted, rest)
    return WritePlan(
        vehicle=vehicle,
        old=held,
        new={n: asked[n] for n in in_order(asked) if not _is_switch(n) and asked[n] != held[n]},
        switches={n: asked.get(n, v) for n, v in held.items() if _is_switch(n)},
        identity=identity,
        left_out=tuple(name for name in wanted.values if name not in asked),
        warnings=(
            *(f"{text}." for text in wanted.warnings),
            *warnings,
            *_warnings(vehicle, current, asked),
        ),
    )


def in_order(names: Iterable[str]) -> list[str]:
    """Motor vectors before offsets before soft iron, each vector together; all else after them.

    A firmware may look at its parameters in the midst of a write (docs/autopilots.md, PX4: in
    force): what belongs together should arrive together.
    """

    def place(name: str) -> tuple[int, int]:
        found = autopilots.parse(name)
        if found is None or not found.kind.is_value:
            return len(Kind), 0
        return int(found.kind), found.compass

    return sorted(names, key=place)


def _held(current: Mapping[str, float], rest: Collection[str]) -> dict[str, float]:
    held = {}
    for name, value in current.items():
        if not _is_calibration(name) and name not in rest:
            continue
        try:
            held[name] = as_float32(value)
        except ValueError as error:
            raise WriteError(
                f"{name} must be a finite number on the vehicle, or no backup can bring it back; "
                f"instead received {value}"
            ) from error
    return held


def _asked(wanted: ParameterSet, rest: Collection[str]) -> dict[str, float]:
    asked = {}
    for name, value in wanted.values.items():
        if not _is_calibration(name) and name not in rest:
            continue
        try:
            asked[name] = as_float32(value)
        except ValueError as error:
            raise ParameterFileError(f"{name}: {error}") from error
        choices = _choices(name)
        if choices and value not in choices:
            raise ParameterFileError(
                f"{name} must be one of {', '.join(str(int(choice)) for choice in choices)}; "
                f"instead received {format_value(value)}"
            )
    if not asked:
        raise ParameterFileError(
            "the parameters must hold compass calibration; instead received only "
            f"{', '.join(list(wanted.values)[:3]) or 'nothing'}"
        )
    return asked


def _is_calibration(name: str) -> bool:
    found = autopilots.parse(name)
    return found is not None and (found.kind is Kind.SWITCH or found.kind.is_value)


def _is_rest(name: str, autopilot: Autopilot) -> bool:
    """Whether it is no calibration, and the pilot's to set."""
    return not _is_calibration(name) and autopilot.kept_names.fullmatch(name) is None


def _is_switch(name: str) -> bool:
    found = autopilots.parse(name)
    return found is not None and found.kind is Kind.SWITCH


def _is_of_compass(name: str) -> bool:
    return any(name.startswith(autopilot.compass_prefix) for autopilot in autopilots.ALL)


def _choices(name: str) -> tuple[int, ...]:
    return next((found for each in autopilots.ALL if (found := each.choices(name))), ())


def _check_identity(wanted: ParameterSet, actual: Vehicle, *, any_vehicle: bool) -> tuple[str, ...]:
    owner = wanted.vehicle
    compasses = () if owner is None else owner.compasses
    compasses = compasses or autopilots.of(actual).compasses(wanted.values)
    if owner is None and not compasses:
        complaint = (
            "the parameters must say which vehicle they belong to; instead they do not, "
            f"and this is {_described(actual)}"
        )
    else:
        same = _stand_alike(compasses, actual.compasses) and (
            owner is None or _may_be_one(owner, actual)
        )
        if same:
            return _unproven(owner, actual, named=bool(compasses))
        named = _described(owner) if owner else f"compasses {_listed(compasses)}"
        complaint = f"the vehicle must be {named}; instead it is {_described(actual)}"
    if not any_vehicle:
        raise VehicleRefusedError(f"{complaint} (--any-vehicle writes all the same)")
    return (f"Another vehicle is written on request: {complaint}.",)


def _may_be_one(owner: Vehicle, actual: Vehicle) -> bool:
    same = (owner.autopilot, owner.system) == (actual.autopilot, actual.system)
    boards = {board for board in (owner.board, actual.board) if is_numbered_board(board)}
    return same and len(boards) < _BOTH and _same_number(owner, actual) is not False


def _same_number(owner: Vehicle | None, actual: Vehicle) -> bool | None:
    """Whether the flight controller is the very same; None where one of both has no number."""
    if owner is None or not owner.uid or not actual.uid:
        return None
    return owner.uid == actual.uid


def _unproven(owner: Vehicle | None, actual: Vehicle, *, named: bool) -> tuple[str, ...]:
    """What could not be compared, for the pilot to look at."""
    if _same_number(owner, actual):
        return ()
    if not named:
        return ("The parameters name no compass, so only the system number was compared.",)
    who = "The parameters" if owner is None or not owner.uid else "The vehicle"
    return (
        f"{who} give{'s' if who == 'The vehicle' else ''} no number of the flight controller, so "
        "another vehicle with the same compasses would not be told from this one.",
    )


def _stand_alike(wanted: Iterable[Compass], actual: Iterable[Compass]) -> bool:
    """Whether each slot that is known holds the same sensor: parameters belong to slots."""
    held = {compass.slot: compass.device_id for compass in actual}
    return all(held.get(each.slot) == each.device_id for each in wanted if each.device_id)


def _described(vehicle: Vehicle) -> str:
    return (
        f"{autopilots.title(vehicle.autopilot)} system {vehicle.system} "
        f"with compasses {_listed(vehicle.compasses)}"
        + (f", {vehicle.board}" if vehicle.board else "")
        + (f" and flight controller {vehicle.uid}" if vehicle.uid else "")
    )


def _listed(compasses: Iterable[Compass]) -> str:
    """Device ids in the order of the slots; a slot of which nothing is known is a dash."""
    by_slot = {compass.slot: compass.device_id for compass in compasses if compass.device_id}
    slots = range(1, max(by_slot, default=0) + 1)
    return ", ".join(str(by_slot.get(slot, "–")) for slot in slots) or "unknown"


def _warnings(
    vehicle: Vehicle, current: Mapping[str, float], asked: Mapping[str, float]
) -> list[str]:
    autopilot, after = autopilots.of(vehicle), {**current, **asked}
    found = (*autopilot.warnings(after), *autopilot.write_warnings(asked, current))
    return [f"{text[:1].upper()}{text[1:]}." for text in found]
