"""Which autopilot of a log is meant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from magcomp import autopilots
from magcomp.errors import ChooseVehicleError, LogError
from magcomp.mavlink.checksum import OffsetArray
from magcomp.mavlink.frames import Frames
from magcomp.mavlink.heartbeat import Identity, identify, vehicles
from magcomp.mavlink.messages import Table


@dataclass(frozen=True)
class Choice:
    """The vehicle asked for, where a source may hold several.

    Attributes
    ----------
    system
        Its MAVLink system; None takes the only one there is.
    component
        Its autopilot's MAVLink component; None takes the number that autopilots have.
    """

    system: int | None = None
    component: int | None = None


_CLOCKS_APART = 2_000_000
_LEAST_TURNS, _TURNS_SHARE = 50, 0.05

ONLY_ONE = Choice()
"""The only vehicle there is."""


def choose(source: str, heartbeats: Frames, table: Table, choice: Choice) -> Identity:
    """The one autopilot a recording is made of.

    Parameters
    ----------
    source
        Name of the log, for messages.
    heartbeats, table
        All heartbeats of the log and their columns, shape (n,) each.
    choice
        The vehicle asked for.

    Raises
    ------
    LogError
        No autopilot sent a heartbeat.
    ChooseVehicleError
        Several did and none was chosen, or not the one that was.
    """
    heard = _identities(heartbeats, table)
    if not heard:
        raise LogError(
            f"Log {source} must hold heartbeats of an {autopilots.TITLES} autopilot; "
            f"instead received {_who(heartbeats)}."
        )
    found = vehicles(heard, None, choice.component)
    if not found:
        raise _no_such_component(source, heard, choice.component)
    if choice.system is None and len(found) > 1:
        choices = " or ".join(f"--system {identity.system}" for identity in found)
        described = ", ".join(
            f"{each.system} ({autopilots.title(each.autopilot)} {each.kind})" for each in found
        )
        raise ChooseVehicleError(
            f"Log {source} must be read for one vehicle; instead received the systems "
            f"{described}: choose with {choices}."
        )
    wanted = found if choice.system is None else vehicles(found, choice.system, choice.component)
    if not wanted:
        raise ChooseVehicleError(
            f"--system must be an autopilot of log {source}, which holds system "
            f"{', '.join(str(identity.system) for identity in found)}; "
            f"instead received {choice.system}."
        )
    return wanted[0]


def require_one_clock(source: str, stamp: OffsetArray) -> None:
    """Refuse two vehicles that speak under one number at the same time.

    Parameters
    ----------
    source
        Name of the log, for messages.
    stamp
        Time since boot in microseconds of messages of one kind as they came, shape (n,).

    Raises
    ------
    ChooseVehicleError
        The time goes back and forth all the time, as only two clocks do.
    """
    step = np.diff(stamp[stamp >= 0])
    turns = min(np.count_nonzero(step < -_CLOCKS_APART), np.count_nonzero(step > _CLOCKS_APART))
    if turns >= _LEAST_TURNS and turns > _TURNS_SHARE * len(step):
        raise ChooseVehicleError(
            f"Log {source} must hold one vehicle under a system number; instead two clocks take "
            f"turns {turns} times, so two vehicles speak with the same one: give each a number of "
            "its own and record again."
        )


def _identities(heartbeats: Frames, table: Table) -> tuple[Identity, ...]:
    """Each (system, component) with the last autopilot it said it was."""
    parts = (heartbeats.system, heartbeats.component, table["type"], table["autopilot"])
    key = np.zeros(len(heartbeats), dtype=np.int64)
    for part in parts:
        key = (key << 8) | part.astype(np.int64)
    # The first of the reversed rows is the last that was said.
    different, first = np.unique(key[::-1], return_index=True)
    last: dict[tuple[int, int], Identity] = {}
    for said in different[np.argsort(-first)].tolist():
        identity = identify(*int(said).to_bytes(4, "big"))
        if identity is not None:
            last[identity.system, identity.component] = identity
    return tuple(last.values())


def _no_such_component(
    source: str, heard: Sequence[Identity], component: int | None
) -> LogError | ChooseVehicleError:
    numbers = sorted({identity.component for identity in heard})
    named = ", ".join(map(str, numbers))
    if component is None:
        choices = " or ".join(f"--component {number}" for number in numbers)
        return LogError(
            f"Log {source} must hold heartbeats of an autopilot, component 1; instead received "
            f"those of component {named}, which may be a companion: where it is the autopilot, "
            f"choose it with {choices}."
        )
    return ChooseVehicleError(
        f"--component must be an autopilot of log {source}, which holds component {named}; "
        f"instead received {component}."
    )


def _who(heartbeats: Frames) -> str:
    pairs = sorted({*zip(heartbeats.system.tolist(), heartbeats.component.tolist(), strict=True)})
    if not pairs:
        return "no heartbeat at all"
    return "heartbeats of " + ", ".join(f"system {s} component {c}" for s, c in pairs) + " only"
