"""In whatever order messages, keys and time come, no motor runs longer than it may."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from sweep_bench import KNOWN, MOTOR_TEST

from magcomp import autopilots
from magcomp.autopilots.motor_test import Command, MotorTest
from magcomp.errors import UsageError
from magcomp.sweeping.events import Begun, Outcome, Reason, Stage, Stopping
from magcomp.sweeping.messages import (
    Answer,
    Attitude,
    Current,
    Heartbeat,
    Landed,
    Position,
    Said,
    decode,
    encode,
)
from magcomp.sweeping.protocol import SweepSequence
from magcomp.sweeping.watch import Limits
from magcomp.writing.messages import Peer

LIMITS = Limits()
FIRMWARES = [autopilots.named(key).motor_test for key in ("ardupilot", "px4")]


def timeout_of(command: Command) -> float:
    """Seconds that a command lets a motor spin."""
    return command.values[3] if command.number == 209 else command.values[1]


@dataclass
class Spy:
    """Plays the driver, and keeps account of what a vehicle would do with each command."""

    test: MotorTest
    machine: SweepSequence = field(init=False)
    now: float = 0.0
    confirmed: bool = False
    stopped: bool = False
    armed: bool = False
    heartbeat_at: float = -math.inf
    attitude_at: float = -math.inf
    stands_still_since: float = 0.0
    runs_until: float = -math.inf
    last_spin: float = -math.inf

    def __post_init__(self) -> None:
        self.machine = SweepSequence("copter-1", self.test, 4, 0.5, now=0.0)

    def hear(self, message) -> None:
        match message:
            case Heartbeat(armed):
                self.armed, self.heartbeat_at = armed, self.now
            case Attitude():
                self.attitude_at = self.now
            case _:
                pass
        self.machine.handle(message, self.now)
        self.poll()

    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.poll()

    def press(self, reason: Reason) -> None:
        self.machine.stop(reason, self.now)
        self.stopped = True
        self.poll()

    def type(self, text: str) -> None:
        self.confirmed = self.machine.confirm(text) or self.confirmed
        self.poll()

    def poll(self) -> None:
        events, commands = self.machine.poll(self.now)
        self.stopped = self.stopped or any(isinstance(e, Stopping | Outcome) for e in events)
        begun = any(isinstance(event, Begun) for event in events)
        if begun:
            assert not self.armed
            assert self.heartbeat_at >= self.stands_still_since
            assert self.now - self.attitude_at <= LIMITS.attitude_s
        for command in commands:
            if timeout_of(command) == 0.0:
                self.runs_until = min(self.runs_until, self.now)
                self.stands_still_since = self.now
                continue
            assert self.confirmed
            assert not self.stopped, "nothing spins after a stop"
            assert 0.0 < timeout_of(command) <= LIMITS.timeout_s
            assert self.now - self.heartbeat_at <= LIMITS.heartbeat_s
            assert self.now - self.attitude_at <= LIMITS.attitude_s
            self.last_spin = self.now
            self.runs_until = self.now + timeout_of(command)
        assert self.runs_until <= self.last_spin + LIMITS.timeout_s
        if self.stopped:
            assert self.runs_until <= self.now, "a stop goes out in the same turn"


def standing(now: float) -> Attitude:
    return Attitude(0.0, 0.0, 0.0, now)


def messages(number: int):
    return st.one_of(
        st.builds(Heartbeat, st.sampled_from([False, False, False, True])),
        st.builds(Attitude, st.just(0.0), st.just(0.0), st.just(0.0), st.floats(0, 100)),
        st.builds(
            Attitude, st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-9, 9), st.floats(0, 9)
        ),
        st.builds(Position, st.just(48.0), st.floats(10.9999, 11.0001), st.floats(-1, 1)),
        st.builds(Current, st.floats(0, 50)),
        st.builds(Landed, st.sampled_from([False, False, True])),
        st.builds(Answer, st.sampled_from([number, 511]), st.sampled_from(["", "", "", "failed"])),
        st.builds(Said, st.text(max_size=20)),
    )


def steps(number: int):
    """What befalls; much of it good, or no sweep would ever begin."""
    good = st.tuples(st.just("good"), st.floats(0.1, 1.5))
    return st.lists(
        st.one_of(
            good,
            good,
            good,
            st.tuples(st.just("hear"), messages(number)),
            st.tuples(st.just("wait"), st.floats(0.0, 4.0)),
            st.tuples(st.just("type"), st.sampled_from(["copter-1", "copter-2", ""])),
            st.tuples(st.just("press"), st.sampled_from([Reason.KEY, Reason.INTERRUPTED])),
        ),
        max_size=20,
    )


@pytest.mark.parametrize("test", FIRMWARES, ids=["do_motor_test", "actuator_test"])
@given(data=st.data())
@settings(max_examples=40, deadline=None)
def test_no_motor_runs_longer_than_its_time_out_and_none_after_a_stop(test, data):
    spy = Spy(test)
    begins_typed = data.draw(st.booleans())
    if begins_typed:
        spy.type("copter-1")
    for what, value in data.draw(steps(test.number)):
        match what:
            case "good":
                for _ in range(int(value / 0.1)):
                    spy.wait(0.1)
                    spy.hear(Heartbeat(False))
                    spy.hear(standing(spy.now))
                    spy.hear(Current(5.0))
                    spy.hear(Answer(test.number, ""))
            case "hear":
                spy.hear(value)
            case "wait":
                spy.wait(value)
            case "type":
                spy.type(value)
            case "press":
                spy.press(value)


@pytest.mark.parametrize("test", FIRMWARES, ids=["do_motor_test", "actuator_test"])
def test_a_good_sweep_goes_through(test):
    spy = Spy(test)
    spy.type("Copter-1 ")
    for _ in range(3000):
        spy.wait(0.1)
        spy.hear(Heartbeat(False))
        spy.hear(standing(spy.now))
        spy.hear(Current(10.0 if spy.machine.stage is Stage.SPIN else 1.0))
        spy.hear(Answer(test.number, ""))
    assert spy.machine.outcome is not None
    assert spy.machine.outcome.reason is None
    assert len(spy.machine.outcome.done) >= 10


def test_armed_by_the_test_itself_is_no_objection_where_the_firmware_says_so():
    for test, reason in zip(FIRMWARES, (None, Reason.ARMED), strict=True):
        spy = Spy(test)
        spy.type("copter-1")
        while spy.machine.stage is not Stage.SPIN:
            spy.wait(0.1)
            spy.hear(Heartbeat(False))
            spy.hear(standing(spy.now))
        spy.hear(Heartbeat(True))
        ending = spy.machine.outcome.reason if spy.machine.outcome else None
        stopping = spy.machine.stage is Stage.HALT
        assert stopping == (reason is not None)
        assert ending is None


def test_an_armed_heartbeat_long_after_the_last_command_is_not_the_tests():
    spy = Spy(MOTOR_TEST)
    spy.type("copter-1")
    while spy.machine.stage is not Stage.REST or spy.last_spin < 0.0:
        spy.wait(0.1)
        spy.hear(Heartbeat(spy.machine.stage is not Stage.REST))
        spy.hear(standing(spy.now))
        spy.hear(Current(5.0))
        spy.hear(Answer(209, ""))
    until = spy.last_spin + LIMITS.timeout_s + LIMITS.armed_after_s
    while spy.now < until - 0.2:
        spy.wait(0.1)
        spy.hear(Heartbeat(True))
        spy.hear(standing(spy.now))
        assert not spy.machine.finished
    spy.wait(0.4)
    spy.hear(Heartbeat(True))
    assert spy.machine.outcome.reason is Reason.ARMED


def test_a_refusal_says_what_the_vehicle_said():
    spy = Spy(MOTOR_TEST)
    spy.type("copter-1")
    while spy.machine.stage is not Stage.SPIN:
        spy.wait(0.1)
        spy.hear(Heartbeat(False))
        spy.hear(standing(spy.now))
    spy.hear(Said("Motor Test: Safety switch"))
    spy.hear(Answer(209, "it failed"))
    while not spy.machine.finished:
        spy.wait(0.1)
    assert spy.machine.outcome.reason is Reason.REFUSED
    assert "it failed (Motor Test: Safety switch)" in spy.machine.outcome.why
    assert "safety switch pressed" in spy.machine.outcome.why


@pytest.mark.parametrize(("motors", "most"), [(0, 0.5), (13, 0.5), (4, 0.05), (4, 0.95)])
def test_what_cannot_be_is_refused(motors, most):
    with pytest.raises(UsageError, match="must be"):
        SweepSequence("copter-1", MOTOR_TEST, motors, most, now=0.0)


# ---------------------------------------------------------------- MAVLink


PEER = Peer.of(KNOWN)


def heard(message, system=1, component=1):
    codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    return decode(mavlink.MAVLink(None).decode(bytearray(message.pack(codec))), PEER)


def test_messages_are_translated():
    assert heard(mavlink.MAVLink_heartbeat_message(2, 3, 0x80, 0, 4, 3)) == Heartbeat(True)
    attitude = mavlink.MAVLink_attitude_message(1500, 0.25, -0.5, 2.0, 0.0, 0.0, 0.125)
    assert heard(attitude) == Attitude(0.25, -0.5, 0.125, 1.5)
    ack = mavlink.MAVLink_command_ack_message(209, 4)
    assert heard(ack) == Answer(209, "it failed")
    assert heard(mavlink.MAVLink_extended_sys_state_message(0, 2)) == Landed(True)
    assert heard(mavlink.MAVLink_extended_sys_state_message(0, 1)) == Landed(False)
    assert heard(attitude, component=154) is None
    assert heard(attitude, system=2) is None


def test_a_command_travels_whole():
    sent = encode(MOTOR_TEST.spin(3, 0.5, 1.0), PEER)
    assert (sent.target_system, sent.target_component, sent.command) == (1, 1, 209)
    assert (sent.param1, sent.param2, sent.param3, sent.param4) == (3.0, 0.0, 50.0, 1.0)


@given(
    st.floats(-89, 89),
    st.floats(-180, 180),
    st.floats(-5, 5),
    st.floats(-5, 5),
    st.floats(-5, 5),
)
def test_a_distance_is_in_metres_everywhere(latitude, longitude, north, east, up):
    degree = 111_319.5
    moved = Position(
        latitude + north / degree,
        longitude + east / degree / math.cos(math.radians(latitude)),
        up,
    )
    wanted = math.hypot(north, east, up)
    assert Position(latitude, longitude, 0.0).distance(moved) == pytest.approx(wanted, abs=1e-3)
