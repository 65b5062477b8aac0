"""What was recorded: the same frozen tables whatever the source.

Units inside magcomp are mGauss, amperes, volts, radians, seconds and throttle
0 … 1; degrees only in a position. Time zero is the first message used.
"""

from __future__ import annotations

import dataclasses
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Series:
    """A quantity against time.

    Attributes
    ----------
    time
        Seconds since the recording began, shape (n,), never decreasing.
    value
        The quantity, shape (n,) or (n, k).
    """

    time: FloatArray
    value: FloatArray

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Vehicle:
    """Who made the recording.

    Attributes
    ----------
    autopilot
        ``"ardupilot"`` or ``"px4"``.
    kind
        ``"copter"``, ``"plane"``, ``"rover"``, ``"boat"``, ``"sub"`` or ``"unknown"``.
    system, component
        MAVLink identity of the autopilot.
    firmware
        Version such as ``"4.6.3"``; empty where the recording does not say.
    device_ids
        Of its compasses, in the order of their parameters, as far as known and not 0.
    board
        Flight controller, as far as a live vehicle names it; empty where unknown.
    capabilities
        AUTOPILOT_VERSION.capabilities, which say how its parameters travel; 0 where unknown.
    """

    autopilot: str
    kind: str
    system: int
    component: int
    firmware: str = ""
    device_ids: tuple[int, ...] = ()
    board: str = ""
    capabilities: int = 0


@dataclass(frozen=True)
class ReadReport:
    """What a reader made of its bytes.

    Attributes
    ----------
    size
        Bytes in the source.
    frames
        Whole frames found.
    used
        Frames decoded into the recording.
    bad_checksum
        Frames of the wanted messages that failed their checksum.
    skipped
        Bytes that belong to no frame.
    duplicates
        Frames dropped because the same frame stood in the log before.
    others
        (system, component) pairs whose messages were left out.
    """

    size: int
    frames: int
    used: int
    bad_checksum: int = 0
    skipped: int = 0
    duplicates: int = 0
    others: tuple[tuple[int, int], ...] = ()


class ParameterChange(NamedTuple):
    """A parameter's value as the vehicle reported it at ``time`` (seconds).

    A tuple, because a log holds thousands and a dataclass each would take a tenth of its reading.
    """

    time: float
    name: str
    value: float


_time = attrgetter("time")


@dataclass(frozen=True)
class ParameterHistory:
    """Every parameter value the vehicle reported, in order of time.

    A value holds from its report until the next one; the first report of a
    name also holds before it, because ground stations ask for the list late.
    """

    changes: tuple[ParameterChange, ...] = ()
    _by_name: Mapping[str, tuple[ParameterChange, ...]] = dataclasses.field(
        init=False, repr=False, compare=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        by_name: dict[str, list[ParameterChange]] = {}
        for change in sorted(self.changes, key=_time):
            by_name.setdefault(change.name, []).append(change)
        frozen = {name: tuple(changes) for name, changes in by_name.items()}
        object.__setattr__(self, "_by_name", frozen)

    @property
    def names(self) -> frozenset[str]:
        """Every name ever reported."""
        return frozenset(self._by_name)

    def of(self, name: str) -> tuple[ParameterChange, ...]:
        """Every report of one name, oldest first; empty where there is none."""
        return self._by_name.get(name, ())

    def at(self, name: str, time: float, default: float) -> float:
        """Value of ``name`` in force at ``time``, or ``default`` where never reported."""
        changes = self.of(name)
        if not changes:
            return default
        return changes[max(bisect_right(changes, time, key=_time) - 1, 0)].value

    def last(self, name: str, default: float) -> float:
        """Value of ``name`` at the end of the recording."""
        changes = self.of(name)
        return changes[-1].value if changes else default


@dataclass(frozen=True, eq=False)
class Applied:
    """What a log itself says was applied to the readings of one compass.

    Attributes
    ----------
    offset
        Offsets that were added, mGauss, at the times of the compass's field; value (n, 3).
    motor
        Motor correction that was added last, mGauss, at the same times; value (n, 3).
    """

    offset: Series
    motor: Series


@dataclass(frozen=True, eq=False)
class Recording:
    """Everything of a log, or of a live link so far, that the rest of magcomp needs.

    Attributes
    ----------
    source
        File name or address, for people.
    start_unix_s
        Unix time of time zero, from the clock of whoever recorded; NaN where unknown.
    duration_s
        Time of the last message used.
    field
        Compass number (1, 2, 3: the autopilot's priority order) to the body-axes
        field in mGauss, shape (n, 3), *as the autopilot reports it*: corrected.
        Repeats are still in; rows whose field is exactly (0, 0, 0) are not.
    attitude
        Roll, pitch, yaw in radians, shape (n, 3).
    gyro, accel
        Body rates in rad/s and specific force in m/s², shape (n, 3), of the first IMU.
    throttle
        Thrust demand 0 … 1 as the autopilot reports it, shape (n,).
    current, voltage
        Battery instance 0 in A and V, shape (n,); absent readings are left out.
    outputs
        Servo outputs in microseconds, shape (n, 16); 0 where not driven.
    position
        Latitude and longitude in degrees, altitude above sea level in m, shape (n, 3).
    armed
        1 armed, 0 disarmed, shape (n,).
    format
        What it was read from: ``"tlog"``, ``"live"``, ``"dataflash"`` or ``"ulog"``. How late a
        quantity is depends on it.
    other_currents
        Battery instance (1, 2, …) to its current in A, where there is more than one battery.
    applied
        Compass number to what the log says was applied to its readings, where it says so
        (dataflash does); empty where only parameters tell.
    raw_compasses
        Compasses whose ``field`` is the sensor's own, turned into body axes and not corrected.
    """

    source: str
    vehicle: Vehicle
    start_unix_s: float
    duration_s: float
    field: Mapping[int, Series]
    parameters: ParameterHistory
    report: ReadReport
    attitude: Series | None = None
    gyro: Series | None = None
    accel: Series | None = None
    throttle: Series | None = None
    current: Series | None = None
    voltage: Series | None = None
    outputs: Series | None = None
    position: Series | None = None
    armed: Series | None = None
    format: str = "tlog"
    other_currents: Mapping[int, Series] = dataclasses.field(default_factory=dict)
    applied: Mapping[int, Applied] = dataclasses.field(default_factory=dict)
    raw_compasses: frozenset[int] = frozenset()
