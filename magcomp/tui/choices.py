"""What the connect screen offers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from magcomp import autopilots
from magcomp.link import SerialPort

SIMULATED = {f"simulated {each.title} vehicle": each.key for each in autopilots.ALL}
"""What is chosen, and whose firmware it has."""

LISTEN = "udp:0.0.0.0:14550"


@dataclass(frozen=True)
class Choice:
    """A line of the list.

    Attributes
    ----------
    target
        Address or path, or one of `SIMULATED`.
    note
        What it is.
    """

    target: str
    note: str


def choices(ports: Iterable[SerialPort], recent: Sequence[str]) -> tuple[Choice, ...]:
    """Serial ports first, then what was used lately, then what always works."""
    listed = [Choice(port.device, port.description or "serial port") for port in ports]
    known = {choice.target for choice in listed} | {LISTEN}
    return (
        *listed,
        *(Choice(name, "used lately") for name in recent if name not in known),
        Choice(LISTEN, "listen for whoever sends here"),
        *(Choice(name, "to try everything; nothing can break") for name in SIMULATED),
    )
