"""Why no vehicle was found, or too many, in one sentence, from what arrived instead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from magcomp import autopilots
from magcomp.link.quality import LinkStatistics
from magcomp.mavlink.heartbeat import Identity

_NAMES_SHOWN = 4


def why_no_vehicle(
    address: str,
    seconds: float,
    statistics: LinkStatistics,
    heartbeats: Sequence[Identity],
    companions: Sequence[Identity],
    foreign: Mapping[str, int],
    *,
    system: int | None = None,
    baud: int | None = None,
) -> str:
    """Explain a silence.

    Parameters
    ----------
    address, seconds
        Where, and for how long, a heartbeat was waited for.
    statistics, heartbeats, companions, foreign
        What arrived: counts, autopilots, those that say they are one from another component, and
        names of messages from anyone else.
    system
        The vehicle that was asked for, if one was.
    baud
        The line's speed, where it has one.
    """
    start = f"No heartbeat of a vehicle arrived at {address} within {seconds:g} s: "
    if statistics.bytes_received == 0:
        return start + "nothing arrived at all; check the power, the cable and the address."
    if heartbeats and system is not None:
        heard = ", ".join(str(number) for number in sorted({h.system for h in heartbeats}))
        return start + f"system {system} must be on the link; instead heard system {heard}."
    if statistics.refused > statistics.frames:
        return start + (
            f"{statistics.refused} frames arrived, but none is signed with the key given."
        )
    if statistics.skipped > statistics.bytes_received // 2 or statistics.frames == 0:
        hint = (
            "what speaks there does not speak MAVLink"
            if baud is None
            else f"the baud rate {baud} is probably wrong (radios use 57600, USB does not care)"
        )
        return start + f"{statistics.bytes_received} bytes arrived but no MAVLink frames; {hint}."
    if companions:
        numbers = sorted({companion.component for companion in companions})
        return start + (
            f"only component {', '.join(map(str, numbers))} says that it is an autopilot, which "
            "may be a companion; where it is the autopilot, choose it with --component."
        )
    names = sorted(foreign, key=lambda name: -foreign[name])[:_NAMES_SHOWN]
    return start + (
        f"{statistics.frames} frames arrived, but none from an {autopilots.TITLES} autopilot "
        f"(only {', '.join(names)})."
    )


def why_ambiguous(address: str, heartbeats: Sequence[Identity], *, twins: bool) -> str:
    """Explain why nobody can tell which vehicle is meant.

    Parameters
    ----------
    address
        Where they were heard.
    heartbeats
        The autopilots.
    twins
        Two of one number speak, from different addresses.
    """
    if twins:
        return (
            f"One vehicle of a number must be on {address}; instead two at different addresses say "
            f"that they are system {heartbeats[0].system}. Give one of them another number or "
            "switch it off; where both are one vehicle, --system takes the one heard first."
        )
    systems = " and ".join(
        f"{h.system} ({autopilots.title(h.autopilot)} {h.kind})" for h in heartbeats
    )
    return f"Several vehicles are on {address}, systems {systems}; choose one with --system."
