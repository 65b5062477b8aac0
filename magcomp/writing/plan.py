"""What a write will do: the difference between a vehicle and a parameter set.

Motor compensation is switched by one parameter for all compasses
(COMPASS_MOTCT; CAL_MAG_COMP_TYP on PX4), and by COMPASS_PMOT_EN for compass 1
where per-motor compensation is built in. These are *switches*; offsets, soft
iron and compensation vectors are *values*. Everything else in a parameter
file is none of magcomp's business and is left out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

from magcomp.errors import ParameterFileError, VehicleRefusedError, WriteError
from magcomp.model import ParameterSet, Vehicle
from magcomp.writing.files import as_float32, format_value

_SWITCH = re.compile(r"COMPASS_MOTCT|COMPASS_PMOT_EN|CAL_MAG_COMP_TYP")
_VALUE = re.compile(
    r"COMPASS_(OFS|DIA|ODI|MOT)[23]?_[XYZ]|COMPASS_SCALE[23]?|COMPASS_PMOT(_EXP|[1-4]_[XYZ])"
    r"|CAL_MAG[0-3]_[XYZ](OFF|SCALE|ODIAG|COMP)"
)
_DEVICE = re.compile(r"COMPASS_DEV_ID[23]?|CAL_MAG[0-3]_ID")
_COMPASS = re.compile(r"COMPASS_|CAL_MAG")

_OFFSETS_MAX = "COMPASS_OFFS_MAX"
_OFFSETS_MAX_DEFAULT = 1800.0
_SCALE_LIMIT = 1.5
_CHOICES = {"COMPASS_MOTCT": (0, 1, 2), "COMPASS_PMOT_EN": (0, 1), "CAL_MAG_COMP_TYP": (0, 1, 2, 3)}


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
        Names of the parameter set that are not compass calibration.
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


def relevant_names(autopilot: str, wanted: ParameterSet) -> tuple[str, ...]:
    """Names to read from a vehicle before a plan can be made.

    Parameters
    ----------
    autopilot
        ``"ardupilot"`` or ``"px4"``.
    wanted
        What shall be written; its compass parameters are asked for as well.
    """
    axes = "XYZ"
    if autopilot == "px4":
        kinds = ("OFF", "SCALE", "ODIAG", "COMP")
        names = ["CAL_MAG_COMP_TYP", *(f"CAL_MAG{n}_ID" for n in range(4))]
        names += [f"CAL_MAG{n}_{a}{kind}" for n in range(4) for kind in kinds for a in axes]
    else:
        numbers = ("", "2", "3")
        names = ["COMPASS_MOTCT", "COMPASS_PMOT_EN", _OFFSETS_MAX]
        names += [f"COMPASS_{kind}{n}" for n in numbers for kind in ("DEV_ID", "SCALE")]
        kinds = ("OFS", "DIA", "ODI", "MOT")
        names += [f"COMPASS_{kind}{n}_{a}" for n in numbers for kind in kinds for a in axes]
    names += [name for name in wanted.values if _COMPASS.match(name)]
    return tuple(dict.fromkeys(names))


def plan(
    current: Mapping[str, float],
    wanted: ParameterSet,
    vehicle: Vehicle,
    *,
    any_vehicle: bool = False,
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

    Raises
    ------
    VehicleRefusedError
        Where the set belongs to another vehicle, or does not say whose it is.
    WriteError
        Where the vehicle does not know a wanted parameter, or holds one that no
        backup could bring back.
    ParameterFileError
        Where nothing of the set is compass calibration, a value does not fit
        float32, or a switch has no such position.
    """
    held = _held(current)
    identity = {name: value for name, value in current.items() if _DEVICE.fullmatch(name)}
    vehicle = _with_devices(vehicle, identity)
    warnings = _check_identity(wanted, vehicle, any_vehicle=any_vehicle)
    unknown = [name for name in wanted.values if _COMPASS.match(name) and name not in current]
    if unknown:
        raise WriteError(
            f"{', '.join(unknown)} must exist on the vehicle; instead the vehicle does not know "
            f"{'it' if len(unknown) == 1 else 'them'}"
        )
    asked = _asked(wanted)
    return WritePlan(
        vehicle=vehicle,
        old=held,
        new={n: v for n, v in asked.items() if not _SWITCH.fullmatch(n) and v != held[n]},
        switches={n: asked.get(n, v) for n, v in held.items() if _SWITCH.fullmatch(n)},
        identity=identity,
        left_out=tuple(name for name in wanted.values if name not in asked),
        warnings=(*warnings, *_warnings(current, asked)),
    )


def _held(current: Mapping[str, float]) -> dict[str, float]:
    held = {}
    for name, value in current.items():
        if not _is_calibration(name):
            continue
        try:
            held[name] = as_float32(value)
        except ValueError as error:
            raise WriteError(
                f"{name} must be a finite number on the vehicle, or no backup can bring it back; "
                f"instead received {value}"
            ) from error
    return held


def _asked(wanted: ParameterSet) -> dict[str, float]:
    asked = {}
    for name, value in wanted.values.items():
        if not _is_calibration(name):
            continue
        try:
            asked[name] = as_float32(value)
        except ValueError as error:
            raise ParameterFileError(f"{name}: {error}") from error
        if name in _CHOICES and value not in _CHOICES[name]:
            raise ParameterFileError(
                f"{name} must be one of {', '.join(map(str, _CHOICES[name]))}; "
                f"instead received {format_value(value)}"
            )
    if not asked:
        raise ParameterFileError(
            "the parameters must hold compass calibration; instead received only "
            f"{', '.join(list(wanted.values)[:3]) or 'nothing'}"
        )
    return asked


def _is_calibration(name: str) -> bool:
    return bool(_SWITCH.fullmatch(name) or _VALUE.fullmatch(name))


def _devices(values: Mapping[str, float]) -> tuple[int, ...]:
    return tuple(int(values[n]) for n in sorted(values) if _DEVICE.fullmatch(n) and values[n] != 0)


def _with_devices(vehicle: Vehicle, identity: Mapping[str, float]) -> Vehicle:
    return replace(vehicle, device_ids=_devices(identity) or vehicle.device_ids)


def _check_identity(wanted: ParameterSet, actual: Vehicle, *, any_vehicle: bool) -> tuple[str, ...]:
    owner = wanted.vehicle
    devices = owner.device_ids if owner and owner.device_ids else _devices(wanted.values)
    if owner is None and not devices:
        complaint = (
            "the parameters must say which vehicle they belong to; instead they do not, "
            f"and this is {_described(actual)}"
        )
    else:
        same = _is_subsequence(devices, actual.device_ids) and (
            owner is None or (owner.autopilot, owner.system) == (actual.autopilot, actual.system)
        )
        if same and devices:
            return ()
        if same:
            return ("The parameters name no compass, so only the system number was compared.",)
        named = _described(owner) if owner else f"compasses {_listed(devices)}"
        complaint = f"the vehicle must be {named}; instead it is {_described(actual)}"
    if not any_vehicle:
        raise VehicleRefusedError(f"{complaint} (--any-vehicle writes all the same)")
    return (f"Another vehicle is written on request: {complaint}.",)


def _is_subsequence(part: tuple[int, ...], whole: tuple[int, ...]) -> bool:
    rest = iter(whole)
    return all(device in rest for device in part)


def _described(vehicle: Vehicle) -> str:
    return (
        f"{vehicle.autopilot} system {vehicle.system} with compasses {_listed(vehicle.device_ids)}"
    )


def _listed(devices: tuple[int, ...]) -> str:
    return ", ".join(map(str, devices)) or "unknown"


def _warnings(current: Mapping[str, float], asked: Mapping[str, float]) -> list[str]:
    warnings = []
    limit = current.get(_OFFSETS_MAX, _OFFSETS_MAX_DEFAULT)
    for name, value in asked.items():
        if name.startswith("COMPASS_OFS") and abs(value) > limit:
            warnings.append(
                f"{name} {format_value(value)} is beyond {_OFFSETS_MAX} {format_value(limit)}: "
                "the vehicle will refuse to arm."
            )
        if name.startswith("COMPASS_SCALE") and not 1 / _SCALE_LIMIT <= value <= _SCALE_LIMIT:
            warnings.append(f"{name} {format_value(value)} is out of limits and will be ignored.")
    after = {**current, **asked}
    vectors = any(
        value and "MOT" in name and not _SWITCH.fullmatch(name) for name, value in asked.items()
    )
    if vectors and after.get("COMPASS_MOTCT") == 0 and not after.get("COMPASS_PMOT_EN"):
        warnings.append("COMPASS_MOTCT stays 0: the compensation will not be in force.")
    if after.get("COMPASS_PMOT_EN"):
        warnings.append("COMPASS_PMOT_EN is on: compass 1 ignores COMPASS_MOT and COMPASS_MOTCT.")
    return warnings
