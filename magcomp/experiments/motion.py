"""True attitude at any moment, and how far headings are from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from magcomp.geometry import wrap_angle
from magcomp.model import FloatArray
from magcomp.sources.truth import Truth

LEAST_UPRIGHT = np.cos(np.radians(60.0))
"""Headings are compared while the vehicle leans less than 60°: beyond, they mean little."""


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """The vehicle's true attitude at some moments.

    Attributes
    ----------
    earth_from_body
        Rotations, shape (n, 3, 3).
    roll, pitch, yaw
        Radians, shape (n,).
    """

    earth_from_body: FloatArray
    roll: FloatArray
    pitch: FloatArray
    yaw: FloatArray

    @property
    def upright(self) -> FloatArray:
        """Cosine of the tilt, shape (n,)."""
        return np.asarray(self.earth_from_body[:, 2, 2])


def true_motion(truth: Truth, time: FloatArray) -> TrueMotion:
    """True attitude at given moments, by turning along the shortest way between those known.

    Parameters
    ----------
    truth
        Of a simulated vehicle.
    time
        Seconds on the recording's time axis, shape (n,). Beyond the ends of the truth the
        nearest end holds.
    """
    known, rows = np.unique(truth.attitude.time, return_index=True)
    poses = Rotation.from_euler("ZYX", truth.attitude.value[rows][:, ::-1])
    pose = Slerp(known, poses)(np.clip(time, known[0], known[-1]))
    matrix = np.asarray(pose.as_matrix())
    return TrueMotion(
        earth_from_body=matrix,
        roll=np.arctan2(matrix[:, 2, 1], matrix[:, 2, 2]),
        pitch=-np.arcsin(np.clip(matrix[:, 2, 0], -1.0, 1.0)),
        yaw=np.arctan2(matrix[:, 1, 0], matrix[:, 0, 0]),
    )


@dataclass(frozen=True)
class HeadingAccuracy:
    """How far a heading was from the truth, degrees.

    Attributes
    ----------
    largest
        Largest absolute error.
    rms
        Root mean square error.
    """

    largest: float
    rms: float


def heading_errors(
    truth: Truth, time: FloatArray, heading: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Errors of headings against the truth, where both exist and the vehicle is upright.

    Parameters
    ----------
    truth
        Of a simulated vehicle.
    time
        When each heading was true, seconds, shape (n,).
    heading
        Radians, shape (n,).

    Returns
    -------
    time
        Seconds, shape (k,).
    error
        Radians in [−π, π), shape (k,).
    """
    inside = (time >= truth.attitude.time[0]) & (time <= truth.attitude.time[-1])
    inside &= np.isfinite(heading)
    time, heading = time[inside], heading[inside]
    motion = true_motion(truth, time)
    upright = motion.upright > LEAST_UPRIGHT
    return time[upright], wrap_angle(heading - motion.yaw)[upright]


def accuracy(truth: Truth, time: FloatArray, heading: FloatArray) -> HeadingAccuracy | None:
    """Accuracy of headings; None where none can be compared. See :func:`heading_errors`."""
    _, error = heading_errors(truth, time, heading)
    if not len(error):
        return None
    return HeadingAccuracy(
        largest=float(np.degrees(np.abs(error).max())),
        rms=float(np.degrees(np.sqrt(np.mean(error**2)))),
    )
