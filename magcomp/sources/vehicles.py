"""Which autopilot of a log is meant, and what its heartbeats say about it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from magcomp.errors import ChooseVehicleError, LogError
from magcomp.model import FloatArray
from magcomp.sources.columns import Table
from magcomp.sources.frames import Frames

_ARDUPILOT = 3
_PX4 = 12
AUTOPILOTS = {_ARDUPILOT: "ardupilot", _PX4: "px4"}
"""The autopilots magcomp knows, by HEARTBEAT.autopilot."""

KINDS = (
    dict.fromkeys((2, 3, 4, 13, 14, 15, 29, 35), "copter")
    | dict.fromkeys((1, *range(19, 26)), "plane")
    | {10: "rover", 11: "boat", 12: "sub"}
    | dict.fromkeys((0, 7, 8, 9, 16, 17, 28, 43), "unknown")
)
"""MAV_TYPE of everything that moves by itself; ground stations, gimbals, radios are not here."""

_ARMED = 128
_FIRST_COMPONENT = 1


@dataclass(frozen=True)
class Identity:
    """An autopilot that sends heartbeats.

    Attributes
    ----------
    system, component
        Its MAVLink address.
    autopilot
        ``"ardupilot"`` or ``"px4"``.
    kind
        As in :class:`magcomp.model.Vehicle`.
    """

    system: int
    component: int
    autopilot: str
    kind: str


def choose(source: str, heartbeats: Frames, table: Table, system: int | None) -> Identity:
    """The one autopilot a recording is made of.

    Parameters
    ----------
    source
        Name of the log, for messages.
    heartbeats, table
        All heartbeats of the log and their columns, shape (n,) each.
    system
        The system wanted, or None to take the only one there is.

    Raises
    ------
    LogError
        No autopilot sent a heartbeat, or not the one wanted.
    ChooseVehicleError
        Several did and none was chosen.
    """
    found = sorted(_autopilots(heartbeats, table), key=lambda i: (i.system, i.component))
    systems = sorted({identity.system for identity in found})
    if not found:
        raise LogError(
            f"Log {source} must hold heartbeats of an ArduPilot or PX4 autopilot; "
            f"instead received {_who(heartbeats)}."
        )
    if system is None and len(systems) > 1:
        choices = " or ".join(f"--system {number}" for number in systems)
        described = ", ".join(f"{i.system} ({i.autopilot} {i.kind})" for i in found)
        raise ChooseVehicleError(
            f"Log {source} must be read for one vehicle; instead received the systems "
            f"{described}: choose with {choices}."
        )
    wanted = systems[0] if system is None else system
    if wanted not in systems:
        raise ChooseVehicleError(
            f"--system must be an autopilot of log {source}, which holds system "
            f"{', '.join(map(str, systems))}; instead received {wanted}."
        )
    return next(identity for identity in found if identity.system == wanted)


def is_armed(table: Table) -> FloatArray:
    """1 armed, 0 disarmed for each heartbeat, shape (n,)."""
    armed: FloatArray = ((table["base_mode"] & _ARMED) != 0).astype(np.float64)
    return armed


def _autopilots(heartbeats: Frames, table: Table) -> Iterable[Identity]:
    """Each (system, component) with the last thing it said it was; one component per system."""
    last = {
        (s, c): (kind, autopilot)
        for s, c, kind, autopilot in zip(
            heartbeats.system.tolist(),
            heartbeats.component.tolist(),
            table["type"].tolist(),
            table["autopilot"].tolist(),
            strict=True,
        )
        if autopilot in AUTOPILOTS and kind in KINDS
    }
    for system in {s for s, _ in last}:
        components = sorted(c for s, c in last if s == system)
        component = _FIRST_COMPONENT if _FIRST_COMPONENT in components else components[0]
        kind, autopilot = last[system, component]
        yield Identity(system, component, AUTOPILOTS[autopilot], KINDS[kind])


def _who(heartbeats: Frames) -> str:
    pairs = sorted({*zip(heartbeats.system.tolist(), heartbeats.component.tolist(), strict=True)})
    if not pairs:
        return "no heartbeat at all"
    return "heartbeats of " + ", ".join(f"system {s} component {c}" for s, c in pairs) + " only"
