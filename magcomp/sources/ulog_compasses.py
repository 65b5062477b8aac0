"""The compasses of a PX4 log: which device is which, and what the log says of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from magcomp.autopilots.px4 import Px4
from magcomp.autopilots.px4_correction import MGAUSS
from magcomp.autopilots.px4_rotation import sensor_to_body
from magcomp.autopilots.px4_settings import NUMBERS, compasses, slot_of
from magcomp.model import FloatArray, ParameterHistory, Series, interpolate
from magcomp.sources.ulog_file import Topic, UlogFile

_OFTEN = 1.5
"""The corrected field is taken where it comes so much more often than the sensor's own."""

_MOST_GAUSS = 50.0
"""No compass measures as much."""

_LEAST_COMMON = 20
_ALIKE_MGAUSS = 2.5
_GAP_S = 1.5


class Field(NamedTuple):
    """The readings of one compass in body axes, mGauss, and whether they are the sensor's own."""

    field: Series
    raw: bool


@dataclass(frozen=True, eq=False)
class Compasses:
    """The compasses of a log.

    Attributes
    ----------
    log
        The topics.
    zero
        Microseconds of time zero.
    parameters
        Every parameter, of which the slots are the last.
    armed
        1 armed, 0 disarmed, where known.
    """

    log: UlogFile
    zero: int
    parameters: ParameterHistory
    armed: Series | None

    def fields(self) -> dict[int, Field]:
        """Each compass by its number.

        The sensor's own field needs nothing undone. As vehicles log it by default, though, it
        comes once a second with all its noise, and the corrected one, a mean of several readings,
        more often: it is taken where the log itself shows that it can be undone.
        """
        names = ("device_id", "x", "y", "z")
        sensors = [
            (topic, np.stack([topic.number(axis) for axis in "xyz"], axis=1))
            for topic in self.log.instances("sensor_mag", *names).values()
        ]
        parts = [f"magnetometer_ga[{axis}]" for axis in range(3)]
        used = self.log.instances("vehicle_magnetometer", *parts)
        if not sensors and not used:
            old = self.log.topic("sensor_combined", *parts)
            used = {} if old is None else {0: old}
        raw = self._by_device(sensors, raw=True)
        corrected = self._by_device(
            [(topic, topic.vector("magnetometer_ga", 3)) for topic in used.values()], raw=False
        )
        if not raw:
            return corrected
        return {
            number: corrected[number]
            if number in corrected
            and self._can_be_undone(number, own.field, corrected[number].field)
            else own
            for number, own in raw.items()
        }

    def _can_be_undone(self, number: int, own: Series, corrected: Series) -> bool:
        """Whether the parameters make of the sensor's own field what the log says they made."""
        autopilot = Px4()
        if len(corrected) < _OFTEN * len(own):
            return False
        if autopilot.changes(self.parameters, armed=self.armed):
            return False
        if number in autopilot.left_out(self.parameters):
            return False
        present = autopilot.in_force(self.parameters.latest, number)
        if present.regressor is not None and present.correction.motor.any():
            return False
        after = np.clip(np.searchsorted(corrected.time, own.time), 1, len(corrected) - 1)
        common = corrected.time[after] - corrected.time[after - 1] < _GAP_S
        common &= (own.time >= corrected.time[0]) & (own.time <= corrected.time[-1])
        if np.count_nonzero(common) < _LEAST_COMMON:
            return False
        own = Series(own.time[common], own.value[common])
        told = interpolate(corrected, own.time)
        apart = present.correction.apply(own.value, np.zeros(len(own))) - told
        middle = np.median(apart, axis=0)
        spread = 1.4826 * np.median(np.abs(apart - middle), axis=0)
        limit = np.maximum(_ALIKE_MGAUSS, 3.0 * spread / np.sqrt(len(own)))
        return bool((np.abs(middle) < limit).all())

    def _by_device(self, tables: list[tuple[Topic, FloatArray]], *, raw: bool) -> dict[int, Field]:
        """Rows of all instances by the slot of their device: which one reports may change."""
        values = self.parameters.latest
        rows: dict[int, list[tuple[FloatArray, FloatArray]]] = {}
        for topic, value in tables:
            time = topic.measured(self.zero)
            # NaN fails.
            sound = (np.abs(value) < _MOST_GAUSS).all(axis=1) & (value != 0.0).any(axis=1)
            devices = topic.number("device_id") if "device_id" in topic else np.zeros(len(time))
            sound &= np.isfinite(devices)
            for device in np.unique(devices[sound]).tolist():
                mine = sound & (devices == device)
                rows.setdefault(int(device), []).append((time[mine], value[mine]))
        numbers = _numbers(values, rows)
        found = {}
        for device, parts in rows.items():
            if device in numbers:
                turn = sensor_to_body(values, numbers[device]) if raw else np.eye(3)
                time = np.concatenate([part[0] for part in parts])
                value = MGAUSS * np.concatenate([part[1] for part in parts]) @ turn.T
                order = np.argsort(time, kind="stable")
                found[numbers[device]] = Field(Series(time[order], value[order]), raw)
        return dict(sorted(found.items()))


def _numbers(values: Mapping[str, float], devices: Mapping[int, object]) -> dict[int, int]:
    """The compass of each device; those without a slot get the numbers that are left."""
    found = {
        device: number for device in devices if (number := slot_of(values, device)) is not None
    }
    without = (device for device in devices if device not in found)
    taken = {compass.slot for compass in compasses(values)}
    left = (number for number in NUMBERS if number not in taken)
    return found | dict(zip(without, left, strict=False))
