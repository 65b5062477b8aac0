"""The compasses of PX4's telemetry: whole mGauss of the sensors' own, in their own axes.

SCALED_IMU, SCALED_IMU2 and SCALED_IMU3 are the sensors in the order in which the firmware found
them. No message says which calibration slot is which sensor's.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np

from magcomp.autopilots.px4_correction import MGAUSS, after_start
from magcomp.autopilots.px4_rotation import sensor_to_body
from magcomp.autopilots.px4_settings import compasses
from magcomp.model import FloatArray, Series

_CLEARLY = 2.0
"""Another order than that of the slots must make the field this many times steadier."""

_LEAST_READINGS = 50


def by_slot(told: Mapping[int, Series], values: Mapping[str, float]) -> dict[int, Series]:
    """The field of each compass in body axes, mGauss, by its number.

    Parameters
    ----------
    told
        What the first, second and third message hold, in the sensor's axes.
    values
        Parameters by name. The messages are taken for the slots in their order, unless the
        calibrations fit the readings clearly better in another.
    """
    sensors = [each for _, each in sorted(told.items())]
    slots = [compass.slot for compass in compasses(values)]
    found = {}
    for number, series in zip(_order(sensors, slots, values), sensors, strict=False):
        turn = sensor_to_body(values, number)
        whole = np.array_equal(turn, np.rint(turn))
        value = series.value if whole else _uncut(series.value)
        found[number] = Series(series.time, value @ turn.T)
    return dict(sorted(found.items()))


def _uncut(value: FloatArray) -> FloatArray:
    """Undo the mean of the cut towards zero, which cannot be seen any more behind a turn."""
    return np.asarray(value + 0.5 * np.sign(value))


def _order(sensors: list[Series], slots: list[int], values: Mapping[str, float]) -> tuple[int, ...]:
    """The compass of each message."""
    count = min(len(sensors), len(slots))
    first = tuple(slots[:count])
    if count < 2 or any(len(sensor) < _LEAST_READINGS for sensor in sensors[:count]):
        return first
    unsteady = {
        (message, slot): _unsteadiness(sensors[message].value, slot, values)
        for message in range(count)
        for slot in slots
    }
    orders = {
        order: sum(unsteady[message, slot] for message, slot in enumerate(order))
        for order in itertools.permutations(slots, count)
    }
    best = min(orders, key=lambda order: orders[order])
    return best if orders[best] * _CLEARLY < orders[first] else first


def _unsteadiness(value: FloatArray, slot: int, values: Mapping[str, float]) -> float:
    """How much the strength varies behind a slot's calibration, as a share of it."""
    calibration = after_start(values, slot)
    corrected = (value / MGAUSS - calibration.offset) @ calibration.soft_iron.T
    strength = np.linalg.norm(corrected, axis=1)
    middle = float(np.median(strength))
    return float(np.median(np.abs(strength - middle))) / max(middle, 1e-3)
