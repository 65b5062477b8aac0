"""What screens and threads post and the app handles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from textual.message import Message

from magcomp.live.snapshot import LiveSnapshot
from magcomp.sweeping.events import Event


class StateWanted(Message):
    """A screen has come to the front and wants to be given what to draw."""


class PortsWanted(Message):
    """Look for serial ports."""


class TargetChosen(Message):
    """Open a log, or connect to an address.

    Parameters
    ----------
    target
        Path or address.
    """

    def __init__(self, target: str) -> None:
        super().__init__()
        self.target = target


class OptionsChosen(Message):
    """Fit with other options.

    Parameters
    ----------
    changed
        Names of :class:`magcomp.analysis.Options` and their new values.
    """

    def __init__(self, changed: Mapping[str, Any]) -> None:
        super().__init__()
        self.changed = changed


class TimeRangeWanted(Message):
    """Ask which part of the recording to fit."""


class CompassToggled(Message):
    """Write a compass, or leave it out.

    Parameters
    ----------
    compass
        1, 2 or 3.
    """

    def __init__(self, compass: int) -> None:
        super().__init__()
        self.compass = compass


class SnapshotTaken(Message):
    """A vehicle as it stands, from the thread that watches it.

    Parameters
    ----------
    snapshot
        The newest takes the place of those not handled yet.
    """

    def __init__(self, snapshot: LiveSnapshot) -> None:
        super().__init__()
        self.snapshot = snapshot

    def can_replace(self, message: Message) -> bool:
        """A screen that is slow shows fewer snapshots, never old ones."""
        return isinstance(message, SnapshotTaken)


class SweepTold(Message):
    """Something happened in a sweep, from the thread that carries it out, which never waits.

    Parameters
    ----------
    event
        What.
    """

    def __init__(self, event: Event) -> None:
        super().__init__()
        self.event = event


class WatchingFailed(Message):
    """The thread that watches a vehicle has ended in an error.

    Parameters
    ----------
    error
        Which.
    """

    def __init__(self, error: Exception) -> None:
        super().__init__()
        self.error = error
