"""One mission without and with motor compensation: docs/method.md, Figs 8 and 9."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magcomp.analysis import Options, analyse
from magcomp.compensate import track
from magcomp.errors import MissingDataError
from magcomp.experiments.motion import heading_errors
from magcomp.geometry import apart
from magcomp.model import FloatArray, Recording
from magcomp.sources.truth import Truth

_METRES_PER_DEGREE = 111_320.0
_AIRBORNE_M = 2.0


@dataclass(frozen=True, eq=False)
class Course:
    """A heading's error through a flight.

    Attributes
    ----------
    time
        Seconds, shape (n,).
    error_deg
        Against the true yaw, degrees, shape (n,).
    """

    time: FloatArray
    error_deg: FloatArray

    @property
    def largest_deg(self) -> float:
        """Largest absolute error."""
        return float(np.abs(self.error_deg).max())

    @property
    def rms_deg(self) -> float:
        """Root mean square error."""
        return float(np.sqrt(np.mean(self.error_deg**2)))


@dataclass(frozen=True, eq=False)
class Flight:
    """One flight of the mission.

    Attributes
    ----------
    source
        Where it comes from.
    path
        True position east and north of the start, m, shape (n, 2).
    believed
        Error of the autopilot's own heading (ATTITUDE) while airborne.
    """

    source: str
    path: FloatArray
    believed: Course


@dataclass(frozen=True, eq=False)
class Flights:
    """The same mission flown twice.

    Attributes
    ----------
    uncompensated, compensated
        Classic correction only, and with the motor compensation too.
    fused
        Error of the heading that :mod:`magcomp.compensate` makes of the *uncompensated* flight's
        own log: fitted, corrected and fused with the gyro.
    apart_m
        Largest distance of the uncompensated path from the compensated one.
    """

    uncompensated: Flight
    compensated: Flight
    fused: Course
    apart_m: float


def flights(
    uncompensated: tuple[Recording, Truth], compensated: tuple[Recording, Truth]
) -> Flights:
    """Compare two flights of one mission.

    Parameters
    ----------
    uncompensated, compensated
        Recording and truth of each.

    Raises
    ------
    MissingDataError
        Where a recording is not of a flight.
    """
    first, second = flight(*uncompensated), flight(*compensated)
    return Flights(first, second, _fused(*uncompensated), apart(first.path, second.path))


def flight(recording: Recording, truth: Truth) -> Flight:
    """Path and heading error of one flight.

    Raises
    ------
    MissingDataError
        Without attitude or position, or where the vehicle never left the ground.
    """
    if recording.attitude is None:
        raise MissingDataError(f"{recording.source} must hold the attitude; instead it holds none")
    start, end = _airborne(recording)
    attitude = recording.attitude
    rows = (attitude.time >= start) & (attitude.time <= end)
    believed = _course(truth, attitude.time[rows], attitude.value[rows, 2])
    flown = (truth.position.time >= start) & (truth.position.time <= end)
    degrees = truth.position.value - truth.position.value[0]
    east = degrees[:, 1] * np.cos(np.radians(truth.position.value[0, 0]))
    path = _METRES_PER_DEGREE * np.column_stack([east, degrees[:, 0]])
    return Flight(recording.source, path[flown], believed)


def _fused(recording: Recording, truth: Truth) -> Course:
    result = analyse(recording, Options(compass=1)).compasses[0]
    made = track(recording, 1, result.fit.correction, result.fit.regressor)
    if made.fused is None:
        raise MissingDataError(f"{recording.source} must hold a gyro; instead it holds none")
    start, end = _airborne(recording)
    rows = (made.fused.time >= start) & (made.fused.time <= end)
    return _course(truth, made.fused.time[rows], made.fused.value[rows])


def _course(truth: Truth, time: FloatArray, heading: FloatArray) -> Course:
    time, error = heading_errors(truth, time, heading)
    return Course(time, np.degrees(error))


def _airborne(recording: Recording) -> tuple[float, float]:
    """From take-off to touch-down, seconds."""
    if recording.position is None:
        raise MissingDataError(f"{recording.source} must hold the position; instead it holds none")
    height = recording.position.value[:, 2] - recording.position.value[0, 2]
    time = recording.position.time[height > _AIRBORNE_M]
    if not len(time):
        raise MissingDataError(
            f"{recording.source} must hold a flight; instead the vehicle never rose above "
            f"{_AIRBORNE_M:.0f} m"
        )
    return float(time[0]), float(time[-1])
