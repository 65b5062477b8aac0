"""Who sends a heartbeat: an autopilot that flies or drives a vehicle, or anybody else.

A gimbal, a camera or a companion computer may say that it is of ArduPilot or PX4, and a ground
station may say that it is a vehicle. Two things make an autopilot: the type of something that
moves by itself, and the component number of an autopilot. A vehicle whose autopilot was given
another number is taken only where that number is asked for.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from magcomp import autopilots

AUTOPILOT_COMPONENT = 1
"""MAV_COMP_ID_AUTOPILOT1."""

AUTOPILOTS = {autopilot.mavlink_number: autopilot.key for autopilot in autopilots.ALL}
"""The autopilots magcomp knows, by HEARTBEAT.autopilot."""

KINDS = (
    dict.fromkeys((2, 3, 4, 13, 14, 15, 29, 35, 43), "copter")
    | dict.fromkeys((1, *range(19, 26), 47), "plane")
    | {10: "rover", 11: "boat", 12: "sub"}
    | dict.fromkeys((0, 7, 8, 9, 16, 17, 28, 45, 46), "unknown")
)
"""HEARTBEAT.type (MAV_TYPE) of everything that moves by itself; all others are no vehicles."""

_ARMED = 0x80  # MAV_MODE_FLAG_SAFETY_ARMED


@dataclass(frozen=True, order=True)
class Identity:
    """An autopilot that sends heartbeats.

    Attributes
    ----------
    system, component
        Its MAVLink address.
    autopilot
        As in :class:`magcomp.model.Vehicle`.
    kind
        As in :class:`magcomp.model.Vehicle`.
    """

    system: int
    component: int
    autopilot: str
    kind: str


def identify(system: int, component: int, mav_type: int, autopilot: int) -> Identity | None:
    """Read an autopilot's heartbeat.

    Parameters
    ----------
    system, component
        Who sent it.
    mav_type, autopilot
        HEARTBEAT.type and HEARTBEAT.autopilot.

    Returns
    -------
    Identity or None
        None where no vehicle's autopilot known here says so. Whether the component is an
        autopilot's is for :func:`is_vehicle`, which knows what was asked for.
    """
    if autopilot not in AUTOPILOTS or mav_type not in KINDS:
        return None
    return Identity(system, component, AUTOPILOTS[autopilot], KINDS[mav_type])


def is_vehicle(identity: Identity, component: int | None) -> bool:
    """Tell whether an identity's component is the one asked for, or else an autopilot's."""
    return identity.component == (AUTOPILOT_COMPONENT if component is None else component)


def vehicles(
    found: Iterable[Identity], system: int | None, component: int | None
) -> tuple[Identity, ...]:
    """The identities that are asked for, in order of system and component."""
    return tuple(
        sorted(
            identity
            for identity in found
            if is_vehicle(identity, component) and system in (None, identity.system)
        )
    )


def is_armed(base_mode: int) -> bool:
    """Tell whether HEARTBEAT.base_mode says that the motors are armed."""
    return bool(base_mode & _ARMED)
