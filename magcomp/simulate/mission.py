"""An autonomous square, flown with the heading that the autopilot believes in.

docs/method.md, Figs 8 and 9: a heading that is off by e turns every acceleration
the autopilot commands by −e, so that an uncompensated compass bends the true path.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from magcomp.simulate.flight import GRAVITY, HOVER_THROTTLE, smooth, upright
from magcomp.simulate.motion import Motion

FloatArray = NDArray[np.float64]

_STEP_S = 0.01
_ARM_S = 5.0
_LIFT_S = 8.0
_CRUISE_S = 20.0
_LANDING_S = 18.0
_HEIGHT_M = 25.0
_SPEED = 7.0
_NEAR_M = 3.0
_REACTION_S = 1.2
_MOST_ACCELERATION = 3.5
_LEAN_S = 0.35
_YAW_LAG_S = 0.3
_YAW_RATE_LAG_S = 0.1
_MOST_YAW_RATE = np.radians(50.0)


class Mission:
    """Flies square after square until it is time to land. Has a memory: use it once.

    Parameters
    ----------
    side_m
        Length of the square's sides.
    duration_s
        From power-up to disarmed on the ground.
    """

    def __init__(self, side_m: float = 70.0, duration_s: float = 150.0) -> None:
        corners = np.array([[side_m, 0.0], [side_m, side_m], [0.0, side_m], [0.0, 0.0]])
        self._corners = corners
        self._duration = duration_s
        self._leg = 0
        self._position = np.zeros(2)
        self._velocity = np.zeros(2)
        self._acceleration = np.zeros(2)
        self._wanted_yaw = 0.0
        self._yaw = 0.0
        self._yaw_rate = 0.0

    @property
    def duration_s(self) -> float:
        """When the vehicle stands disarmed on the ground again."""
        return self._duration

    @property
    def heeds_heading(self) -> bool:
        """Yes: that is what a mission is for."""
        return True

    def motion(self, time: FloatArray, heading_error: float) -> Motion:
        """See :class:`magcomp.simulate.motion.Program`."""
        flown = [self._fly(now, heading_error) for now in time.tolist()]
        position, velocity, acceleration, yaw = (
            np.array(each) for each in zip(*flown, strict=True)
        )
        height = np.array([self._height(time + shift) for shift in (-0.02, 0.0, 0.02)])
        climb = (height[2] - height[0]) / 0.04
        lift = (height[2] - 2 * height[1] + height[0]) / 0.02**2
        armed = (time >= _ARM_S) & (time < self._duration - 1.0)
        acceleration = np.column_stack([acceleration, -lift])
        thrust = acceleration - [0.0, 0.0, GRAVITY]
        carried = np.minimum(
            smooth((time - _LIFT_S + 1.0) / 2.0), smooth((self._duration - 2.0 - time) / 1.5)
        )
        throttle = HOVER_THROTTLE * np.linalg.norm(thrust, axis=-1) / GRAVITY * carried
        return Motion(
            earth_from_body=upright(thrust, yaw),
            throttle=np.where(armed, np.clip(throttle, 0.0, 1.0), 0.0),
            mix=np.zeros((len(time), 4)),
            armed=armed,
            position=np.column_stack([position, -height[1]]),
            velocity=np.column_stack([velocity, -climb]),
            acceleration=acceleration,
        )

    def _height(self, time: FloatArray) -> FloatArray:
        up = smooth((time - _LIFT_S) / (_CRUISE_S - _LIFT_S - 2.0))
        down = smooth((self._duration - 4.0 - time) / (_LANDING_S - 4.0))
        return np.asarray(_HEIGHT_M * np.minimum(up, down))

    def _fly(
        self, now: float, heading_error: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """One step: horizontal position, velocity, acceleration and true yaw."""
        cruising = _CRUISE_S <= now < self._duration - _LANDING_S
        wanted = self._wanted_velocity() if cruising else np.zeros(2)
        if np.hypot(*wanted) > 1.0:
            course = float(np.arctan2(wanted[1], wanted[0]))
            off = (course - self._wanted_yaw + np.pi) % (2 * np.pi) - np.pi
            most = _MOST_YAW_RATE * _STEP_S
            self._wanted_yaw += min(max(off, -most), most)
        command = (wanted - self._velocity) / _REACTION_S
        size = float(np.hypot(*command))
        command *= min(1.0, _MOST_ACCELERATION / max(size, 1e-9))
        airborne = _LIFT_S < now < self._duration - 4.0
        turned = _turn(-heading_error) @ command if airborne else np.zeros(2)
        self._acceleration = self._acceleration + (turned - self._acceleration) * _STEP_S / _LEAN_S
        if not airborne:
            self._velocity = self._velocity * 0.9
        self._velocity = self._velocity + self._acceleration * _STEP_S
        self._position = self._position + self._velocity * _STEP_S
        if airborne:
            off = (self._wanted_yaw - heading_error - self._yaw + np.pi) % (2 * np.pi) - np.pi
            self._yaw_rate += (off / _YAW_LAG_S - self._yaw_rate) * _STEP_S / _YAW_RATE_LAG_S
            self._yaw += self._yaw_rate * _STEP_S
        return self._position, self._velocity, self._acceleration, self._yaw

    def _wanted_velocity(self) -> FloatArray:
        """Along the line to the next corner; the corner after it once this one is near."""
        ahead = self._corners[self._leg % len(self._corners)] - self._position
        distance = float(np.hypot(*ahead))
        if distance < _NEAR_M:
            self._leg += 1
            return self._wanted_velocity()
        return np.asarray(ahead / distance * min(_SPEED, 0.5 * distance))


def _turn(angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]])
