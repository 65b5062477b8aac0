"""Compass and gyro fused to a final heading, by imufusion.

The gyro carries the heading from instant to instant, the corrected compass
pulls it slowly back. A compass reading is old when it arrives (docs/autopilots.md,
ArduPilot: timing), so it is compared with the heading of the moment it was measured; at
60°/s the difference is several degrees.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import imufusion
import numpy as np

from magcomp.compensate.compensator import Compensator
from magcomp.model import FloatArray

_TURN = 2 * math.pi
_LEAST_COS_PITCH = 0.25
"""With the nose straight up or down there is no heading to compare with."""


@dataclass(frozen=True)
class Tuning:
    """How compass, gyro and gravity share the work.

    Attributes
    ----------
    gain
        How fast the compass pulls the heading, 1/s: its noise is averaged over 1/gain seconds.
    bias_gain
        How fast the gyro's bias is learned, 1/s². gain² / 16 is slow enough not to ring.
    most_bias
        A learned bias never exceeds this, rad/s.
    hold_s
        A compass reading pulls for this long at most when no other follows.
    gap_s
        After a longer silence of the gyro everything begins anew.
    coast_s
        After a longer silence of the compass the gyro's drift is worth more than its memory, and
        the next reading is where the heading begins anew.
    memory_s
        How old a compass reading may be.
    """

    gain: float = 0.5
    bias_gain: float = 0.5**2 / 16
    most_bias: float = math.radians(3.0)
    hold_s: float = 1.5
    gap_s: float = 2.0
    coast_s: float = 60.0
    memory_s: float = 1.0


@dataclass(frozen=True, slots=True)
class Motion:
    """What the inertial sensors say at one instant.

    Attributes
    ----------
    time
        Seconds.
    gyro
        Body rates, rad/s, three numbers.
    down
        Direction of gravity in body axes, any length: from the autopilot's attitude, or the
        negated accelerometer where there is no attitude.
    """

    time: float
    gyro: Sequence[float]
    down: Sequence[float]


@dataclass(frozen=True, slots=True)
class Reading:
    """One compass reading.

    Attributes
    ----------
    time
        When it was measured, seconds: its arrival less the lag of the field.
    field
        What the :class:`Compensator` expects, mGauss, three numbers.
    u
        Control quantity then.
    roll, pitch
        Radians, then.
    """

    time: float
    field: Sequence[float]
    u: float
    roll: float
    pitch: float


@dataclass(frozen=True, slots=True)
class Heading:
    """The answer at one instant.

    Attributes
    ----------
    time
        Seconds.
    corrected
        Heading of the last reading, radians; NaN before the first.
    fused
        Heading now, radians in [−π, π); NaN before the first reading.
    """

    time: float
    corrected: float
    fused: float


class Fusion:
    """Heading from gyro, gravity and compass headings, in the order they arrive.

    Parameters
    ----------
    tuning
        How compass, gyro and gravity share the work.
    """

    def __init__(self, tuning: Tuning | None = None) -> None:
        self.tuning = Tuning() if tuning is None else tuning
        settings = imufusion.AhrsSettings()
        settings.convention = imufusion.CONVENTION_NED
        settings.gain = self.tuning.gain
        self._ahrs = imufusion.Ahrs()
        self._ahrs.set_settings(settings)
        self._bias = np.zeros(3)
        self._history: deque[tuple[float, float]] = deque()
        self._before: tuple[float, FloatArray] | None = None
        self._heading = math.nan
        self._innovation = 0.0
        self._measured_at = -math.inf
        self._first: tuple[float, float] | None = None
        self._waiting: tuple[float, float] | None = None

    @property
    def heading(self) -> float:
        """Heading now, radians in [−π, π); NaN before the first compass heading."""
        return self._heading

    @property
    def bias(self) -> tuple[float, float, float]:
        """The gyro's bias as learned so far, rad/s."""
        x, y, z = self._bias.tolist()
        return x, y, z

    def compass(self, time: float, heading: float) -> None:
        """Take a compass heading.

        Parameters
        ----------
        time
            When it was measured, seconds.
        heading
            Radians. One that is not finite, or older than the memory, is left out.
        """
        if not math.isfinite(heading):
            return
        if math.isnan(self._heading):
            self._first = (time, heading)
            return
        self._waiting = (time, heading)
        self._compare()

    def motion(self, time: float, gyro: Sequence[float], down: Sequence[float]) -> float:
        """Advance to an inertial sample.

        Parameters
        ----------
        time, gyro, down
            See :class:`Motion`. Left out is a sample that is not finite, or is a little older than
            the last.

        Returns
        -------
        float
            :attr:`heading`.
        """
        rate, gravity = np.asarray(gyro, float), np.asarray(down, float)
        size = math.sqrt(float(gravity @ gravity))
        if not (math.isfinite(size) and size > 0.0 and np.isfinite(rate).all()):
            return self._heading
        gravity = gravity / size
        before, self._before = self._before, (time, rate)
        step = math.inf if before is None else time - before[0]
        if -self.tuning.gap_s < step <= 0.0:
            self._before = before
            return self._heading
        # A clock that went far back is an autopilot that has started anew.
        if abs(step) > self.tuning.gap_s or self._has_drifted(time):
            self._forget()
        if math.isnan(self._heading):
            self._begin(time, rate, gravity)
            return self._heading
        if before is not None:
            # The mean of both ends: a 10 Hz gyro misses half a step of every turn otherwise.
            self._advance(time, step, 0.5 * (rate + before[1]) - self._bias, gravity)
        return self._heading

    def _has_drifted(self, time: float) -> bool:
        return math.isfinite(self._measured_at) and time - self._measured_at > self.tuning.coast_s

    def _forget(self) -> None:
        """After a gap nobody knows how far the vehicle has turned."""
        self._heading = math.nan
        self._first = None
        self._waiting = None
        self._history.clear()
        self._measured_at = -math.inf

    def _begin(self, time: float, rate: FloatArray, down: FloatArray) -> None:
        """Start from the first reading, turned on by what the gyro says until now."""
        if self._first is None or time - self._first[0] > self.tuning.memory_s:
            return
        roll, pitch = math.atan2(down[1], down[2]), math.asin(max(-1.0, min(1.0, -down[0])))
        level_rate = float(rate[1] * math.sin(roll) + rate[2] * math.cos(roll))
        turned = level_rate / max(math.cos(pitch), _LEAST_COS_PITCH) * (time - self._first[0])
        self._heading = _wrap(self._first[1] + turned)
        self._ahrs.restart()
        self._ahrs.skip_startup()
        self._ahrs.set_quaternion(_quaternion(roll, pitch, self._heading))
        self._first = None
        self._measured_at = time
        self._innovation = 0.0
        self._history.append((time, self._heading))

    def _advance(self, time: float, step: float, rate: FloatArray, down: FloatArray) -> None:
        self._ahrs.set_sample_period(step)
        degrees = np.degrees(rate)
        if time - self._measured_at <= self.tuning.hold_s:
            north, east, believed_down = _earth_axes(self._ahrs.get_quaternion())
            # The horizontal field as it would be seen if the heading were off by the innovation.
            field = math.cos(self._innovation) * north - math.sin(self._innovation) * east
            self._ahrs.update(degrees, -down, field)
            self._learn_bias(step, self._innovation * believed_down + np.cross(down, believed_down))
        else:
            self._ahrs.update_no_magnetometer(degrees, -down)
        north, east, _ = _earth_axes(self._ahrs.get_quaternion())
        self._heading = math.atan2(east[0], north[0])
        self._history.append((time, self._heading))
        while time - self._history[0][0] > self.tuning.memory_s:
            self._history.popleft()
        self._compare()

    def _compare(self) -> None:
        """Set the innovation once the gyro has reached the moment of the waiting reading."""
        if self._waiting is None or self._waiting[0] > self._history[-1][0]:
            return
        time, heading = self._waiting
        self._waiting = None
        then = self._heading_at(time)
        if then is not None:
            self._innovation = _wrap(heading - then)
            self._measured_at = time

    def _learn_bias(self, step: float, error: FloatArray) -> None:
        """Integrate the attitude's error, a small rotation in body axes, into the gyro's bias."""
        learned = self._bias - self.tuning.bias_gain * step * error
        self._bias = np.clip(learned, -self.tuning.most_bias, self.tuning.most_bias)

    def _heading_at(self, time: float) -> float | None:
        """The fused heading of a moment ago; None where it is not known."""
        if time < self._history[0][0]:
            return None
        later = self._history[-1]
        for earlier in reversed(self._history):
            if earlier[0] <= time:
                width = later[0] - earlier[0]
                share = min((time - earlier[0]) / width, 1.0) if width > 0.0 else 0.0
                return earlier[1] + share * _wrap(later[1] - earlier[1])
            later = earlier
        return None


def fuse(
    events: Iterable[Motion | Reading], compensator: Compensator, fusion: Fusion
) -> Iterator[Heading]:
    """Headings from a stream of sensor events, a log's or a live vehicle's.

    Parameters
    ----------
    events
        In the order they arrive.
    compensator
        Corrects the readings.
    fusion
        Freshly made.

    Yields
    ------
    Heading
        One for each :class:`Motion`.
    """
    corrected = math.nan
    for event in events:
        if isinstance(event, Reading):
            corrected = compensator.correct(event.field, event.u, event.roll, event.pitch)
            if abs(math.cos(event.pitch)) > _LEAST_COS_PITCH:
                fusion.compass(event.time, corrected)
        else:
            fused = fusion.motion(event.time, event.gyro, event.down)
            yield Heading(event.time, corrected, fused)


def _wrap(angle: float) -> float:
    return (angle + math.pi) % _TURN - math.pi


def _quaternion(roll: float, pitch: float, yaw: float) -> FloatArray:
    """Body to earth, w x y z."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def _earth_axes(quaternion: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """North, east and down in body axes: the rows of the rotation from body to earth."""
    w, x, y, z = quaternion.tolist()
    return (
        np.array([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]),
        np.array([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]),
        np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]),
    )
