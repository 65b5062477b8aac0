"""The numbered rules at the top of magcomp/writing/protocol.py: each alone, each at its moment.

A vehicle that answers everything well after a tenth of a second, except where a test takes an
answer away, changes it, or keeps it back.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from typing import Any

import pytest
from fake_autopilot import NEW, OLD, QUAD

from magcomp.mavlink.parameters import ParamValue
from magcomp.writing.events import Outcome, Reason, Restarted, RollingBack, Stage, Standing
from magcomp.writing.exchange import Timing
from magcomp.writing.messages import (
    AskOwnNumber,
    BootTime,
    Heard,
    Heartbeat,
    OwnNumber,
    ParamRefused,
    Ping,
    Pong,
    ReadName,
    SetValue,
)
from magcomp.writing.plan import WritePlan
from magcomp.writing.protocol import WriteSequence

SWITCH = "COMPASS_MOTCT"
NAMES = list(NEW)[:4]
A_VALUE = NAMES[2]
TIMING = Timing(storing=1.5, quiet=2.0)
STEP_S, ANSWER_S = 0.05, 0.1

PLAN = WritePlan(
    vehicle=QUAD,
    old={name: OLD[name] for name in (*NAMES, SWITCH)},
    new={name: NEW[name] for name in NAMES},
    switches={SWITCH: NEW[SWITCH]},
    identity={"COMPASS_DEV_ID": 97539.0},
)


class Dialogue:
    """A sequence and its vehicle, and all that was sent: when, in which stage, what."""

    def __init__(self, timing: Timing = TIMING) -> None:
        self.now = 0.0
        self.sequence = WriteSequence(PLAN, now=0.0, timing=timing)
        self.held = {**PLAN.old, **PLAN.identity}
        self.armed = False
        self.beats = True
        self.sent: list[tuple[float, Stage, Any]] = []
        self.events: list[Any] = []
        self.answering: Callable[[Any], list[Any]] = self.well
        self._coming: list[tuple[float, int, Any]] = []
        self._order = itertools.count()
        self._beat_at = 0.0

    def well(self, message: Any) -> list[Any]:
        """What a good vehicle answers."""
        match message:
            case Ping():
                return [Pong(message.token, 100.0 + self.now)]
            case AskOwnNumber():
                return [OwnNumber(QUAD.uid)]
            case SetValue():
                self.held[message.name] = message.value
        return [ParamValue(message.name, self.held[message.name])]

    def say(self, message: Any, after: float = 0.0) -> None:
        heapq.heappush(self._coming, (self.now + after, next(self._order), message))

    def run(self, seconds: float = 60.0, until: Callable[[], bool] = lambda: False) -> None:
        end = self.now + seconds
        while self.now < end and not self.sequence.finished and not until():
            self.now += STEP_S
            if self.beats and self.now >= self._beat_at:
                self._beat_at = self.now + 1.0
                self.sequence.handle(Heartbeat(self.armed), self.now)
            while self._coming and self._coming[0][0] <= self.now:
                self.sequence.handle(heapq.heappop(self._coming)[2], self.now)
            events, outgoing = self.sequence.poll(self.now)
            self.events += events
            for message in outgoing:
                self.sent.append((self.now, self.sequence.stage, message))
                for answer in self.answering(message):
                    self.say(answer, ANSWER_S)

    def to(self, stage: Stage) -> None:
        self.run(until=lambda: self.sequence.stage is stage)
        assert self.sequence.stage is stage

    def to_values(self) -> None:
        """Until the first value has been written."""
        self.run(until=lambda: bool(self.values()))

    def writes(self) -> list[tuple[float, str, float]]:
        return [(at, m.name, m.value) for at, _, m in self.sent if isinstance(m, SetValue)]

    def values(self) -> list[float]:
        """When values were written, the switch aside."""
        return [at for at, name, _ in self.writes() if name != SWITCH]

    def switched(self, value: float) -> list[float]:
        """When the switch was written."""
        return [at for at, name, written in self.writes() if (name, written) == (SWITCH, value)]

    def reads(self, stage: Stage) -> list[float]:
        return [at for at, of, m in self.sent if of is stage and isinstance(m, ReadName)]

    def of(self, kind: type) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]


@pytest.fixture
def dialogue() -> Dialogue:
    return Dialogue()


def without(dialogue: Dialogue, unheard: Callable[[Any], bool]) -> Callable[[Any], list[Any]]:
    """All answers but some."""
    return lambda message: [] if unheard(message) else dialogue.well(message)


def switches(message: Any) -> bool:
    return isinstance(message, SetValue) and message.name == SWITCH


def of_name(name: str) -> Callable[[Any], bool]:
    return lambda message: getattr(message, "name", "") == name


def test_a_good_vehicle_is_written(dialogue):
    dialogue.run()
    assert dialogue.sequence.outcome == Outcome(Standing.NEW)
    assert {name: dialogue.held[name] for name in NEW if name in dialogue.held} == {
        **PLAN.new,
        **PLAN.switches,
    }


def test_rule_1_values_change_only_after_the_switch_is_confirmed_off(dialogue):
    dialogue.answering = without(dialogue, switches)
    dialogue.run(6.0)
    assert len(dialogue.switched(0.0)) > 1
    assert not dialogue.values()
    dialogue.answering = dialogue.well
    dialogue.run()
    assert dialogue.sequence.outcome == Outcome(Standing.NEW)


def test_rule_1_the_switch_goes_on_only_after_each_value_is_confirmed(dialogue):
    dialogue.to(Stage.OFF)
    dialogue.answering = without(dialogue, of_name(A_VALUE))
    dialogue.run(8.0)
    assert len(dialogue.values()) > len(NAMES)
    assert not dialogue.switched(NEW[SWITCH])
    assert dialogue.sequence.stage is Stage.WRITE


def test_rule_2_without_a_heartbeat_nothing_is_written(dialogue):
    dialogue.beats = False
    dialogue.run(9.0)
    assert dialogue.reads(Stage.COMPARE)
    assert not dialogue.writes()


def test_rule_2_a_heartbeat_that_is_too_old_counts_no_more(dialogue):
    dialogue.to(Stage.OFF)
    dialogue.answering = without(dialogue, of_name(A_VALUE))
    dialogue.to_values()
    dialogue.beats, since = False, dialogue.now
    dialogue.run(8.0)
    last = max(dialogue.values())
    assert since < last <= since + TIMING.heartbeat_gap + STEP_S


def test_rule_2_an_armed_vehicle_gets_no_further_write(dialogue):
    dialogue.to(Stage.OFF)
    dialogue.answering = without(dialogue, of_name(A_VALUE))
    dialogue.to_values()
    dialogue.armed, written = True, len(dialogue.writes())
    dialogue.run()
    assert len(dialogue.writes()) == written
    assert dialogue.sequence.outcome.reason is Reason.ARMED
    assert dialogue.sequence.outcome.standing is Standing.OFF


def test_rule_3_an_echo_counts_that_holds_exactly_the_value_whatever_its_index(dialogue):
    dialogue.to(Stage.OFF)
    dialogue.answering = without(dialogue, of_name(A_VALUE))
    dialogue.to_values()
    dialogue.say(ParamValue(A_VALUE, NEW[A_VALUE] * (1 + 2**-22), index=65535))
    dialogue.run(6.0)
    assert dialogue.sequence.stage is Stage.WRITE
    dialogue.answering = dialogue.well
    dialogue.say(ParamValue(A_VALUE, NEW[A_VALUE], index=7))
    dialogue.to(Stage.VERIFY)


def test_rule_3_another_value_is_counted_not_believed_and_asked_for_by_writing_and_reading(
    dialogue,
):
    dialogue.to(Stage.OFF)
    stale = [ParamValue(A_VALUE, OLD[A_VALUE])]
    dialogue.answering = lambda m: stale if of_name(A_VALUE)(m) else dialogue.well(m)
    dialogue.to_values()
    dialogue.run(3.0)
    assert not dialogue.of(RollingBack)
    again = [type(m) for _, stage, m in dialogue.sent if stage is Stage.WRITE and m.name == A_VALUE]
    assert again[:3] == [SetValue, SetValue, ReadName]
    dialogue.answering = dialogue.well
    dialogue.run()
    assert dialogue.sequence.outcome == Outcome(Standing.NEW)


def test_rule_4_after_each_stage_that_writes_nothing_changes_until_it_is_stored(dialogue):
    dialogue.run()
    off, values, on = (
        max(dialogue.switched(0.0)),
        dialogue.values(),
        max(dialogue.switched(NEW[SWITCH])),
    )
    assert min(values) >= off + ANSWER_S + TIMING.storing
    assert on >= max(values) + ANSWER_S + TIMING.storing
    assert dialogue.now >= on + ANSWER_S + TIMING.storing


def test_rule_4_after_silence_the_switch_is_confirmed_off_before_any_value(dialogue):
    dialogue.to(Stage.OFF)
    dialogue.answering = without(dialogue, of_name(A_VALUE))
    dialogue.to_values()
    dialogue.beats, dialogue.answering = False, lambda _: []
    dialogue.run(TIMING.quiet + 1.0)
    silent_until = dialogue.now
    assert [at for at in dialogue.switched(0.0) if at > max(dialogue.values())]
    dialogue.beats, dialogue.answering = True, dialogue.well
    dialogue.run()
    confirmed = min(at for at in dialogue.switched(0.0) if at >= silent_until - 1.0) + ANSWER_S
    assert min(at for at in dialogue.values() if at > silent_until) > confirmed
    assert dialogue.sequence.outcome == Outcome(Standing.NEW)


def test_rule_4_the_switch_is_written_on_once_and_values_are_read_before_it_is_again(dialogue):
    """Its first write is lost: the vehicle is asked, and says 0."""
    dialogue.answering = without(dialogue, lambda m: switches(m) and m.value != 0.0)
    dialogue.run(until=lambda: len(dialogue.switched(NEW[SWITCH])) > 1)
    first, second = dialogue.switched(NEW[SWITCH])
    assert [at for at in dialogue.reads(Stage.VERIFY) if first < at < second]


@pytest.mark.parametrize("how", ["boot time goes back", "a gap in the heartbeat"])
def test_rule_5_after_what_may_be_a_reboot_identity_is_read_and_off_confirmed_anew(dialogue, how):
    dialogue.say(BootTime(100.0))
    dialogue.to(Stage.OFF)
    dialogue.answering = without(dialogue, of_name(A_VALUE))
    dialogue.to_values()
    if how == "boot time goes back":
        dialogue.say(BootTime(3.0))
    else:
        dialogue.beats = False
        for tenth in range(60):
            dialogue.say(Heard(), 0.1 * tenth)
        dialogue.run(TIMING.heartbeat_gap + 0.5)
        dialogue.beats = True
    dialogue.run(until=lambda: bool(dialogue.of(Restarted)))
    since = dialogue.now
    dialogue.answering = dialogue.well
    dialogue.run()
    identity = min(dialogue.reads(Stage.IDENTIFY))
    off = min(at for at in dialogue.switched(0.0) if at > since)
    value = min(at for at in dialogue.values() if at > since)
    assert since + TIMING.quiet <= identity < off < value
    assert dialogue.sequence.outcome == Outcome(Standing.NEW)


def test_rule_6_what_is_believed_is_asked_behind_a_fence_and_ends_with_another(dialogue):
    held_back: list[Any] = []

    def slow(message: Any) -> list[Any]:
        if isinstance(message, Ping) and dialogue.sequence.stage is Stage.VERIFY:
            held_back.extend(dialogue.well(message))
            return []
        return dialogue.well(message)

    dialogue.answering = slow
    dialogue.to(Stage.VERIFY)
    dialogue.run(2.0)
    assert not dialogue.reads(Stage.VERIFY)
    dialogue.say(held_back.pop(), ANSWER_S)
    dialogue.run(2.0)
    assert len(dialogue.reads(Stage.VERIFY)) == len(NAMES) + 1
    assert dialogue.sequence.stage is Stage.VERIFY
    dialogue.answering = dialogue.well
    dialogue.run()
    assert dialogue.sequence.outcome == Outcome(Standing.NEW)


@pytest.mark.parametrize("repeated", [False, True])
def test_rule_6_after_an_off_that_was_repeated_its_late_copy_is_waited_for(repeated):
    dialogue = Dialogue(Timing(storing=0.1))
    if repeated:
        dialogue.answering = without(dialogue, switches)
        dialogue.run(until=lambda: len(dialogue.switched(0.0)) > 1)
        dialogue.answering = dialogue.well
    dialogue.to(Stage.VERIFY)
    waited = dialogue.now - max(dialogue.switched(0.0))
    assert (waited >= Timing().quiet) is repeated


def test_rule_7_a_request_to_stop_rolls_back_and_a_second_one_changes_nothing(dialogue):
    dialogue.to_values()
    dialogue.sequence.stop(dialogue.now)
    dialogue.run(until=lambda: dialogue.sequence.stage is Stage.WRITE)
    dialogue.sequence.stop(dialogue.now)
    dialogue.run()
    assert len(dialogue.of(RollingBack)) == 1
    assert dialogue.sequence.outcome.standing is Standing.OLD
    assert {name: dialogue.held[name] for name in PLAN.old} == PLAN.old


def test_rule_7_a_roll_back_that_fails_leaves_the_switch_off(dialogue):
    dialogue.to(Stage.OFF)
    dialogue.answering = without(dialogue, of_name(A_VALUE))
    dialogue.to_values()
    dialogue.say(ParamRefused(A_VALUE, "it is read-only"))
    dialogue.run(200.0)
    assert len(dialogue.of(RollingBack)) == 1
    assert dialogue.sequence.outcome.standing is Standing.OFF
    assert dialogue.sequence.outcome.reason is Reason.REFUSED
    assert dialogue.held[SWITCH] == 0.0
