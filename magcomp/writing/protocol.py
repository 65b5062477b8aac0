"""Writing a compass calibration so that no half of it is ever in force. No I/O, no clock.

The stages and what leaves them: stages.py.

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
4. An autopilot stores a write some time after its echo, in any order; a reboot
   may take back what is not stored. So OFF, WRITE and ON are each followed by
   ``storing`` seconds in which nothing is changed: a reboot then takes back only
   what one stage wrote, even after the program died. A vehicle that says nothing
   at all for ``quiet`` seconds may be rebooting: no value is written before the
   switches are confirmed 0 anew. ON is written once; values come before it again.
5. Boot time going back, or a gap in the heartbeat, may be a reboot or another
   vehicle: nothing known before counts. SETTLE, and identity is read again.
6. An answer may be older than its question. VERIFY and CONFIRM, which are
   believed, ask behind a fence (fence.py), when everything sent before has
   come, and end with another, when boot time has been seen once more. SETTLE, and
   WRITE after an OFF that had to be repeated, wait ``quiet`` seconds besides: a
   late copy of an old write cannot undo a newer one unseen.
"""

from __future__ import annotations

from collections.abc import Mapping

from magcomp import autopilots
from magcomp.mavlink.parameters import REAL32, ParamValue
from magcomp.writing import patience
from magcomp.writing.events import (
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
from magcomp.writing.exchange import Exchange, Timing
from magcomp.writing.fence import Fence
from magcomp.writing.files import format_value
from magcomp.writing.messages import (
    AskOwnNumber,
    Incoming,
    Outgoing,
    OwnNumber,
    ParamRefused,
    Pong,
    ReadName,
    SetValue,
)
from magcomp.writing.plan import WritePlan
from magcomp.writing.stages import (
    CLOSED,
    FENCED,
    NEXT,
    PINGING,
    REPEATED,
    WRITING,
    Target,
    expected,
    misfit,
)
from magcomp.writing.watch import VehicleWatch

_OWN_NUMBER = "AUTOPILOT_VERSION"
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
        See the table at the top of stages.py.
    outcome
        How it ended; None before.
    """

    def __init__(self, plan: WritePlan, *, now: float, timing: Timing | None = None) -> None:
        self._plan = plan
        self._timing = timing or Timing(storing=autopilots.of(plan.vehicle).storage_s)
        self._values: Mapping[str, float] = plan.new
        self._switches: Mapping[str, float] = plan.switches
        self._rolling_back: RollingBack | None = None
        self._events: list[Event] = []
        self._types: dict[str, int] = {}
        self._expected: Mapping[str, float] = {}
        self._exchange: Exchange[str] = Exchange((), self._timing)
        self._watch = VehicleWatch(now, self._timing)
        self._fence = Fence(now, self._timing)
        self._closing = False
        self._doubtful = False
        self._not_before = self._late_off = now
        self._first_asked: dict[str, float] = {}
        self._unconfirmed: dict[str, float] = {}
        self._refusals = 0
        self._restarts = 0
        self._touched = False
        self._switched_off = False
        self.outcome: Outcome | None = None
        self.stage = Stage.COMPARE
        self._begin_values()
        self._enter(Stage.COMPARE, now)

    @property
    def finished(self) -> bool:
        """Whether nothing more will happen."""
        return self.stage is Stage.OVER

    def handle(self, message: Incoming, now: float) -> None:
        """Take what the vehicle said."""
        if self.finished:
            return
        interruption = self._watch.hear(message, now, self._fence.round_trip)
        if isinstance(message, Pong):
            self._fence.hear(message, now)
        if self._watch.armed:
            self._end(Reason.ARMED, "the vehicle is armed")
        elif interruption:
            self._restart(Reason.LINK_LOST, interruption, now)
        elif isinstance(message, ParamValue):
            self._take_value(message, now)
        elif isinstance(message, ParamRefused) and self._exchange.differ(message.name):
            self._take_refusal(message, now)
        elif isinstance(message, OwnNumber):
            self._take_own_number(message.uid)

    def poll(self, now: float) -> tuple[list[Event], list[Outgoing]]:
        """Tell what has happened, then what is to be sent.

        Journals must have the events on the disk before the messages are sent.
        """
        self._check_patience(now)
        while not self.finished and self._is_complete(now):
            self._leave(now)
        if self.stage is Stage.WRITE and self._watch.silence(now) > self._timing.quiet:
            self._doubtful = True
            self._enter(Stage.OFF, now)
        outgoing = [] if self.finished else self._ask(now)
        if self.stage in PINGING:
            outgoing += self._fence.ask(now)
        events, self._events = self._events, []
        return events, outgoing

    def wake(self, now: float) -> float:
        """When to poll next, if nothing arrives before."""
        is_open, closed = bool(self._exchange.open), self._gate_closed(now)
        if self.stage in FENCED and (closed or not is_open):
            due = max(self._not_before, self._fence.wake(now))
        elif not is_open:
            due = self._leaves_at
        elif closed:
            due = now + _GATE
        else:
            due = self._exchange.wake(now)
        return min(max(due, now), self._watch.silent_from)

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
        self._fence.answered(now - self._first_asked.pop(name, now))
        if self.stage in WRITING:
            self._events.append(Written(name, wanted))
            self._not_before = max(self._not_before, now + self._timing.storing)
        if self.stage is Stage.WRITE:
            del self._unconfirmed[name]
        done, total = self._exchange.answered, self._exchange.total
        self._events.append(Progress(self.stage, name, done, total))

    def _take_refusal(self, message: ParamRefused, now: float) -> None:
        name = message.name
        if self._rolling_back is not None and name in self._unconfirmed:
            # What takes no write still holds its old value: VERIFY will tell.
            del self._unconfirmed[name]
            self._exchange.answer(name)
            return
        self._fail(Reason.REFUSED, f"{name} was not taken: {message.reason}", now)

    def _take_own_number(self, uid: str) -> None:
        wanted = self._plan.vehicle.uid
        if uid and wanted and uid != wanted:
            why = f"the flight controller must be {wanted}; instead it is {uid}"
            self._end(Reason.ANOTHER_VEHICLE, why)
        else:
            self._exchange.answer(_OWN_NUMBER)

    def _take_other_value(self, name: str, value: float, now: float) -> None:
        count = self._exchange.differ(name)
        if count == 0:
            return
        if self.stage not in WRITING:
            if count >= patience.BELIEVED_READS:
                self._believe(name, value, now)
            return
        if self.stage is not Stage.ON:
            if count >= patience.BELIEVED_ECHOES:
                self._believe(name, value, now)
        elif self._exchange.attempts(name) > 1:
            self._refusals += 1
            if self._refusals >= patience.BELIEVED_REFUSALS:
                self._believe(name, value, now)
            else:
                # The one write was lost: the values first, then the switch again.
                self._enter(Stage.VERIFY, now)

    def _believe(self, name: str, value: float, now: float) -> None:
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
        elif self.stage in WRITING:
            self._fail(Reason.MISMATCH, why, now)
        else:
            self._restart(Reason.MISMATCH, why, now)

    def _check_patience(self, now: float) -> None:
        if self.finished:
            return
        gated = self._gate_closed(now)
        waiting = patience.Waiting(self.stage, self._watch, self._exchange, self._fence, gated)
        if (reason := patience.ran_out(waiting, self._timing, now)) is not None:
            self._fail(*reason, now)

    def _enter(self, stage: Stage, now: float) -> None:
        target = Target(self._values, self._switches, self._unconfirmed)
        self.stage = stage
        self._expected = expected(stage, self._plan, target)
        asked = [*self._expected]
        if self._plan.vehicle.uid and stage in {Stage.COMPARE, Stage.IDENTIFY}:
            asked.append(_OWN_NUMBER)
        self._exchange = Exchange(asked, self._timing)
        self._first_asked.clear()
        self._closing = False
        if stage is Stage.SETTLE:
            self._begin_values()
            self._doubtful = True
            self._not_before = now + self._fence.quiet
        if stage in FENCED:
            self._fence.up(now)
        if stage in WRITING and self._expected:
            self._events.append(Intends(stage, dict(self._expected)))

    def _begin_values(self) -> None:
        self._unconfirmed = dict(self._values)
        self._refusals = 0

    @property
    def _leaves_at(self) -> float:
        """When the stage may end; WRITE not before the last copy of an OFF has come."""
        late = self._late_off if self.stage is Stage.WRITE else self._not_before
        return max(self._not_before, late)

    def _is_complete(self, now: float) -> bool:
        if self._exchange.open or now < self._leaves_at:
            return False
        if self.stage in CLOSED and not self._closing:
            self._closing = True
            self._fence.up(now)
        return self.stage not in FENCED or self._fence.passed(now, doubtful=self._doubtful)

    def _leave(self, now: float) -> None:
        if self.stage is Stage.COMPARE and not self._all_fit():
            return
        if self.stage is Stage.CONFIRM:
            self._complete()
            return
        if self.stage in FENCED:
            self._doubtful = False
        self._switched_off = self.stage in REPEATED
        self._enter(NEXT[self.stage], now)

    def _all_fit(self) -> bool:
        why = misfit({**self._values, **self._switches}, self._types)
        if why:
            self._end(Reason.REFUSED, why)
        return not why

    def _ask(self, now: float) -> list[Outgoing]:
        if self._gate_closed(now):
            return []
        outgoing: list[Outgoing] = []
        for name, attempt in self._exchange.ask(now):
            if name == _OWN_NUMBER:
                outgoing.append(AskOwnNumber())
                continue
            again = attempt > 1
            self._doubtful = self._doubtful or again
            self._first_asked.setdefault(name, now)
            if again and self.stage is Stage.OFF:
                self._late_off = now + self._fence.quiet
            if self.stage in REPEATED or (self.stage is Stage.ON and not again):
                self._touched = True
                kind = self._types.get(name, REAL32)
                outgoing.append(SetValue(name, self._expected[name], kind))
            if self.stage not in WRITING or again:
                outgoing.append(ReadName(name))
        return outgoing

    def _gate_closed(self, now: float) -> bool:
        """Whether a write waits for a heartbeat that says disarmed, or a read for its fence."""
        if self.stage in CLOSED and not self._closing:
            passed = self._fence.passed(now, doubtful=self._doubtful)
            return now < self._not_before or not passed
        return self.stage in WRITING and not self._watch.is_known_disarmed(now)

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
        self._watch.renew(now)
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
