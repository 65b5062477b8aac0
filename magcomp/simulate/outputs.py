"""From thrust demand to pulse widths: ArduPilot's thrust curve."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from magcomp.autopilots.terms import ThrustCurve

FloatArray = NDArray[np.float64]

_LONGEST_US = 2500.0
_STRAIGHT = 1e-6
_LEAST_RATIO = 0.1


def motor_outputs(
    thrust: FloatArray,
    *,
    armed: bool,
    voltage: float,
    altitude_m: float,
    parameters: Mapping[str, float],
) -> FloatArray:
    """Servo outputs in microseconds, same shape as ``thrust``.

    Parameters
    ----------
    thrust
        Demand, 0 … 1.
    armed
        Disarmed motors get MOT_PWM_MIN; armed ones without demand MOT_SPIN_ARM.
    voltage
        At the battery, V; scales the outputs where MOT_BAT_VOLT_MAX is set.
    altitude_m
        Above sea level: thin air needs more.
    parameters
        MOT_* values.

    Notes
    -----
    The curve thrust = (1 − e)·x + e·x², e = MOT_THST_EXPO, solved for x and laid between
    MOT_SPIN_MIN and MOT_SPIN_MAX; checked against SERVO_OUTPUT_RAW of real firmware.
    """
    low, high = parameters["MOT_PWM_MIN"], parameters["MOT_PWM_MAX"]
    if not armed:
        return np.full_like(thrust, low)
    volts = _voltage_ratio(voltage, parameters)
    wanted = np.clip(thrust / _air_density(altitude_m), 0.0, 1.0)
    expo = min(max(parameters["MOT_THST_EXPO"], -1.0), 1.0)
    lift = volts * (1 - expo) + expo * volts**2
    if abs(expo) < _STRAIGHT:
        ratio = lift * wanted
    else:
        root = np.sqrt(np.maximum((1 - expo) ** 2 + 4 * expo * lift * wanted, 0.0))
        ratio = (expo - 1 + root) / (2 * expo)
    least, most = parameters["MOT_SPIN_MIN"], parameters["MOT_SPIN_MAX"]
    actuator = least + (most - least) * np.clip(ratio / volts, 0.0, 1.0)
    actuator = np.where(thrust > 0.0, actuator, parameters["MOT_SPIN_ARM"])
    return np.asarray(np.clip(low + (high - low) * actuator, 0.0, _LONGEST_US))


def motor_thrust(
    outputs: FloatArray, *, altitude_m: float, parameters: Mapping[str, float]
) -> FloatArray:
    """Thrust that motors give which are driven with ``outputs``, 0 … 1, same shape.

    Undoes :func:`motor_outputs`, without its scaling by the battery's voltage.

    Parameters
    ----------
    outputs
        Microseconds.
    altitude_m, parameters
        As there.
    """
    low, high = parameters["MOT_PWM_MIN"], parameters["MOT_PWM_MAX"]
    curve = ThrustCurve(
        min(max(parameters["MOT_THST_EXPO"], -1.0), 1.0),
        parameters["MOT_SPIN_MIN"],
        parameters["MOT_SPIN_MAX"],
    )
    return curve.thrust((outputs - low) / (high - low)) * _air_density(altitude_m)


def _voltage_ratio(voltage: float, parameters: Mapping[str, float]) -> float:
    most, least = parameters["MOT_BAT_VOLT_MAX"], parameters["MOT_BAT_VOLT_MIN"]
    if most <= 0.0 or least >= most:
        return 1.0
    return min(max(voltage, least, _LEAST_RATIO * most), most) / most


def _air_density(altitude_m: float) -> float:
    """Density relative to sea level in the standard atmosphere, within ArduPilot's bounds."""
    return float(np.clip((1.0 - 2.25577e-5 * altitude_m) ** 4.2559, 0.5, 1.25))
