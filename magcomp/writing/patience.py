"""When a write has waited long enough, and what is then said of it."""

from __future__ import annotations

from dataclasses import dataclass

from magcomp.writing.events import Reason, Stage
from magcomp.writing.exchange import Exchange, Timing
from magcomp.writing.fence import Fence
from magcomp.writing.stages import FENCED, WRITING
from magcomp.writing.watch import VehicleWatch

BELIEVED_READS = 2
BELIEVED_ECHOES = 12  # at 30 % loss a good write is lost that often once in 10⁶
BELIEVED_REFUSALS = 8
"""So often another value than the wanted one must come before it is believed."""


@dataclass(frozen=True)
class Waiting:
    """What is waited for.

    Attributes
    ----------
    stage
        Where the write is.
    watch, exchange, fence
        The vehicle, the questions under way, and what keeps late answers out.
    gated
        Nothing is sent now: a heartbeat or a fence is waited for first.
    """

    stage: Stage
    watch: VehicleWatch
    exchange: Exchange[str]
    fence: Fence
    gated: bool


def ran_out(waiting: Waiting, timing: Timing, now: float) -> tuple[Reason, str] | None:
    """Why nothing more is waited for, as the end of a sentence; None while there is patience."""
    writing = waiting.stage in WRITING
    silent = waiting.exchange.unanswered(now)
    if waiting.watch.is_silent(now):
        return Reason.LINK_LOST, f"nothing was heard for {timing.silence:.0f} s"
    if waiting.watch.is_overdue(now):
        return Reason.TIMEOUT, f"the write did not end within {timing.limit:.0f} s"
    if writing and waiting.gated and waiting.watch.is_without_heartbeat(now):
        return Reason.LINK_LOST, f"no heartbeat came for {timing.silence:.0f} s"
    if waiting.stage in FENCED and waiting.fence.exhausted():
        return Reason.TIMEOUT, "the vehicle answers no TIMESYNC any more"
    if silent:
        verb = "confirmed" if writing else "answered"
        return Reason.TIMEOUT, f"{silent[0]} was not {verb} in {timing.attempts} attempts"
    return None
