"""Whether the vehicle is still there, still the same, and still disarmed. No I/O, no clock."""

from __future__ import annotations

from magcomp.writing.exchange import Timing
from magcomp.writing.messages import BootTime, Heartbeat, Incoming, Pong

_REORDERING = 2.0  # seconds by which boot time may go back without a reboot


class VehicleWatch:
    """Watches what the vehicle says of itself.

    Parameters
    ----------
    now
        The time, in seconds from anywhere.
    timing
        Patience.

    Attributes
    ----------
    armed
        Whether the newest heartbeat says so.
    """

    def __init__(self, now: float, timing: Timing) -> None:
        self._timing = timing
        self._since = now
        self._heard = now
        self._heartbeat: float | None = None
        # Two clocks, because nothing says that they began together.
        self._boot_times: dict[type[Incoming], float] = {}
        self.armed = False

    def renew(self, now: float) -> None:
        """Begin patience anew, and trust no heartbeat of before."""
        self._since = self._heard = now
        self._heartbeat = None

    def hear(self, message: Incoming, now: float, reordering: float = _REORDERING) -> str:
        """Take what the vehicle said; tells why it may have rebooted, or nothing.

        Parameters
        ----------
        reordering
            Seconds by which messages overtake each other.
        """
        self._heard = now
        match message:
            case Heartbeat(armed):
                self.armed = armed
                before, self._heartbeat = self._heartbeat, now
                if before is not None and now - before > self._timing.heartbeat_gap:
                    return f"no heartbeat came for {now - before:.0f} s"
            case BootTime(seconds) | Pong(seconds=seconds):
                before = self._boot_times.get(type(message), 0.0)
                self._boot_times[type(message)] = seconds
                # One that started a moment ago cannot go back by much.
                if seconds < before - min(max(reordering, _REORDERING), before / 2):
                    self._boot_times = {type(message): seconds}
                    return "the vehicle rebooted"
            case _:
                pass
        return ""

    def is_known_disarmed(self, now: float) -> bool:
        """Whether a heartbeat, young enough, says disarmed."""
        if self._heartbeat is None or now - self._heartbeat > self._timing.heartbeat_gap:
            return False
        return not self.armed

    def silence(self, now: float) -> float:
        """Seconds since anything was heard."""
        return now - self._heard

    def is_silent(self, now: float) -> bool:
        """Whether the link counts as lost."""
        return now >= self.silent_from

    def is_without_heartbeat(self, now: float) -> bool:
        """Whether there is a link, but no heartbeat on it."""
        last = self._since if self._heartbeat is None else self._heartbeat
        return now - last >= self._timing.silence

    def is_overdue(self, now: float) -> bool:
        """Whether all this takes too long."""
        return now - self._since >= self._timing.limit

    @property
    def silent_from(self) -> float:
        """When the link will count as lost, if nothing arrives before."""
        return self._heard + self._timing.silence
