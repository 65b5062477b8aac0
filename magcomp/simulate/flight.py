"""An ordinary flight: yawing, climbs, descents and gusts, as a function of time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from magcomp.simulate.motion import Motion

FloatArray = NDArray[np.float64]

GRAVITY = 9.80665
HOVER_THROTTLE = 0.36
_DRAG = 0.25  # 1/s: deceleration in m/s² per m/s of airspeed
_GROUND_S = 8.0
_CLIMB_S = 10.0
_HEIGHT_M = 30.0
_STEP = 0.02

# Motors 1 front right, 2 rear left, 3 front left, 4 rear right (quad X).
ROLL_MIX = np.array([-1.0, 1.0, 1.0, -1.0])
PITCH_MIX = np.array([1.0, -1.0, 1.0, -1.0])
YAW_MIX = np.array([1.0, 1.0, -1.0, -1.0])


class Waves:
    """A smooth random function of time: a sum of sinusoids.

    Parameters
    ----------
    rng
        Source of phases and frequencies.
    amplitude
        Root mean square of the sum.
    slowest_s, fastest_s
        Range of periods.
    count
        How many sinusoids.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        amplitude: float,
        slowest_s: float,
        fastest_s: float,
        count: int = 6,
    ) -> None:
        period = np.exp(rng.uniform(np.log(fastest_s), np.log(slowest_s), count))
        self._rate = 2 * np.pi / period
        self._phase = rng.uniform(0, 2 * np.pi, count)
        # Slow waves carry more: equal shares of velocity would fling the vehicle about.
        weight = period * rng.uniform(0.5, 1.0, count)
        self._amplitude = amplitude * weight / np.sqrt(0.5 * np.sum(weight**2))

    def __call__(self, time: FloatArray) -> FloatArray:
        """Value at ``time``, same shape."""
        angle = np.multiply.outer(time, self._rate) + self._phase
        return np.asarray(np.sin(angle) @ self._amplitude)


class Flight:
    """Take off, fly about with the nose turning, land.

    Parameters
    ----------
    seed
        Same seed, same flight.
    duration_s
        From power-up to disarmed on the ground.
    vigour
        How hard the motors work against each other, for brisk turns and tilts; 1 is an ordinary
        flight.
    """

    def __init__(self, seed: int, duration_s: float = 240.0, *, vigour: float = 1.0) -> None:
        rng = np.random.default_rng([seed, 2])
        self._duration = duration_s
        self._north = Waves(rng, 22.0, 60.0, 12.0)
        self._east = Waves(rng, 22.0, 60.0, 12.0)
        self._height = Waves(rng, 4.5, 20.0, 4.5)
        self._yaw = Waves(rng, 2.4, 45.0, 14.0)
        self._yaw_start = rng.uniform(-np.pi, np.pi)
        self._wind = [Waves(rng, 2.0, 30.0, 1.5) for _ in range(2)]
        self._steady_wind = rng.uniform(-3.0, 3.0, 2)
        self._jitter = [Waves(rng, 0.015, 1.5, 0.2, count=10) for _ in range(4)]
        self._vigour = vigour
        self._trim = rng.normal(scale=0.01, size=3)

    @property
    def duration_s(self) -> float:
        """When the vehicle stands disarmed on the ground again."""
        return self._duration

    @property
    def heeds_heading(self) -> bool:
        """No: a function of time alone."""
        return False

    def motion(self, time: FloatArray, heading_error: float) -> Motion:  # noqa: ARG002
        """See :class:`magcomp.simulate.motion.Program`."""
        before, now, after = (self._position(time + shift) for shift in (-_STEP, 0.0, _STEP))
        velocity = (after - before) / (2 * _STEP)
        acceleration = (after - 2 * now + before) / _STEP**2
        flying = self._flying(time)
        wind = np.stack([wave(time) for wave in self._wind], axis=-1) + self._steady_wind
        air = velocity.copy()
        air[:, :2] -= wind * flying[:, None]
        thrust = acceleration + _DRAG * air * flying[:, None] - [0.0, 0.0, GRAVITY]
        yaw = self._heading(time)
        pose = upright(thrust, yaw)
        armed = (time >= _GROUND_S - 3.0) & (time < self._duration - 1.0)
        lift = np.linalg.norm(thrust, axis=-1) / GRAVITY
        throttle = HOVER_THROTTLE * lift * self._lifted(time)
        throttle = throttle + self._jitter[3](time) * flying
        mix = self._mix(time, pose, air) * flying[:, None]
        return Motion(
            earth_from_body=pose,
            throttle=np.where(armed, np.clip(throttle, 0.0, 1.0), 0.0),
            mix=mix,
            armed=armed,
            position=now,
            velocity=velocity,
            acceleration=acceleration,
        )

    def _flying(self, time: FloatArray) -> FloatArray:
        """0 on the ground, 1 once the climb is over, 0 again before the landing."""
        up = smooth((time - _GROUND_S - 2.0) / _CLIMB_S)
        down = smooth((self._duration - 6.0 - time) / (1.5 * _CLIMB_S))
        return np.minimum(up, down)

    def _lifted(self, time: FloatArray) -> FloatArray:
        """How much of the weight the motors carry."""
        up = smooth((time - _GROUND_S) / 2.0)
        down = smooth((self._duration - 3.0 - time) / 1.5)
        return np.minimum(up, down)

    def _position(self, time: FloatArray) -> FloatArray:
        flying = self._flying(time)
        height = flying * (_HEIGHT_M + self._height(time))
        return np.stack([flying * self._north(time), flying * self._east(time), -height], axis=-1)

    def _heading(self, time: FloatArray) -> FloatArray:
        return np.asarray(self._yaw_start + self._flying(time) * self._yaw(time))

    def _mix(self, time: FloatArray, pose: FloatArray, air: FloatArray) -> FloatArray:
        """What keeps the attitude: trim, the pitching moment of the airspeed, yaw torque."""
        roll, pitch, yaw = (self._vigour * wave(time) for wave in self._jitter[:3])
        forward = np.einsum("ni,ni->n", pose[:, :, 0], air)
        sideways = np.einsum("ni,ni->n", pose[:, :, 1], air)
        headings = [self._heading(time + shift) for shift in (-_STEP, 0.0, _STEP)]
        twist = (headings[2] - 2 * headings[1] + headings[0]) / _STEP**2
        return np.asarray(
            np.multiply.outer(roll + self._trim[0] + 0.004 * sideways, ROLL_MIX)
            + np.multiply.outer(pitch + self._trim[1] + 0.004 * forward, PITCH_MIX)
            + np.multiply.outer(yaw + self._trim[2] + 0.03 * twist, YAW_MIX)
        )


def smooth(fraction: FloatArray) -> FloatArray:
    """0 … 1 without a jolt: the first two derivatives vanish at both ends."""
    x = np.clip(fraction, 0.0, 1.0)
    return np.asarray(x * x * x * (x * (6.0 * x - 15.0) + 10.0))


def upright(thrust: FloatArray, yaw: FloatArray) -> FloatArray:
    """Attitude whose motors push along ``thrust`` (north-east-down) at a heading: (n, 3, 3)."""
    down = -thrust / np.linalg.norm(thrust, axis=-1, keepdims=True)
    across = np.stack([-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)], axis=-1)
    forward = np.cross(across, down)
    forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
    right = np.cross(down, forward)
    return np.stack([forward, right, down], axis=-1)
