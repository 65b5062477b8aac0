"""What a simulated vehicle is and does besides the ordinary: number, manners, company."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

_NUMBER_BYTES = 12  # of an STM32
BOARD_VERSION = 140 << 16
"""AUTOPILOT_VERSION.board_version of a CubeOrange."""


@dataclass(frozen=True)
class Companion:
    """Another component of the same system, which sends heartbeats.

    Attributes
    ----------
    component
        Its MAVLink number.
    mav_type, autopilot
        What its heartbeat says that it is.
    """

    component: int
    mav_type: int
    autopilot: int


GIMBAL = Companion(
    mavlink.MAV_COMP_ID_GIMBAL, mavlink.MAV_TYPE_GIMBAL, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
)
"""One that says it is of ArduPilot, as some do."""

CAMERA = Companion(
    mavlink.MAV_COMP_ID_CAMERA, mavlink.MAV_TYPE_CAMERA, mavlink.MAV_AUTOPILOT_INVALID
)
COMPUTER = Companion(
    mavlink.MAV_COMP_ID_ONBOARD_COMPUTER,
    mavlink.MAV_TYPE_QUADROTOR,
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
)
"""A companion computer that repeats the autopilot's heartbeat in its own name."""


@dataclass(frozen=True)
class Habits:
    """What tells one vehicle from its twin.

    Attributes
    ----------
    uid
        The flight controller's own number, 18 bytes at most; None for one that follows from the
        scenario's seed, empty for none.
    clamped
        Names that silently take the nearest value within two limits.
    ignored
        Names that take no write, and say nothing.
    denied
        Names whose write is denied: in words by ArduPilot, by PX4 in silence.
    not_numbers
        Names that are always reported as NaN.
    storage_s
        Seconds within which a write reaches the memory that survives a reboot, in any order. PX4
        has a pace of its own.
    companions
        Who else speaks in the vehicle's system.
    no_current_sensor
        PX4 only: its battery reports −1 A, and that is what COMP is multiplied by.
    """

    uid: bytes | None = None
    clamped: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    ignored: frozenset[str] = frozenset()
    denied: frozenset[str] = frozenset()
    not_numbers: frozenset[str] = frozenset()
    storage_s: float = 0.0
    companions: tuple[Companion, ...] = ()
    no_current_sensor: bool = False


def own_number(seed: int) -> bytes:
    """The number of the flight controller that a seed stands for."""
    return np.random.default_rng([seed, 5]).bytes(_NUMBER_BYTES)
