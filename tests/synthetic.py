"""Recordings made of formulas: every number a fit should find is put in by hand.

Unlike magcomp.simulate there is no autopilot and no physics here, only the
model the fits assume, so a fit that misses its numbers is wrong and nothing else.

What ArduPilot calls its parameters and does with them is written out here by hand
(docs/autopilots.md, ArduPilot: correction) and not taken from the code under test.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from magcomp.align import controls, readings, reported
from magcomp.earth import EarthField, expected_field
from magcomp.fit import Problem
from magcomp.geometry import body_from_earth
from magcomp.model import (
    Correction,
    ParameterChange,
    ParameterHistory,
    ReadReport,
    Recording,
    Series,
    Vehicle,
    compasses_of,
)

# ArduCopter corrects a reading, the mean over 0.1 s, with the battery read 0.1 s ago.
APPLIED_LATER_S = 0.05

FloatArray = NDArray[np.float64]

HOME = (47.3977, 8.5456, 488.0)
UNIX_S = 1.7e9

INTERFERENCE = np.array([1.4, -0.8, 1.9])
EXACT = Correction(
    offset=np.array([60.0, -35.0, 20.0]),
    soft_iron=np.array([[1.06, 0.03, -0.02], [0.03, 0.95, 0.01], [-0.02, 0.01, 1.02]]),
    motor=-INTERFERENCE,
)


def earth() -> EarthField:
    """The field at HOME."""
    return expected_field(*HOME, UNIX_S)


def waves(rng: np.random.Generator, time: FloatArray, slow: float, fast: float) -> FloatArray:
    """A smooth random function of time with a root mean square of about 1."""
    period = np.exp(rng.uniform(np.log(fast), np.log(slow), 8))
    phase = rng.uniform(0.0, 2 * np.pi, 8)
    return np.asarray(np.sin(2 * np.pi * np.multiply.outer(time, 1 / period) + phase).sum(1) / 2.0)


def stored(correction: Correction, compass: int = 1) -> dict[str, float]:
    """A correction as ArduPilot's parameters, each the float32 it keeps."""
    number = "" if compass == 1 else str(compass)
    iron = correction.soft_iron
    vectors = {
        "OFS": correction.offset,
        "DIA": np.diag(iron),
        "ODI": iron[(0, 0, 1), (1, 2, 2)],
        "MOT": correction.vector,
    }
    return {
        f"COMPASS_{kind}{number}_{axis}": float(np.float32(value))
        for kind, vector in vectors.items()
        for axis, value in zip("XYZ", vector, strict=True)
    }


def as_ardupilot(
    values: Mapping[str, float], compass: int, raw: FloatArray, amperes: FloatArray
) -> FloatArray:
    """ArduPilot's correction of a sensor field, mGauss, shape (n, 3)."""
    number = "" if compass == 1 else str(compass)

    def vector(kind: str, default: float = 0.0) -> FloatArray:
        names = (f"COMPASS_{kind}{number}_{axis}" for axis in "XYZ")
        return np.array([values.get(name, default) for name in names])

    (x, y, z), (xy, xz, yz) = vector("DIA", 1.0), vector("ODI")
    soft_iron = np.array([[x, xy, xz], [xy, y, yz], [xz, yz, z]])
    motor = vector("MOT") if values.get("COMPASS_MOTCT") in (1.0, 2.0) else np.zeros(3)
    scale = values.get(f"COMPASS_SCALE{number}", 1.0)
    return scale * (raw + vector("OFS")) @ soft_iron + np.multiply.outer(amperes, motor)


NOTHING = {
    "COMPASS_MOTCT": 0.0,
    "COMPASS_OFS_X": 5.0,
    "COMPASS_OFS_Y": -10.0,
    "COMPASS_OFS_Z": 8.0,
}
"""A vehicle nobody ever calibrated."""


@dataclass(frozen=True)
class Flown:
    """How a recording is made.

    Attributes
    ----------
    exact
        The correction that undoes everything; its motor vector per ampere.
    in_force
        Parameters the autopilot corrected with; the exact ones without motors by default.
    changed
        Parameters that took another value at a time.
    field_lag, current_lag
        Delays, seconds (magcomp.model.Lags).
    blur
        The field follows the mean of the current over so long before and after, seconds.
    applied_later
        What is in force is multiplied by the current of so much earlier, seconds.
    """

    seed: int = 1
    seconds: float = 180.0
    exact: Correction = EXACT
    in_force: Mapping[str, float] | None = None
    changed: tuple[ParameterChange, ...] = ()
    field_lag: float = 0.07
    current_lag: float = 0.05
    applied_later: float = APPLIED_LATER_S
    blur: float = 0.0
    noise: float = 1.0
    truncated: bool = False
    tilt: float = 0.15
    amperes: float = 25.0
    swing: float = 8.0
    slow_s: float = 15.0
    fast_s: float = 2.5
    current_hz: float = 10.0
    compasses: tuple[int, ...] = (1,)

    def current_at(self, time: FloatArray) -> FloatArray:
        """The true current, A."""
        rng = np.random.default_rng([self.seed, 1])
        wave = waves(rng, time, self.slow_s, self.fast_s)
        return np.maximum(self.amperes + self.swing * wave, 0.0)

    def attitude_at(self, time: FloatArray) -> FloatArray:
        """Roll, pitch, yaw, shape (n, 3)."""
        rng = np.random.default_rng([self.seed, 2])
        roll, pitch = (self.tilt * waves(rng, time, 12.0, 3.0) for _ in range(2))
        yaw = 2.0 * waves(rng, time, 40.0, 15.0) + 0.05 * time
        return np.stack([roll, pitch, yaw], axis=1)

    def sensed_at(self, time: FloatArray, compass: int = 1) -> FloatArray:
        """Raw sensor field measured at ``time``, without noise, mGauss, shape (n, 3)."""
        roll, pitch, yaw = self.attitude_at(time).T
        true = body_from_earth(roll, pitch, yaw) @ earth().ned
        measured = time + self.field_lag
        felt = measured - self.current_lag
        around = self.blur * np.linspace(-1.0, 1.0, 9) if self.blur else np.zeros(1)
        return self.raw_of(true, np.mean([self.current_at(felt + t) for t in around], axis=0))

    def raw_of(self, true: FloatArray, amperes: FloatArray) -> FloatArray:
        """Sensor field of a true body-axes field, mGauss, shape (n, 3)."""
        disturbed = true - np.multiply.outer(amperes, self.exact.vector)
        return disturbed @ np.linalg.inv(self.exact.soft_iron).T - self.exact.offset

    def parameters(self) -> dict[str, float]:
        """What was in force at the start."""
        if self.in_force is not None:
            return dict(self.in_force)
        values: dict[str, float] = {"COMPASS_MOTCT": 0.0}
        for compass in self.compasses:
            values |= stored(replace(self.exact, motor=np.zeros(3)), compass)
        return values

    def corrected(self, time: FloatArray, raw: FloatArray, compass: int) -> FloatArray:
        """What the autopilot makes of a sensor field, mGauss, shape (n, 3)."""
        now = self.current_at(time - self.current_lag - self.applied_later)
        corrected = np.empty_like(raw)
        edges = [-np.inf, *sorted({change.time for change in self.changed}), np.inf]
        for begin, end in pairwise(edges):
            rows = (time >= begin) & (time < end)
            values = self.parameters() | {c.name: c.value for c in self.changed if c.time <= begin}
            corrected[rows] = as_ardupilot(values, compass, raw[rows], now[rows])
        return corrected

    def recording(self) -> Recording:
        """What the autopilot would have reported."""
        rng = np.random.default_rng([self.seed, 3])
        time = np.arange(1.0, self.seconds, 0.1)
        grid = np.arange(0.0, self.seconds + 1.0, 0.02)
        slow = np.arange(0.0, self.seconds + 1.0, 1.0 / self.current_hz)
        start = self.parameters()
        history = ParameterHistory(
            (*(ParameterChange(0.0, n, v) for n, v in start.items()), *self.changed)
        )
        fields = {}
        for compass in self.compasses:
            raw = self.sensed_at(time - self.field_lag, compass)
            raw = raw + rng.normal(scale=self.noise, size=raw.shape)
            reported_field = self.corrected(time, raw, compass)
            if self.truncated:
                reported_field = np.trunc(reported_field)
            fields[compass] = Series(time, reported_field)
        return Recording(
            source="synthetic",
            vehicle=Vehicle("ardupilot", "copter", 1, 1, "4.6.3", compasses_of((97539,))),
            start_unix_s=UNIX_S,
            duration_s=self.seconds,
            field=fields,
            parameters=history,
            report=ReadReport(0, 0, 0),
            attitude=Series(grid, self.attitude_at(grid)),
            current=Series(slow, self.current_at(slow)),
            position=Series(np.array([0.0]), np.array([HOME])),
        )

    def problem(self, compass: int = 1) -> Problem:
        """The same, ready to be fitted against the battery current."""
        return problem_of(self.recording(), compass)


def problem_of(recording: Recording, compass: int = 1) -> Problem:
    """A compass of a recording against its first control quantity, earth field at HOME."""
    found = controls(recording)
    return Problem(readings(recording, compass), found[0], reported(found), earth())


@dataclass(frozen=True)
class Swept(Flown):
    """A vehicle that stands still while the current goes up and down in steps."""

    seconds: float = 100.0
    heading: float = 0.7

    def current_at(self, time: FloatArray) -> FloatArray:
        """Steps of six seconds, 1 to 45 A and back."""
        steps = np.array([1.0, 10.0, 20.0, 30.0, 45.0, 35.0, 25.0, 15.0, 5.0])
        return steps[np.clip(time // 6.0, 0, None).astype(int) % len(steps)]

    def attitude_at(self, time: FloatArray) -> FloatArray:
        """Standing on legs of unequal length."""
        return np.tile([0.02, -0.01, self.heading], (len(time), 1))


@dataclass(frozen=True)
class Turned(Flown):
    """The paper's rig: turned about at each of several steady currents."""

    seconds: float = 240.0
    levels: tuple[float, ...] = (0.5, 20.0, 45.0)

    def current_at(self, time: FloatArray) -> FloatArray:
        """One level after the other."""
        each = self.seconds / len(self.levels)
        index = np.clip(time // each, 0, len(self.levels) - 1).astype(int)
        return np.array(self.levels)[index]

    def attitude_at(self, time: FloatArray) -> FloatArray:
        """Slowly over most of the sphere."""
        roll = 1.3 * np.sin(2 * np.pi * time / 23.0)
        pitch = 0.9 * np.sin(2 * np.pi * time / 17.0)
        return np.stack([roll, pitch, 2 * np.pi * time / 31.0], axis=1)


def with_both(motors_follow: str, seed: int) -> Recording:
    """Current and throttle that wander apart (a battery that sags); the field follows one."""
    flown = Flown(seed=seed)
    plain = flown.recording()
    time = plain.current.time
    rng = np.random.default_rng([seed, 30])
    apart = 1.0 + 0.15 * waves(rng, time, 30.0, 6.0)
    follows = plain.current.value
    other = np.maximum(follows * apart, 0.0)
    current, percent = (follows, other) if motors_follow == "current" else (other, follows)
    return replace(
        plain, current=Series(time, current), throttle=Series(time, np.clip(percent / 60.0, 0, 1))
    )


def drifting(
    recording: Recording, seed: int, size: float = 1.5, memory_s: float = 60.0
) -> Recording:
    """The same recording of a sensor whose offsets drift: a first-order Gauss–Markov process."""
    rng = np.random.default_rng([seed, 9])
    field = recording.field[1]
    kept = np.exp(-np.diff(field.time, prepend=-np.inf) / memory_s)[:, None]
    news = rng.normal(size=field.value.shape) * size * np.sqrt(1.0 - kept**2)
    drift = np.array(list(accumulate(zip(kept, news, strict=True), _next, initial=np.zeros(3))))
    return replace(recording, field={1: Series(field.time, field.value + drift[1:])})


def _next(before: FloatArray, now: tuple[FloatArray, FloatArray]) -> FloatArray:
    kept, news = now
    return kept * before + news
