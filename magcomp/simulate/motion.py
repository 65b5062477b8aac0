"""What a programme makes the vehicle do: the same frozen table for each of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# The cross products with x, y and z as matrices.
_CROSS = np.array(
    [
        [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
        [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    ]
)


@dataclass(frozen=True, eq=False)
class Motion:
    """The true movement at n instants.

    Attributes
    ----------
    earth_from_body
        Rotation, shape (n, 3, 3).
    throttle
        Thrust demand 0 … 1, shape (n,).
    mix
        What each motor gives more than the throttle, shape (n, 4).
    armed
        Whether the pilot wants the motors armed, shape (n,).
    position, velocity, acceleration
        North-east-down from home in m, m/s and m/s², shape (n, 3).
    """

    earth_from_body: FloatArray
    throttle: FloatArray
    mix: FloatArray
    armed: BoolArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    def part(self, rows: slice) -> Motion:
        """Some of the instants."""
        return Motion(
            earth_from_body=self.earth_from_body[rows],
            throttle=self.throttle[rows],
            mix=self.mix[rows],
            armed=self.armed[rows],
            position=self.position[rows],
            velocity=self.velocity[rows],
            acceleration=self.acceleration[rows],
        )


class Program(Protocol):
    """Something that moves the vehicle."""

    @property
    def duration_s(self) -> float:
        """When it has ended, the vehicle is disarmed and still."""

    @property
    def heeds_heading(self) -> bool:
        """Whether the movement depends on the autopilot's heading."""

    def motion(self, time: FloatArray, heading_error: float) -> Motion:
        """Movement at ``time`` (seconds since the programme began, shape (n,)).

        ``heading_error`` is how far the autopilot's heading is off, radians.
        A programme that does not heed it is a function of time alone.
        """


def still(earth_from_body: FloatArray, throttle: FloatArray, armed: BoolArray) -> Motion:
    """Movement of a vehicle that is held where it is."""
    nowhere = np.zeros((len(throttle), 3))
    return Motion(
        earth_from_body=earth_from_body,
        throttle=throttle,
        mix=np.zeros((len(throttle), 4)),
        armed=armed,
        position=nowhere,
        velocity=nowhere,
        acceleration=nowhere,
    )


def rotation(axis: FloatArray, angle: FloatArray) -> FloatArray:
    """Rotation about unit vectors, shape (n, 3), by angles in radians, shape (n,): (n, 3, 3)."""
    cross = np.tensordot(axis, _CROSS, 1)
    sine, cosine = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.asarray(np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross))


def axis_angle(matrix: FloatArray) -> tuple[FloatArray, float]:
    """Unit axis and angle of one rotation matrix that is not a half turn."""
    vector = 0.5 * np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    sine = float(np.linalg.norm(vector))
    angle = float(np.arctan2(sine, 0.5 * (np.trace(matrix) - 1.0)))
    return (vector / sine, angle) if sine > 1e-9 else (np.array([0.0, 0.0, 1.0]), 0.0)


def euler(earth_from_body: FloatArray) -> FloatArray:
    """Roll, pitch and yaw of rotations, radians, shape (n, 3)."""
    roll = np.arctan2(earth_from_body[..., 2, 1], earth_from_body[..., 2, 2])
    pitch = -np.arcsin(np.clip(earth_from_body[..., 2, 0], -1.0, 1.0))
    yaw = np.arctan2(earth_from_body[..., 1, 0], earth_from_body[..., 0, 0])
    return np.stack([roll, pitch, yaw], axis=-1)


def ease(fraction: FloatArray) -> FloatArray:
    """0 … 1 at a steady pace with soft ends, as a hand turns things."""
    x = np.clip(fraction, 0.0, 1.0)
    soft = 0.1
    pace = 1.0 / (1.0 - soft)
    begin = 0.5 * pace * x * x / soft
    end = 1.0 - 0.5 * pace * (1.0 - x) ** 2 / soft
    return np.asarray(np.where(x < soft, begin, np.where(x > 1 - soft, end, pace * (x - soft / 2))))
