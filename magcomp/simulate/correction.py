"""The autopilot's correction of its three compasses, with the parameters in force now."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from magcomp.autopilots import ardupilot
from magcomp.autopilots.ardupilot import MotorCompensation
from magcomp.simulate.parameters import DEVICE_IDS, ParameterStore
from magcomp.simulate.truth import MOTORS

FloatArray = NDArray[np.float64]

_STEEPEST = 2.0


class Correction:
    """Corrects readings; reads the parameters again whenever one of them has changed.

    Parameters
    ----------
    store
        The autopilot's parameters.
    """

    def __init__(self, store: ParameterStore) -> None:
        self._store = store
        self._version = -1
        self._calibrations: list[ardupilot.Calibration] = []
        self._sensors: list[int] = []

    def correct(
        self, raw: FloatArray, throttle: float, current: float, per_motor: FloatArray | None
    ) -> FloatArray:
        """Corrected fields in priority order, mGauss, shape (3, 3).

        Parameters
        ----------
        raw
            Sensor fields, one row a physical sensor, shape (3, 3).
        throttle, current
            Thrust demand 0 … 1 and battery current in A.
        per_motor
            Duty of each motor times the battery's voltage, V, shape (4,); None where
            COMPASS_PMOT_EN is off.
        """
        if self._version != self._store.version:
            self._read()
        u = {
            MotorCompensation.OFF: 0.0,
            MotorCompensation.THROTTLE: throttle,
            MotorCompensation.CURRENT: current,
        }
        fields = [
            ardupilot.correct(raw[sensor], u[calibration.compensation], calibration)
            for sensor, calibration in zip(self._sensors, self._calibrations, strict=True)
        ]
        if per_motor is not None:
            fields[0] = self._per_motor(raw[self._sensors[0]], per_motor)
        return np.stack(fields)

    def _read(self) -> None:
        values = self._store.values
        self._calibrations = [ardupilot.calibration(values, n) for n in (1, 2, 3)]
        self._sensors = [
            DEVICE_IDS.index(int(values[f"COMPASS_DEV_ID{ardupilot.suffix(n)}"])) for n in (1, 2, 3)
        ]
        self._version = self._store.version

    def _per_motor(self, raw: FloatArray, drive: FloatArray) -> FloatArray:
        """COMPASS_PMOT_*: each motor has a vector of its own, and COMPASS_MOT is not used."""
        off = {**self._store.values, "COMPASS_MOTCT": 0.0}
        vectors = motor_vectors(self._store.values)
        exponent = min(max(self._store["COMPASS_PMOT_EXP"], 0.0), _STEEPEST)
        plain = ardupilot.correct(raw, 0.0, ardupilot.calibration(off, 1))
        return np.asarray(plain + np.maximum(drive, 0.0) ** exponent @ vectors)


def motor_vectors(values: Mapping[str, float]) -> FloatArray:
    """COMPASS_PMOT1_X … COMPASS_PMOT4_Z, shape (4, 3)."""
    return np.array(
        [[values[f"COMPASS_PMOT{m}_{axis}"] for axis in "XYZ"] for m in range(1, MOTORS + 1)]
    )
