"""A guided sweep on the ground, as a machine of messages, keys and time. No I/O, no clock.

The table ``_TABLE`` at the end of this file is the machine: what each stage sends, when it may be
left, for which stage, and what becomes of it where that takes too long. ``watch._OBJECTIONS`` is
what stops it at once, in whatever stage.

Rules
-----
1. Nothing spins before the vehicle's name was typed.
2. Each command has a time-out of ``Limits.timeout_s``: where nothing more arrives, by whatever
   cause, the autopilot itself stops the motors that much after the last command it got.
3. A step begins only when a heartbeat since all motors stood still says disarmed.
4. A key, an interruption, a lost link, an armed, flying, tilted or moved vehicle, a refusal and
   silence stop: from that moment on nothing is sent but the command to stand still.
5. That command is sent several times, and until it is answered, or until the time-out of the last
   command has passed, which ends the motors without it.
6. Of commands that come together a firmware may heed the last only, so one is sent at a time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from magcomp.autopilots.motor_test import Command, MotorTest
from magcomp.sweeping.events import Begun, Event, Outcome, Reason, Stage, Stopping, Told
from magcomp.sweeping.messages import Answer, Incoming, Said
from magcomp.sweeping.steps import ENOUGH_EACH, Measured, Step, next_step, require_possible
from magcomp.sweeping.watch import CurrentMean, Limits, StillWatch

_Failure = tuple[Reason, str] | None

_STOPS_SENT = 3
_STOP_EVERY_S = 0.1


class SweepSequence:
    """Spins motors step by step; see the top of the file.

    Parameters
    ----------
    name
        What has to be typed before anything spins.
    motor_test
        How the firmware is told to.
    motors, most
        Number of motors, and share of the outputs' range of the strongest step.
    now
        The time, in seconds from anywhere.
    each
        How well each motor's slope is to be known, mGauss/A.
    limits
        Lengths of time, and what is borne.

    Attributes
    ----------
    stage
        See ``_TABLE``.
    outcome
        How it ended; None before.

    Raises
    ------
    UsageError
        Motors or share are out of bounds.
    """

    def __init__(
        self,
        name: str,
        motor_test: MotorTest,
        motors: int,
        most: float,
        *,
        now: float,
        each: float = ENOUGH_EACH,
        limits: Limits | None = None,
    ) -> None:
        require_possible(motors, most)
        self._name = name
        self._test = motor_test
        self._motors, self._most, self._each = motors, most, each
        self._limits = limits or Limits()
        self._watch = StillWatch(self._limits)
        self._resting, self._drawing = CurrentMean(), CurrentMean()
        self._rest_a = math.inf
        self._events: list[Event] = []
        self._done: list[Measured] = []
        self._step: Step | None = None
        self._confirmed = False
        self._ending: Stopping | None = None
        self._heard_text = ""
        self._since = now
        self._next_at = now
        self._turn = 0
        # Rounds of stops sent, single stops, and answers still to come of a step's commands.
        self._rounds = self._stops = self._owed = 0
        self._answered = False
        self._last_spin = -math.inf
        self.stage = Stage.CONFIRM
        self.outcome: Outcome | None = None

    @property
    def finished(self) -> bool:
        """Whether nothing more will happen."""
        return self.stage is Stage.OVER

    def confirm(self, typed: str) -> bool:
        """Take what was typed; whether it is the vehicle's name."""
        self._confirmed = self._confirmed or typed.strip().lower() == self._name.lower()
        return self._confirmed

    def handle(self, message: Incoming, now: float) -> None:
        """Take what the vehicle said."""
        if self.finished:
            return
        self._watch.hear(message, now)
        match message:
            case Answer(number, refusal) if number == self._test.number:
                self._take_answer(refusal, now)
            case Said(text):
                self._heard_text = text
            case _:
                self._measure(message, now)
        self._look(now)

    def poll(self, now: float) -> tuple[list[Event], list[Command]]:
        """Tell what has happened, then what is to be sent."""
        self._look(now)
        while not self.finished:
            row = _TABLE[self.stage]
            if row.leaves(self, now):
                self._enter(row.then(self), now)
                continue
            failure = row.fails(self, now)
            if failure is None or self._ending is not None:
                break
            self._stop(*failure, now)
        outgoing = [] if self.finished else _TABLE[self.stage].sends(self, now)
        events, self._events = self._events, []
        return events, outgoing

    def wake(self, now: float) -> float:
        """When to poll next, if nothing arrives before."""
        return min(max(self._next_at, now), now + _STOP_EVERY_S)

    def stop(self, reason: Reason, now: float, why: str = "") -> None:
        """End because the user asks, or must."""
        self._stop(reason, why or reason.value, now)

    # ---------------------------------------------------------------- what stops it

    def _look(self, now: float) -> None:
        if self.finished or self._ending is not None:
            return
        objection = self._watch.objection(now, spinning=self.stage is Stage.SPIN)
        if objection is not None:
            self._stop(*objection, now)

    def _stop(self, reason: Reason, why: str, now: float) -> None:
        if self.finished or self._ending is not None:
            return
        self._ending = Stopping(reason, why)
        self._events.append(self._ending)
        if self.stage is Stage.SPIN:
            self._enter(Stage.HALT, now)
        elif self.stage is not Stage.HALT:
            # No motor was told to spin since all stood still: there is nothing to send.
            self._enter(Stage.OVER, now)

    def _take_answer(self, refusal: str, now: float) -> None:
        self._owed = max(self._owed - 1, 0)
        self._answered = self._answered or self.stage is Stage.SPIN or self._owed < self._stops
        if refusal and self.stage is Stage.SPIN:
            said = f" ({self._heard_text})" if self._heard_text else ""
            why = f"the vehicle refused to spin a motor: {refusal}{said}; {self._test.refused_hint}"
            self._stop(Reason.REFUSED, why, now)

    # ---------------------------------------------------------------- stages

    def _enter(self, stage: Stage, now: float) -> None:
        self._tell_step(stage)
        self.stage, self._since, self._next_at = stage, now, now
        self._answered = False
        match stage:
            case Stage.REST:
                self._resting.begin()
            case Stage.SPIN:
                self._begin_step()
            case Stage.HALT:
                self._rounds = self._stops = 0
            case Stage.OVER:
                ending = self._ending
                done = tuple(self._done)
                self.outcome = (
                    Outcome(done) if ending is None else Outcome(done, ending.reason, ending.why)
                )
                self._events.append(self.outcome)
            case _:
                pass

    def _following(self) -> Step | None:
        return next_step(self._done, self._motors, self._most, self._each)

    def _begin_step(self) -> None:
        self._step = self._following()
        self._turn = self._owed = 0
        self._heard_text = ""
        self._drawing.begin()
        self._watch.begin_step()
        if self._step is not None:
            self._events.append(Begun(self._step, len(self._done) + 1))

    def _tell_step(self, entered: Stage) -> None:
        """Note what a step drew, where it was carried out whole."""
        if self.stage is not Stage.SPIN or entered is not Stage.HALT or self._ending is not None:
            return
        drawn = self._drawing.amperes
        if self._resting.amperes is not None:
            # A monitor that smooths still tells the step before; the least it told is the truest.
            self._rest_a = min(self._rest_a, self._resting.amperes)
        if drawn is None or self._step is None:
            why = "the vehicle must tell its battery's current; instead none came during a step"
            self._ending = Stopping(Reason.NO_CURRENT, why)
            self._events.append(self._ending)
            return
        rest = self._rest_a if math.isfinite(self._rest_a) else 0.0
        measured = Measured(self._step, drawn - rest)
        self._done.append(measured)
        self._events.append(Told(measured))

    def _measure(self, message: Incoming, now: float) -> None:
        if self.stage is Stage.REST:
            self._resting.hear(message)
        elif self.stage is Stage.SPIN and now - self._since > self._limits.settle_s:
            self._drawing.hear(message)

    # ---------------------------------------------------------------- rows of the table

    def _sends_nothing(self, now: float) -> list[Command]:
        self._next_at = now + _STOP_EVERY_S
        return []

    def _sends_spin(self, now: float) -> list[Command]:
        if now < self._next_at or self._step is None:
            return []
        motors = self._step.motors
        motor = motors[self._turn % len(motors)]
        self._turn += 1
        self._next_at = now + self._limits.repeat_s / len(motors)
        self._owed += 1
        self._last_spin = now
        ends = now + self._limits.timeout_s + self._limits.armed_after_s
        if self._test.looks_armed:
            self._watch.expect_armed(ends)
        return [self._test.spin(motor, self._step.share, self._limits.timeout_s)]

    def _sends_stop(self, now: float) -> list[Command]:
        if now < self._next_at:
            return []
        commands = list(self._test.stop(() if self._step is None else self._step.motors))
        self._rounds += 1
        self._stops += len(commands)
        self._owed += len(commands)
        self._next_at = now + _STOP_EVERY_S
        return commands

    def _is_confirmed(self, now: float) -> bool:  # noqa: ARG002
        return self._confirmed

    def _is_rested(self, now: float) -> bool:
        rested = now - self._since >= self._limits.rest_s
        return rested and self._watch.is_ready(self._since, now)

    def _is_held(self, now: float) -> bool:
        return now - self._since >= self._limits.hold_s

    def _stands_still(self, now: float) -> bool:
        told = self._rounds >= _STOPS_SENT and self._answered
        return told or now - self._last_spin > self._limits.timeout_s + _STOP_EVERY_S

    def _after_confirm(self) -> Stage:
        return Stage.REST

    def _after_rest(self) -> Stage:
        return Stage.OVER if self._following() is None else Stage.SPIN

    def _after_spin(self) -> Stage:
        return Stage.HALT

    def _after_halt(self) -> Stage:
        return Stage.REST if self._ending is None else Stage.OVER

    def _never_fails(self, now: float) -> _Failure:  # noqa: ARG002
        return None

    def _is_not_ready(self, now: float) -> _Failure:
        limit = self._limits.ready_s
        if now - self._since <= limit:
            return None
        why = f"the vehicle must say within {limit:g} s that it is disarmed, and how it stands"
        return Reason.LINK_LOST, why

    def _is_unanswered(self, now: float) -> _Failure:
        if self._answered or now - self._since <= self._limits.answer_s:
            return None
        return Reason.UNANSWERED, "the vehicle did not answer the command to spin a motor"


class _Row(NamedTuple):
    """One stage of the table.

    Attributes
    ----------
    sends
        What is due now.
    leaves
        Whether it may be left.
    then
        For which stage.
    fails
        Why everything stops here, where it does.
    """

    sends: Callable[[SweepSequence, float], list[Command]]
    leaves: Callable[[SweepSequence, float], bool]
    then: Callable[[SweepSequence], Stage]
    fails: Callable[[SweepSequence, float], _Failure]


_S = SweepSequence
_TABLE: Mapping[Stage, _Row] = {
    #                    sends              until             then for           unless
    Stage.CONFIRM: _Row(_S._sends_nothing, _S._is_confirmed, _S._after_confirm, _S._never_fails),
    Stage.REST: _Row(_S._sends_nothing, _S._is_rested, _S._after_rest, _S._is_not_ready),
    Stage.SPIN: _Row(_S._sends_spin, _S._is_held, _S._after_spin, _S._is_unanswered),
    Stage.HALT: _Row(_S._sends_stop, _S._stands_still, _S._after_halt, _S._never_fails),
}
"""OVER sends nothing and is left no more."""
