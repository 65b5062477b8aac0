"""What happens on a link, for whoever draws it or decides by it."""

from __future__ import annotations

from dataclasses import dataclass

from magcomp.model import Vehicle


@dataclass(frozen=True)
class VehicleFound:
    """The vehicle of this link is known; ``time`` in seconds of the link's clock.

    Comes again when more of it is learnt, as on a bad link, or when, after a gap or a reboot,
    another one answers in its place.
    """

    time: float
    vehicle: Vehicle


@dataclass(frozen=True)
class VehicleRebooted:
    """The vehicle's own clock started over."""

    time: float


@dataclass(frozen=True)
class GapStarted:
    """Nothing has come from the vehicle since ``time``."""

    time: float
    reason: str


@dataclass(frozen=True)
class GapEnded:
    """The vehicle is heard again at ``time``, ``duration`` seconds after the gap began."""

    time: float
    duration: float


@dataclass(frozen=True)
class SinkFailed:
    """A recorder or buffer could not take a frame and takes no more."""

    time: float
    error: Exception


@dataclass(frozen=True)
class StrangerHeard:
    """Somebody at another address speaks in the vehicle's name; it is not listened to."""

    time: float
    where: str


LinkEvent = VehicleFound | VehicleRebooted | GapStarted | GapEnded | SinkFailed | StrangerHeard
