"""What PX4 makes of its compasses' readings: which calibration is in force, and what it learns.

docs/autopilots.md, PX4: in force, and PX4: learning.

- A compass has the slot that holds its device id; without one it is not corrected at all.
- Slots are looked at after a change of any parameter, once a second at most, while disarmed. The
  switch acts armed or not.
- OFF, SCALE and ODIAG are taken over only where they differ enough.
- What the estimator learned of the bias in a flight is folded into OFF when the flight ends, and
  the whole slot is saved as it is in force.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from magcomp.autopilots.px4_correction import (
    AT_START,
    MGAUSS,
    Calibration,
    Compensation,
    correct,
    offset_zone,
    stored,
    taken_over,
)
from magcomp.autopilots.px4_names import single_name, vector_names
from magcomp.autopilots.px4_rotation import sensor_to_body
from magcomp.autopilots.px4_settings import slot_of
from magcomp.simulate.moment import Moment
from magcomp.simulate.physics import BLOCK_S, STEPS
from magcomp.simulate.px4.parameters import Parameters
from magcomp.simulate.px4.sensors import DEVICE_IDS, readings
from magcomp.simulate.truth import Truth

FloatArray = NDArray[np.float64]

_LOOKS_AGAIN_S = 1.0
_EACH = 2  # steps: a compass is read at 50 Hz
_LEARNS_S = 15.0
_LEAST_FLIGHT_S = 10.0
_FOLDED = 2.5 / 3.75
"""Of what was learned, the share that goes into OFF: 34 of 51 mGauss on running firmware."""

_MOST_URGENT, _INTERNAL_URGENCY = 100.0, 50.0


class Compasses:
    """Readings, the corrections in force, and the estimator's bias.

    Parameters
    ----------
    truth
        The vehicle.
    earth
        Field in north-east-down axes, mGauss, shape (3,).
    parameters
        What the autopilot holds.
    rng
        Of the sensors' noise.

    Attributes
    ----------
    raw
        Last reading of each sensor in its own axes, gauss, shape (3, 3).
    corrected
        vehicle_magnetometer in body axes, gauss, shape (3,): of the one compass that is used.
    bias
        What the estimator takes off it, shape (3,).
    """

    def __init__(
        self, truth: Truth, earth: FloatArray, parameters: Parameters, rng: np.random.Generator
    ) -> None:
        self._truth = truth
        self._earth = earth / MGAUSS
        self._parameters = parameters
        self._rng = rng
        self.raw = np.zeros((len(DEVICE_IDS), 3))
        self.corrected = np.zeros(3)
        self.restart()

    def restart(self) -> None:
        """Begin as after a boot."""
        self._in_force = [AT_START] * len(DEVICE_IDS)
        self._turns = [np.eye(3)] * len(DEVICE_IDS)
        self._seen, self._looked_at = -1, -np.inf
        self._flown_s = 0.0
        self._ahead = np.zeros((STEPS // _EACH, len(DEVICE_IDS), 3))
        self._sum = np.zeros(3)
        self.used = 0
        self.bias = np.zeros(3)
        self._take_over()

    def in_force(self, device: int) -> Calibration:
        """What corrects a sensor."""
        return self._in_force[DEVICE_IDS.index(device)]

    def look(self, now_s: float, *, armed: bool) -> None:
        """Notice what changed among the parameters, where it is time to."""
        if self._parameters.version == self._seen or now_s < self._looked_at + _LOOKS_AGAIN_S:
            return
        self._looked_at, self._seen = now_s, self._parameters.version
        if armed:
            kind = stored(self._parameters.values, 1).compensation
            self._in_force = [replace(each, compensation=kind) for each in self._in_force]
        else:
            self._take_over()

    def sense(self, moment: Moment, power_ka: dict[Compensation, float]) -> None:
        """Read and correct at one step of the physics.

        Parameters
        ----------
        power_ka
            What COMP is multiplied by, by position of the switch.
        """
        if moment.step == 0:
            self._ahead = readings(self._truth, moment.block.field[::_EACH], self._rng)
            self._sum = np.zeros(3)
        if moment.step % _EACH == 0:
            self.raw = self._ahead[moment.step // _EACH]
            calibration = self._in_force[self.used]
            power = power_ka.get(calibration.compensation, 0.0)
            found = correct(self.raw[self.used], power, calibration)
            self._sum = self._sum + self._turns[self.used] @ found
        if moment.step == STEPS - 1:
            self.corrected = self._sum * (_EACH / STEPS)

    def learn(self, moment: Moment, *, flying: bool) -> None:
        """Let the estimator move its bias towards what it sees, once a block."""
        if flying:
            self._flown_s += BLOCK_S
            pose = moment.block.motion.earth_from_body[STEPS // 2 - 1]
            seen = self.corrected - pose.T @ self._earth
            self.bias = self.bias + (seen - self.bias) * (BLOCK_S / _LEARNS_S)

    def land(self, now_s: float) -> None:
        """Fold what a flight taught into OFF, and save the slot."""
        flown, self._flown_s = self._flown_s, 0.0
        values = self._parameters.values
        slot = slot_of(values, DEVICE_IDS[self.used])
        if flown < _LEAST_FLIGHT_S or slot is None:
            return
        calibration = self._in_force[self.used]
        learned = np.linalg.solve(calibration.soft_iron, self._turns[self.used].T @ self.bias)
        kept = replace(calibration, offset=calibration.offset + _FOLDED * learned)
        self.bias = np.zeros(3)  # the estimator begins anew with a new calibration
        self._in_force[self.used] = kept
        for kind, vector in (
            ("OFF", kept.offset),
            ("SCALE", kept.scale),
            ("ODIAG", kept.off_diagonal),
            ("COMP", kept.motor),
        ):
            for name, value in zip(vector_names(kind, slot), vector.tolist(), strict=True):
                self._parameters.set(name, value, now_s)
        for kind in ("ID", "ROT", "PRIO"):
            name = single_name(kind, slot)
            self._parameters.set(name, values[name], now_s)

    def _take_over(self) -> None:
        values = self._parameters.values
        zone = offset_zone(values)
        switch = stored(values, 1).compensation
        urgencies = []
        for index, device in enumerate(DEVICE_IDS):
            slot = slot_of(values, device)
            if slot is None:
                self._in_force[index] = replace(AT_START, compensation=switch)
                urgencies.append(_INTERNAL_URGENCY)
                continue
            before = self._in_force[index]
            self._in_force[index] = taken_over(before, stored(values, slot), zone)
            if index == self.used and not np.array_equal(
                before.offset, self._in_force[index].offset
            ):
                self.bias = np.zeros(3)
            self._turns[index] = sensor_to_body(values, slot)
            urgencies.append(values[single_name("PRIO", slot)] % (_MOST_URGENT + 1.0))
        self.used = int(np.argmax(urgencies))
        self._seen = self._parameters.version
