"""What was recorded: the same frozen tables whatever the source.

Units inside magcomp are mGauss, amperes, volts, radians, seconds and throttle
0 … 1; degrees only in a position. Time zero is the first message used.
"""

from __future__ import annotations

import dataclasses
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


SPEED_CONTROLLERS = -1
"""In place of a battery's number: the speed controllers together."""


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


def interpolate(series: Series, time: FloatArray) -> FloatArray:
    """A series at other times, linearly; shape (n,) or (n, k).

    Examples
    --------
    >>> interpolate(Series(np.array([0.0, 1.0]), np.array([10.0, 20.0])), np.array([0.25])).tolist()
    [12.5]
    """
    if series.value.ndim == 1:
        return np.asarray(np.interp(time, series.time, series.value))
    return np.array([np.interp(time, series.time, column) for column in series.value.T]).T


def running_mean(series: Series, half_width: float) -> Series:
    """Mean over a window in time, shape (n,) or (n, k).

    Parameters
    ----------
    series
        Its times never decrease.
    half_width
        Of the window, seconds.

    Examples
    --------
    >>> steps = Series(np.array([0.0, 1.0, 2.0]), np.array([0.0, 3.0, 9.0]))
    >>> running_mean(steps, 1.0).value.tolist()
    [1.5, 4.0, 6.0]
    """
    total = np.zeros((len(series) + 1, *series.value.shape[1:]))
    np.cumsum(series.value, axis=0, out=total[1:])
    first = np.searchsorted(series.time, series.time - half_width, side="left")
    last = np.searchsorted(series.time, series.time + half_width, side="right")
    count = (last - first).reshape(-1, *[1] * (series.value.ndim - 1))
    return Series(series.time, (total[last] - total[first]) / count)


@dataclass(frozen=True)
class Compass:
    """A compass of a vehicle, as its parameters describe it.

    Attributes
    ----------
    slot
        Its number 1, 2, … in ``Recording.field`` and in the parameters' names.
    device_id
        Bus, address and kind of sensor in one number; 0 where unknown.
    external
        Whether it stands away from the flight controller; None where unknown.
    orientation
        How an external one is turned against the vehicle (MAV_SENSOR_ROTATION); None where unknown.
    used
        Whether the vehicle takes its heading from it; None where unknown.
    """

    slot: int
    device_id: int = 0
    external: bool | None = None
    orientation: int | None = None
    used: bool | None = None


def compasses_of(device_ids: Iterable[int]) -> tuple[Compass, ...]:
    """Compasses of which only the ids are known, in slots 1, 2, … without gap."""
    return tuple(Compass(slot, device_id) for slot, device_id in enumerate(device_ids, start=1))


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
    compasses
        Its compasses in the order of their slots, as far as known.
    board
        Flight controller, as far as a live vehicle names it; empty where unknown.
    capabilities
        AUTOPILOT_VERSION.capabilities, which say how its parameters travel; 0 where unknown.
    uid
        The flight controller's own number (AUTOPILOT_VERSION.uid2, else uid), in hexadecimal;
        empty where unknown.
    frame
        How its motors are arranged, in the firmware's words such as ``"HEXA/X"``; empty where
        unknown.
    """

    autopilot: str
    kind: str
    system: int
    component: int
    firmware: str = ""
    compasses: tuple[Compass, ...] = ()
    board: str = ""
    capabilities: int = 0
    uid: str = ""
    frame: str = ""

    @property
    def device_ids(self) -> tuple[int, ...]:
        """Ids of the compasses in the order of their slots, without those unknown."""
        return tuple(compass.device_id for compass in self.compasses if compass.device_id)


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
    notes
        What else a user should know, a sentence each without its full stop.
    """

    size: int
    frames: int
    used: int
    bad_checksum: int = 0
    skipped: int = 0
    duplicates: int = 0
    others: tuple[tuple[int, int], ...] = ()
    notes: tuple[str, ...] = ()


class ParameterChange(NamedTuple):
    """A parameter's value as the vehicle reported it at ``time`` (seconds).

    A tuple, because a log holds thousands and a dataclass each would take a tenth of its reading.
    """

    time: float
    name: str
    value: float


_time = itemgetter(0)


@dataclass(frozen=True)
class ParameterHistory:
    """Every parameter value the vehicle reported, in order of time.

    A value holds from its report until the next one; the first report of a
    name also holds before it, because ground stations ask for the list late.

    Attributes
    ----------
    changes
        Every report.
    whole
        Whether the vehicle's whole list is here, so that a name not in it does not exist.
    """

    changes: tuple[ParameterChange, ...] = ()
    whole: bool = False
    _by_name: Mapping[str, tuple[ParameterChange, ...]] = dataclasses.field(
        init=False, repr=False, compare=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        by_name: defaultdict[str, list[ParameterChange]] = defaultdict(list)
        for change in sorted(self.changes, key=_time):
            by_name[change[1]].append(change)
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

    @property
    def latest(self) -> dict[str, float]:
        """Value of every name at the end of the recording."""
        return {name: changes[-1].value for name, changes in self._by_name.items()}


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
        Battery instance ``battery`` in A and V, shape (n,); absent readings are left out.
    outputs
        Servo outputs in microseconds, shape (n, 16); 0 where not driven.
    position
        Latitude and longitude in degrees, altitude above sea level in m, shape (n, 3).
    armed
        1 armed, 0 disarmed, shape (n,).
    format
        What it was read from: ``"tlog"``, ``"live"``, ``"dataflash"`` or ``"ulog"``. How late a
        quantity is depends on it.
    battery
        Battery instance that ``current`` and ``voltage`` are of; ``SPEED_CONTROLLERS`` where the
        current is the sum of theirs.
    other_currents
        Instance of each other battery to its current in A.
    applied
        Compass number to what the log says was applied to its readings, where it says so
        (dataflash does); empty where only parameters tell.
    raw_compasses
        Compasses whose ``field`` is the sensor's own, turned into body axes and not corrected.
    attitude_source
        Message that ``attitude`` is from; empty where there is none.
    other_attitudes
        Messages that tell the attitude too, the better ones first, to what they tell.
    esc_currents
        Output, counted from 0, to the current in A of its speed controller, where it reports one.
    forward
        1 where a vehicle that can do both flies on its wings or goes over to or from them, 0 where
        it hovers, from each time on, shape (n,); None where it does not say.
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
    battery: int = 0
    other_currents: Mapping[int, Series] = dataclasses.field(default_factory=dict)
    applied: Mapping[int, Applied] = dataclasses.field(default_factory=dict)
    raw_compasses: frozenset[int] = frozenset()
    attitude_source: str = ""
    other_attitudes: Mapping[str, Series] = dataclasses.field(default_factory=dict)
    esc_currents: Mapping[int, Series] = dataclasses.field(default_factory=dict)
    forward: Series | None = None

    @property
    def esc_current(self) -> Series | None:
        """Sum of the speed controllers' currents, at the times of the first; None without any."""
        each = list(self.esc_currents.values())
        if not each:
            return None
        at = each[0].time
        total = sum((interpolate(one, at) for one in each), np.zeros(len(at)))
        return Series(at, np.asarray(total))
