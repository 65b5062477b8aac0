"""Recordings of multirotors whose motors each disturb in their own way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from synthetic import FloatArray, Flown, earth, waves

from magcomp.geometry import body_from_earth
from magcomp.model import ParameterChange, ParameterHistory, Recording, Series

VECTORS = np.array([[3.1, -2.0, 0.6], [-1.2, 1.4, 2.0], [2.2, 0.3, 1.1], [-0.8, -2.4, 2.9]])
"""What each motor adds, mGauss/A."""

_FULL_A = 40.0


@dataclass(frozen=True)
class Unequal(Flown):
    """A flight in which every motor draws its own current and adds its own field.

    Attributes
    ----------
    vectors
        mGauss per A of each motor's current, shape (k, 3).
    apart
        How differently the motors draw: the spread of their shares.
    exponent
        A motor draws full · (duty · volts / 25) to this power.
    bend
        What the square of the total adds, mGauss per A and per 50 A, along x.
    per_motor
        COMPASS_PMOT in force at the start.
    """

    seconds: float = 120.0
    vectors: FloatArray = field(default_factory=lambda: VECTORS)
    apart: float = 0.35
    exponent: float = 2.0
    bend: float = 0.0
    per_motor: Mapping[str, float] = field(default_factory=dict)

    def drawn_at(self, time: FloatArray) -> FloatArray:
        """Current of each motor, A, shape (n, k)."""
        count = len(self.vectors)
        rng = np.random.default_rng([self.seed, 4])
        shares = 1.0 + self.apart * np.column_stack(
            [waves(rng, time, 6.0, 1.5) for _ in range(count)]
        )
        shares = np.clip(shares, 0.2, None)
        shares /= shares.sum(axis=1, keepdims=True)
        return np.asarray(self.current_at(time)[:, None] * shares)

    def volts_at(self, time: FloatArray) -> FloatArray:
        """Battery voltage, shape (n,)."""
        return np.asarray(25.0 - 0.01 * time)

    def duty_at(self, time: FloatArray) -> FloatArray:
        """Duty of each motor, shape (n, k)."""
        return np.asarray(
            25.0
            / self.volts_at(time)[:, None]
            * (self.drawn_at(time) / _FULL_A) ** (1 / self.exponent)
        )

    def added_at(self, time: FloatArray) -> FloatArray:
        """What the motors add, mGauss, shape (n, 3)."""
        total = self.current_at(time)
        bent = np.multiply.outer(total**2 / 50.0, [self.bend, 0.0, 0.0])
        return np.asarray(self.drawn_at(time) @ self.vectors + bent)

    def sensed_at(self, time: FloatArray, compass: int = 1) -> FloatArray:
        """Raw sensor field, mGauss, shape (n, 3)."""
        roll, pitch, yaw = self.attitude_at(time).T
        true = body_from_earth(roll, pitch, yaw) @ earth().ned
        disturbed = true + self.added_at(time + self.field_lag - self.current_lag)
        return disturbed @ np.linalg.inv(self.exact.soft_iron).T - self.exact.offset

    def recording(self) -> Recording:
        """With servo outputs and the battery's voltage."""
        plain = super().recording()
        often = np.arange(0.0, self.seconds + 1.0, 0.1)
        outputs = np.zeros((len(often), 16))
        count = len(self.vectors)
        outputs[:, :count] = 1000.0 + 1000.0 * self.duty_at(often)
        functions = {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, count + 1)}
        told = {**functions, "MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0, **self.per_motor}
        changes = tuple(ParameterChange(0.0, name, value) for name, value in told.items())
        made = replace(
            plain,
            outputs=Series(often, outputs),
            voltage=Series(often, self.volts_at(often)),
            parameters=ParameterHistory((*plain.parameters.changes, *changes)),
        )
        return self._corrected(made) if self.per_motor.get("COMPASS_PMOT_EN") else made

    def _corrected(self, made: Recording) -> Recording:
        """What the firmware adds motor by motor to compass 1."""
        reported = made.field[1]
        then = reported.time - self.current_lag - 0.05
        drive = self.duty_at(then) * self.volts_at(then)[:, None]
        vectors = np.array(
            [[self.per_motor[f"COMPASS_PMOT{m}_{axis}"] for axis in "XYZ"] for m in (1, 2, 3, 4)]
        )
        added = drive ** self.per_motor["COMPASS_PMOT_EXP"] @ vectors
        return replace(made, field={1: Series(reported.time, reported.value + added)})
