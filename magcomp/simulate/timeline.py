"""Programmes made of segments: turns of a held vehicle, and throttle steps."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from magcomp.simulate.motion import Motion, axis_angle, ease, rotation, still

FloatArray = NDArray[np.float64]

_X, _Y, _Z = np.eye(3)


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch of time in which the vehicle turns about one body axis.

    Attributes
    ----------
    seconds
        Its length.
    throttle
        Reached by its end, 0 … 1.
    axis, angle
        Unit vector in body axes, shape (3,), and radians turned.
    armed
        Whether the motors are armed.
    """

    seconds: float
    throttle: float
    axis: FloatArray = field(default_factory=lambda: _Z)
    angle: float = 0.0
    armed: bool = True


class Timeline:
    """A held vehicle that goes through segments and is then disarmed and still.

    Parameters
    ----------
    segments
        In order.
    heading
        Radians; level and so turned it begins.
    """

    def __init__(self, segments: Sequence[Segment], heading: float = 0.0) -> None:
        lengths = [segment.seconds for segment in segments]
        self._begin = np.array([0.0, *itertools.accumulate(lengths)])
        self._seconds = np.array([*lengths, 1.0])
        self._axis = np.array([*(segment.axis for segment in segments), _Z])
        self._angle = np.array([*(segment.angle for segment in segments), 0.0])
        self._armed = np.array([*(segment.armed for segment in segments), False])
        throttle = [0.0, *(segment.throttle for segment in segments), 0.0]
        self._throttle = np.array(throttle)
        turns = rotation(self._axis, self._angle)
        poses = itertools.accumulate(
            turns[:-1], np.matmul, initial=rotation(_Z, np.asarray(heading))
        )
        self._pose = np.array(list(poses))

    @property
    def duration_s(self) -> float:
        """When the last segment ends."""
        return float(self._begin[-1])

    @property
    def heeds_heading(self) -> bool:
        """No: a function of time alone."""
        return False

    def motion(self, time: FloatArray, heading_error: float) -> Motion:  # noqa: ARG002
        """See :class:`magcomp.simulate.motion.Program`."""
        index = np.maximum(np.searchsorted(self._begin, time, side="right") - 1, 0)
        elapsed = (time - self._begin[index]) / self._seconds[index]
        turned = rotation(self._axis[index], self._angle[index] * ease(elapsed))
        ramp = np.clip((time - self._begin[index]) / np.minimum(1.5, self._seconds[index]), 0, 1)
        before, after = self._throttle[index], self._throttle[index + 1]
        armed = self._armed[index]
        return still(
            self._pose[index] @ turned,
            np.where(armed, before + (after - before) * ramp, 0.0),
            armed,
        )


def turntable(
    seed: int,
    levels: Sequence[float] = (0.0, 0.15, 0.3, 0.45, 0.6),
    *,
    tumbles: int = 6,
    turn_s: float = 14.0,
) -> Timeline:
    """At each throttle level one turn about z, y and x, then tumbles about random axes."""
    rng = np.random.default_rng([seed, 1])
    segments = [Segment(8.0, 0.0, armed=False)]
    for level in levels:
        segments.append(Segment(3.0, level))
        segments += [Segment(turn_s, level, axis, 2 * np.pi) for axis in (_Z, _Y, _X)]
        segments += _tumbles(rng, tumbles, level)
    return Timeline([*segments, Segment(3.0, 0.0)], float(rng.uniform(-np.pi, np.pi)))


def paper_turntable(levels: Sequence[float] = (0.0, 0.2, 0.3)) -> Timeline:
    """The paper's experiment: :func:`turntable` without tumbles, then a level turn per level."""
    segments = [Segment(8.0, 0.0, armed=False)]
    for level in levels:
        segments.append(Segment(3.0, level))
        segments += [Segment(18.0, level, axis, 2 * np.pi) for axis in (_Z, _Y, _X)]
        segments.append(Segment(3.0, level))
        segments.append(Segment(18.0, level, _Z, 2 * np.pi))
    return Timeline([*segments, Segment(3.0, 0.0)])


def sweep(seed: int, levels: Sequence[float] = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)) -> Timeline:
    """Still and level, throttle up and down in steps."""
    heading = float(np.random.default_rng([seed, 1]).uniform(-np.pi, np.pi))
    steps = [Segment(4.0, level) for level in [*levels, *reversed(levels)]]
    return Timeline([Segment(8.0, 0.0, armed=False), *steps, Segment(3.0, 0.0)], heading)


def parked() -> Timeline:
    """Disarmed and still: a vehicle to be written to."""
    return Timeline([Segment(1.0, 0.0, armed=False)])


def _tumbles(rng: np.random.Generator, count: int, level: float) -> list[Segment]:
    """Random turns that end where they began."""
    segments: list[Segment] = []
    pose = np.eye(3)
    for _ in range(count):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        angle = float(rng.uniform(0.6, 0.95) * np.pi)
        pose = pose @ rotation(axis, np.asarray(angle))
        segments.append(Segment(angle / np.radians(30.0), level, axis, angle))
    axis, angle = axis_angle(pose.T)
    return [*segments, Segment(angle / np.radians(30.0) + 0.5, level, axis, angle)]
