"""Writing a compass calibration so that no half of it is ever in force. No I/O, no clock.

Stages and what leaves them
---------------------------
======== ============================================ ========= =================
stage    sends, a window at a time                    then      mismatch
======== ============================================ ========= =================
COMPARE  a read of the identity and all old values    OFF       over, untouched
OFF      a write of 0 to the switches                 WRITE     roll back
WRITE    a write of all values of the target          VERIFY    roll back
VERIFY   a read of all that, switches still 0         ON        SETTLE
ON       a write of the target's switches             CONFIRM   roll back
CONFIRM  a read of the switches                       OVER      SETTLE
SETTLE   nothing, until all sent before is history    IDENTIFY
IDENTIFY a read of the identity                       OFF       over
OVER     nothing
======== ============================================ ========= =================

The target is the new set; rolling back is the same road with the old set as
target, entered at SETTLE.

Rules
-----
1. At every instant the vehicle holds all-old, or all-new, or its switches are
   0: values change only between OFF and ON, and each stage ends only when
   everything in it was confirmed.
2. Nothing is written unless a heartbeat not older than ``heartbeat_gap`` says
   disarmed. A vehicle that is armed gets no further write, not even the old
   values.
3. A write counts when a PARAM_VALUE carries exactly its float32, whatever its
   index. An echo of another value may be stale, or a sibling's (setting _X
   echoes _Y and _Z): it is counted, not believed, and the write repeated
   together with a read, because ArduPilot answers an unknown name with silence.
4. Boot time going back, or a gap in the heartbeat, may be a reboot or another
   vehicle: nothing known before counts. SETTLE, and identity is read again.
5. Whoever delays messages, delays them at most ``quiet`` seconds. So SETTLE
   waits that long, and so does OFF after it had to be repeated: a late copy
   of an old write cannot undo a newer one unseen.
6. Refusal, silence, a lost link and a request to stop roll back, once.
   A roll-back that fails leaves the switches 0 where they had been confirmed.
"""

from __future__ import annotations

from collections.abc import Mapping

from magcomp.parameters.events import (
    Event,
    Intends,
    Mismatch,
    Outcome,
    Progress,
    Reason,
    Restarted,
    RollingBack,
    Stage,
    Standing,
    Written,
)
from magcomp.parameters.exchange import Exchange, Timing
from magcomp.parameters.files import format_value
from magcomp.parameters.messages import (
    REAL32,
    BootTime,
    Heartbeat,
    Incoming,
    Outgoing,
    ParamRefused,
    ParamValue,
    ReadName,
    SetValue,
    fits,
)
from magcomp.parameters.plan import WritePlan

_NEXT = {
    Stage.COMPARE: Stage.OFF,
    Stage.OFF: Stage.WRITE,
    Stage.WRITE: Stage.VERIFY,
    Stage.VERIFY: Stage.ON,
    Stage.ON: Stage.CONFIRM,
    Stage.CONFIRM: Stage.OVER,
    Stage.SETTLE: Stage.IDENTIFY,
    Stage.IDENTIFY: Stage.OFF,
}
_WRITING = frozenset({Stage.OFF, Stage.WRITE, Stage.ON})
_BELIEVED_READS = 2
_BELIEVED_ECHOES = 12  # at 30 % loss a good write fails that often once in 10⁶
_REORDERING = 2.0  # seconds by which boot time may go back without a reboot
_GATE = 0.2


class WriteSequence:
    """Drives a vehicle from all-old to all-new, or back; see the top of the file.

    Parameters
    ----------
    plan
        What to write, and where.
    now
        The time, in seconds from anywhere.
    timing
        Patience.

    Attributes
    ----------
    stage
        See the table at the top of the file.
    outcome
        How it ended; None before.
    """

    def __init__(self, plan: WritePlan, *, now: float, timing: Timing | None = None) -> None:
        self._plan = plan
        self._timing = timing or Timing()
        self._values: Mapping[str, float] = plan.new
        self._switches: Mapping[str, float] = plan.switches
        self._rolling_back: RollingBack | None = None
        self._events: list[Event] = []
        self._types: dict[str, int] = {}
        self._expected: Mapping[str, float] = {}
        self._exchange: Exchange[str] = Exchange((), self._timing)
        self._since = now
        self._heard = now
        self._heartbeat: float | None = None
        self._boot_time = 0.0
        self._not_before = now
        self._restarts = 0
        self._touched = False
        self._switched_off = False
        self.outcome: Outcome | None = None
        self.stage = Stage.COMPARE
        self._enter(Stage.COMPARE, now)

    @property
    def finished(self) -> bool:
        """Whether nothing more will happen."""
        return self.stage is Stage.OVER

    def handle(self, message: Incoming, now: float) -> None:
        """Take what the vehicle said."""
        if self.finished:
            return
        self._heard = now
        match message:
            case Heartbeat(armed):
                self._take_heartbeat(now, armed=armed)
            case BootTime(seconds):
                if seconds < self._boot_time - _REORDERING:
                    self._restart(Reason.LINK_LOST, "the vehicle rebooted", now)
                self._boot_time = seconds
            case ParamRefused(name, why):
                if self._exchange.differ(name):
                    self._fail(Reason.REFUSED, f"{name} was not taken: {why}", now)
            case ParamValue():
                self._take_value(message, now)
            case _:
                pass

    def poll(self, now: float) -> tuple[list[Event], list[Outgoing]]:
        """Tell what has happened, then what is to be sent.

        Journals must have the events on the disk before the messages are sent.
        """
        self._check_patience(now)
        while not self.finished and not self._exchange.open and now >= self._not_before:
            self._leave(now)
        outgoing = [] if self.finished else self._ask(now)
        events, self._events = self._events, []
        return events, outgoing

    def wake(self, now: float) -> float:
        """When to poll next, if nothing arrives before."""
        if not self._exchange.open:
            due = self._not_before
        elif self._gate_closed(now):
            due = now + _GATE
        else:
            due = self._exchange.wake(now)
        return min(due, self._heard + self._timing.silence)

    def stop(
        self, now: float, reason: Reason = Reason.STOPPED, why: str = "it was interrupted"
    ) -> None:
        """End because the user asks, or must: untouched, or by rolling back."""
        if not self.finished and self._rolling_back is None:
            self._fail(reason, why, now)

    def abandon(self, why: str) -> None:
        """End at once, because the link cannot be used any more."""
        if not self.finished:
            self._end(Reason.LINK_LOST, why)

    def _take_heartbeat(self, now: float, *, armed: bool) -> None:
        if armed:
            self._end(Reason.ARMED, "the vehicle is armed")
            return
        before, self._heartbeat = self._heartbeat, now
        if before is not None and now - before > self._timing.heartbeat_gap:
            why = f"no heartbeat came for {now - before:.0f} s"
            self._restart(Reason.LINK_LOST, why, now)

    def _take_value(self, message: ParamValue, now: float) -> None:
        name = message.name
        wanted = self._expected.get(name)
        if wanted is None:
            return
        if message.value != wanted:
            self._take_other_value(name, message.value, now)
            return
        if not self._exchange.answer(name):
            return
        self._types[name] = message.type
        if self.stage in _WRITING:
            self._events.append(Written(name, wanted))
        done, total = self._exchange.answered, self._exchange.total
        self._events.append(Progress(self.stage, name, done, total))

    def _take_other_value(self, name: str, value: float, now: float) -> None:
        count = self._exchange.differ(name)
        if count < (_BELIEVED_ECHOES if self.stage in _WRITING else _BELIEVED_READS):
            return
        wanted = self._expected[name]
        why = (
            f"{name} must read back as {format_value(wanted)}; "
            f"instead received {format_value(value)}"
        )
        self._events.append(Mismatch(name, wanted, value))
        if name in self._plan.identity:
            self._end(Reason.ANOTHER_VEHICLE, why)
        elif self.stage is Stage.COMPARE:
            self._end(Reason.CHANGED, f"{why} (it changed since the backup)")
        elif self.stage in _WRITING:
            self._fail(Reason.MISMATCH, why, now)
        else:
            self._restart(Reason.MISMATCH, why, now)

    def _check_patience(self, now: float) -> None:
        if self.finished:
            return
        silence, limit = self._timing.silence, self._timing.limit
        heartbeat = self._since if self._heartbeat is None else self._heartbeat
        silent = self._exchange.unanswered(now)
        if now - self._heard >= silence:
            self._fail(Reason.LINK_LOST, f"nothing was heard for {silence:.0f} s", now)
        elif now - self._since >= limit:
            self._fail(Reason.TIMEOUT, f"the write did not end within {limit:.0f} s", now)
        elif self._gate_closed(now) and now - heartbeat >= silence:
            self._fail(Reason.LINK_LOST, f"no heartbeat came for {silence:.0f} s", now)
        elif silent:
            why = f"{silent[0]} was not answered in {self._timing.attempts} attempts"
            self._fail(Reason.TIMEOUT, why, now)

    def _enter(self, stage: Stage, now: float) -> None:
        off = dict.fromkeys(self._switches, 0.0)
        expected: dict[Stage, Mapping[str, float]] = {
            Stage.COMPARE: {**self._plan.identity, **self._plan.old},
            Stage.IDENTIFY: self._plan.identity,
            Stage.OFF: off,
            Stage.WRITE: self._values,
            Stage.VERIFY: {**off, **self._values},
            Stage.ON: self._switches,
            Stage.CONFIRM: self._switches,
        }
        self.stage = stage
        self._expected = expected.get(stage, {})
        self._exchange = Exchange(self._expected, self._timing)
        if stage is Stage.SETTLE:
            self._not_before = now + self._timing.quiet
        if stage in _WRITING and self._expected:
            self._events.append(Intends(stage, dict(self._expected)))

    def _leave(self, now: float) -> None:
        if self.stage is Stage.COMPARE and not self._all_fit():
            return
        if self.stage is Stage.OFF:
            self._switched_off = True
        if self.stage is Stage.VERIFY:
            self._switched_off = False
        if self.stage is Stage.CONFIRM:
            self._complete()
            return
        self._enter(_NEXT[self.stage], now)

    def _all_fit(self) -> bool:
        for name, value in {**self._values, **self._switches}.items():
            if not fits(value, self._types[name]):
                self._end(Reason.REFUSED, f"{name} cannot hold {format_value(value)}")
                return False
        return True

    def _ask(self, now: float) -> list[Outgoing]:
        if self._gate_closed(now):
            return []
        outgoing: list[Outgoing] = []
        for name, attempt in self._exchange.ask(now):
            if self.stage in _WRITING:
                self._touched = True
                kind = self._types.get(name, REAL32)
                outgoing.append(SetValue(name, self._expected[name], kind))
                if self.stage is Stage.OFF and attempt > 1:
                    self._not_before = now + self._timing.quiet
            if self.stage not in _WRITING or attempt > 1:
                outgoing.append(ReadName(name))
        return outgoing

    def _gate_closed(self, now: float) -> bool:
        """Whether a write waits for a heartbeat that says disarmed."""
        if self.stage not in _WRITING:
            return False
        return self._heartbeat is None or now - self._heartbeat > self._timing.heartbeat_gap

    def _restart(self, reason: Reason, why: str, now: float) -> None:
        self._restarts += 1
        if self._restarts > self._timing.restarts:
            self._fail(reason, why, now)
            return
        self._events.append(Restarted(why))
        self._switched_off = False
        self._enter(Stage.SETTLE if self._touched else Stage.COMPARE, now)

    def _fail(self, reason: Reason, why: str, now: float) -> None:
        if not self._touched or self._rolling_back is not None:
            self._end(reason, why)
            return
        self._rolling_back = RollingBack(reason, why)
        self._events.append(self._rolling_back)
        self._values = {name: self._plan.old[name] for name in self._plan.new}
        self._switches = {name: self._plan.old[name] for name in self._plan.switches}
        self._since = self._heard = now
        self._heartbeat = None
        self._restarts = 0
        self._enter(Stage.SETTLE, now)

    def _complete(self) -> None:
        if self._rolling_back is None:
            self._finish(Outcome(Standing.NEW))
        else:
            self._finish(Outcome(Standing.OLD, self._rolling_back.reason, self._rolling_back.why))

    def _end(self, reason: Reason, why: str) -> None:
        """End without writing anything more."""
        if not self._touched:
            standing = Standing.OLD
        else:
            standing = Standing.OFF if self._switched_off else Standing.UNSURE
        if self._rolling_back is not None and reason is not Reason.ARMED:
            why = f"{self._rolling_back.why}; the roll-back failed as well: {why}"
            reason = self._rolling_back.reason
        self._finish(Outcome(standing, reason, why))

    def _finish(self, outcome: Outcome) -> None:
        self.outcome = outcome
        self._events.append(outcome)
        self.stage = Stage.OVER
        self._expected = {}
        self._exchange = Exchange((), self._timing)
