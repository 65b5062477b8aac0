"""Whether the vehicle may have its motors spun: alive, disarmed, on the ground and still.

No I/O, no clock.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from magcomp.sweeping.events import Reason
from magcomp.sweeping.messages import Attitude, Current, Incoming, Landed, Position
from magcomp.writing.messages import Heartbeat

_NEVER = -math.inf


@dataclass(frozen=True)
class Limits:
    """How long a sweep does what, and what it bears.

    Attributes
    ----------
    timeout_s
        Time-out that the autopilot is given with each command: the longest that a motor runs on
        when nothing arrives any more.
    repeat_s
        A running step's commands are repeated so often.
    hold_s, settle_s
        Length of a step, and the part at its beginning that its current is not taken from.
    rest_s
        Least time with all motors still before a step.
    heartbeat_s, attitude_s
        Silence of either after which the link counts as lost.
    answer_s
        A command without an answer for so long is taken for unheard.
    ready_s
        Longest time to wait for the vehicle to be ready for a step.
    armed_after_s
        A heartbeat that says armed so long after the last command's time-out is not the test's.
    tilt_rad, turn_rad, moved_m
        How far it may tilt from how it stood at first, turn during a step, and move during one.
    """

    timeout_s: float = 1.0
    repeat_s: float = 0.25
    hold_s: float = 3.0
    settle_s: float = 0.7
    rest_s: float = 1.0
    heartbeat_s: float = 2.5
    attitude_s: float = 1.0
    answer_s: float = 1.5
    ready_s: float = 8.0
    armed_after_s: float = 1.5
    tilt_rad: float = math.radians(5.0)
    turn_rad: float = math.radians(10.0)
    moved_m: float = 1.5


class StillWatch:
    """Watches what the vehicle says of itself.

    Parameters
    ----------
    limits
        What is borne.
    """

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._armed = False
        self._aloft = False
        self._heartbeat_at = self._attitude_at = _NEVER
        self._attitude: Attitude | None = None
        self._position: Position | None = None
        self._stood: Attitude | None = None
        self._was_at: Position | None = None
        self._turned = 0.0
        self._armed_is_ours_until = _NEVER

    def hear(self, message: Incoming, now: float) -> None:
        """Take what the vehicle said."""
        match message:
            case Heartbeat(armed):
                self._armed, self._heartbeat_at = armed, now
            case Attitude():
                self._turn(message)
                self._attitude, self._attitude_at = message, now
            case Position():
                self._position = message
            case Landed(aloft):
                self._aloft = aloft
            case _:
                pass

    def expect_armed(self, until: float) -> None:
        """A motor test of ours may make the heartbeat say armed until then."""
        self._armed_is_ours_until = until

    def begin_step(self) -> None:
        """Movement counts from here; tilt from the first step on."""
        self._stood = self._stood or self._attitude
        self._was_at = self._position
        self._turned = 0.0

    def is_ready(self, since: float, now: float) -> bool:
        """Whether a heartbeat since then says disarmed, and the attitude is known."""
        return (
            self._heartbeat_at >= since
            and not self._armed
            and self._attitude is not None
            and now - self._attitude_at <= self._limits.attitude_s
        )

    def objection(self, now: float, *, spinning: bool) -> tuple[Reason, str] | None:
        """The first of the rows of ``_OBJECTIONS`` that holds; None where all is well.

        Parameters
        ----------
        spinning
            Whether motors may be spinning: only then silence is one.
        """
        for reason, only_spinning, says in _OBJECTIONS:
            why = says(self, now) if spinning or not only_spinning else ""
            if why:
                return reason, why
        return None

    def _turn(self, new: Attitude) -> None:
        old = self._attitude
        step = 0.0 if old is None else min(max(new.seconds - old.seconds, 0.0), 1.0)
        self._turned += new.yaw_rate * step

    def _says_silent(self, now: float) -> str:
        if now - self._heartbeat_at > self._limits.heartbeat_s:
            return f"no heartbeat came for {self._limits.heartbeat_s:g} s"
        if now - self._attitude_at > self._limits.attitude_s:
            return f"no attitude came for {self._limits.attitude_s:g} s"
        return ""

    def _says_armed(self, now: float) -> str:  # noqa: ARG002
        ours = self._heartbeat_at <= self._armed_is_ours_until
        return "the vehicle is armed" if self._armed and not ours else ""

    def _says_flying(self, now: float) -> str:  # noqa: ARG002
        return "the vehicle says that it is in the air" if self._aloft else ""

    def _says_tilted(self, now: float) -> str:  # noqa: ARG002
        stood, stands = self._stood, self._attitude
        if stood is None or stands is None:
            return ""
        tilt = _tilt(stood, stands)
        if tilt > self._limits.tilt_rad:
            return f"the vehicle tilted by {math.degrees(tilt):.0f}°"
        if abs(self._turned) > self._limits.turn_rad:
            return f"the vehicle turned by {abs(math.degrees(self._turned)):.0f}°"
        return ""

    def _says_moved(self, now: float) -> str:  # noqa: ARG002
        was, at = self._was_at, self._position
        if was is None or at is None:
            return ""
        moved = was.distance(at)
        return f"the vehicle moved by {moved:.1f} m" if moved > self._limits.moved_m else ""


_Says = Callable[[StillWatch, float], str]

_OBJECTIONS: tuple[tuple[Reason, bool, _Says], ...] = (
    # reason, whether only while motors may spin, what is the matter
    (Reason.FLYING, False, StillWatch._says_flying),
    (Reason.ARMED, False, StillWatch._says_armed),
    (Reason.TILTED, False, StillWatch._says_tilted),
    (Reason.MOVED, False, StillWatch._says_moved),
    (Reason.LINK_LOST, True, StillWatch._says_silent),
)
"""What stops a sweep at once."""


class CurrentMean:
    """Mean of the battery current over a stretch of time."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Forget what came before."""
        self._sum, self._count = 0.0, 0

    def hear(self, message: Incoming) -> None:
        """Take what the vehicle said."""
        if isinstance(message, Current):
            self._sum += message.amperes
            self._count += 1

    @property
    def amperes(self) -> float | None:
        """None where nothing was told."""
        return self._sum / self._count if self._count else None


def _tilt(one: Attitude, other: Attitude) -> float:
    """Angle between two directions of gravity, radians: the scalar product of two rows of C."""
    across = math.cos(one.pitch) * math.cos(other.pitch) * math.cos(one.roll - other.roll)
    cosine = math.sin(one.pitch) * math.sin(other.pitch) + across
    return math.acos(max(-1.0, min(1.0, cosine)))
