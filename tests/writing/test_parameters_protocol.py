"""The writing protocol: what it sends, what it believes, when it stops."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from effort import examples
from fake_autopilot import (
    DEVICES,
    INT8,
    NEW,
    OLD,
    QUAD,
    SYSTEM,
    UID,
    WANTED,
    FakeAutopilot,
    FakeLink,
    Network,
    VirtualClock,
    sign,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.errors import (
    LinkError,
    LinkTimeoutError,
    OutputError,
    VehicleRefusedError,
    WriteError,
)
from magcomp.mavlink.parameters import ParamValue
from magcomp.writing.events import (
    Event,
    Intends,
    Mismatch,
    Outcome,
    Reason,
    Restarted,
    RollingBack,
    Stage,
    Standing,
    Written,
)
from magcomp.writing.messages import (
    AskOwnNumber,
    BootTime,
    Heard,
    Heartbeat,
    OwnNumber,
    ParamRefused,
    Ping,
    Pong,
    SetValue,
)
from magcomp.writing.plan import WritePlan, plan
from magcomp.writing.protocol import WriteSequence
from magcomp.writing.writer import raise_for_failure, read_current, write


class Rig:
    """A fake autopilot, its link, and the plan to write NEW over OLD."""

    def __init__(self, folder: Path, network: Network | None = None) -> None:
        self.autopilot = FakeAutopilot(OLD)
        self.clock = VirtualClock()
        self.link = FakeLink(self.autopilot, self.clock, network)
        self.backup = folder / "backup.param"
        self.events: list[Event] = []
        self.plan = plan(read_current(self.link, QUAD, WANTED, clock=self.clock), WANTED, QUAD)
        self.autopilot.writes.clear()

    def write(self, **options: Any) -> Outcome:
        return write(
            self.plan,
            self.link,
            backup=self.backup,
            clock=self.clock,
            on_event=self.events.append,
            **options,
        )

    def of(self, kind: type) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    return Rig(tmp_path)


def test_the_switch_goes_off_first_and_on_last(rig: Rig) -> None:
    assert rig.write().good
    writes = rig.autopilot.writes
    assert writes[0] == ("COMPASS_MOTCT", 0.0)
    assert writes[-1] == ("COMPASS_MOTCT", NEW["COMPASS_MOTCT"])
    assert [event.stage for event in rig.of(Intends)] == [Stage.OFF, Stage.WRITE, Stage.ON]
    assert {event.name for event in rig.of(Written)} == set(NEW)


def test_only_what_differs_is_written(rig: Rig) -> None:
    wanted = {**OLD, "COMPASS_MOT_X": 5.5, "COMPASS_MOT_Y": OLD["COMPASS_MOT_Y"]}
    rig.plan = plan(rig.autopilot.values, WANTED.__class__(wanted, QUAD), QUAD)
    assert rig.write().good
    assert rig.autopilot.writes == [
        ("COMPASS_MOTCT", 0.0),
        ("COMPASS_MOT_X", 5.5),
        ("COMPASS_MOTCT", 2.0),
    ]


def test_nothing_to_change_touches_neither_vehicle_nor_disk(rig: Rig) -> None:
    rig.plan = plan(OLD, WANTED.__class__(OLD, QUAD), QUAD)
    assert rig.write() == Outcome(Standing.NEW)
    assert rig.autopilot.writes == []
    assert not rig.backup.exists()


def test_an_armed_vehicle_is_not_touched(rig: Rig) -> None:
    rig.autopilot.armed = True
    outcome = rig.write()
    assert (outcome.reason, outcome.standing) == (Reason.ARMED, Standing.OLD)
    assert rig.autopilot.writes == []
    with pytest.raises(VehicleRefusedError, match=r"the vehicle is armed; .* as before"):
        raise_for_failure(outcome, rig.backup)


def test_nothing_is_written_before_a_heartbeat_says_disarmed(rig: Rig) -> None:
    rig.autopilot.heartbeat = lambda: mavlink.MAVLink_vfr_hud_message(0, 0, 0, 0, 0, 0)
    outcome = rig.write()
    assert outcome.reason is Reason.LINK_LOST
    assert "no heartbeat" in outcome.why
    assert rig.autopilot.writes == []


def test_a_read_only_parameter_rolls_everything_back(rig: Rig) -> None:
    rig.autopilot.read_only = frozenset({"COMPASS_MOT2_Y"})
    outcome = rig.write()
    assert (outcome.reason, outcome.standing) == (Reason.REFUSED, Standing.OLD)
    assert outcome.why == "COMPASS_MOT2_Y was not taken: it is read-only"
    assert rig.autopilot.calibration() == OLD
    with pytest.raises(WriteError, match="COMPASS_MOT2_Y was not taken"):
        raise_for_failure(outcome, rig.backup)


def test_a_read_only_parameter_is_found_out_without_words(rig: Rig) -> None:
    rig.autopilot.read_only = frozenset({"COMPASS_MOT2_Y"})
    rig.autopilot.denies_in_words = False
    outcome = rig.write()
    assert (outcome.reason, outcome.standing) == (Reason.MISMATCH, Standing.OLD)
    old, new = OLD["COMPASS_MOT2_Y"], NEW["COMPASS_MOT2_Y"]
    assert rig.of(Mismatch) == [Mismatch("COMPASS_MOT2_Y", new, old)]
    assert rig.autopilot.calibration() == OLD


def test_a_switch_that_cannot_be_turned_on_rolls_everything_back(rig: Rig) -> None:
    take = rig.autopilot._set

    def refuse(name: str, value: float, now: float) -> list[Any]:
        if (name, value) == ("COMPASS_MOTCT", NEW["COMPASS_MOTCT"]):
            return [rig.autopilot._value(name)]
        return take(name, value, now)

    rig.autopilot._set = refuse
    outcome = rig.write()
    assert (outcome.reason, outcome.standing) == (Reason.MISMATCH, Standing.OLD)
    assert rig.autopilot.calibration() == OLD


def test_a_param_error_is_used_where_it_comes(rig: Rig) -> None:
    rig.autopilot.read_only = frozenset({"COMPASS_MOT2_Y"})
    rig.autopilot.denies_in_words = False
    rig.autopilot.reports_errors = True
    outcome = rig.write()
    assert (outcome.reason, outcome.standing) == (Reason.REFUSED, Standing.OLD)


def test_a_parameter_that_vanished_is_a_timeout_and_rolled_back(rig: Rig) -> None:
    take = rig.autopilot._set

    def vanish(name: str, value: float, now: float) -> list[Any]:
        return [] if name == "COMPASS_MOT2_Y" else take(name, value, now)

    rig.autopilot._set = vanish
    answer = rig.autopilot.answer
    gone = False

    def silent(message: Any, now: float) -> list[Any]:
        nonlocal gone
        gone = gone or message.get_type() == "PARAM_SET"
        if gone and getattr(message, "param_id", "") == "COMPASS_MOT2_Y":
            return []
        return answer(message, now)

    rig.autopilot.answer = silent
    outcome = rig.write()
    assert outcome.reason is Reason.TIMEOUT
    assert outcome.standing is Standing.OFF
    assert "COMPASS_MOT2_Y was not confirmed in 25 attempts" in outcome.why
    assert "the roll-back failed as well" in outcome.why
    assert rig.autopilot.calibration()["COMPASS_MOTCT"] == 0
    with pytest.raises(LinkTimeoutError, match=r"magcomp restore .*backup\.param udp:"):
        raise_for_failure(outcome, rig.backup, "udp:127.0.0.1:14550")


def test_a_write_that_is_not_echoed_is_decided_by_reading(rig: Rig) -> None:
    take = rig.autopilot._set
    rig.autopilot._set = lambda *write: take(*write)[:0]
    assert rig.write().good
    assert rig.autopilot.calibration() == NEW


def test_a_vehicle_that_does_not_echo_unchanged_values_is_rolled_back_too(rig: Rig) -> None:
    rig.autopilot.quiet_when_unchanged = True
    rig.autopilot.read_only = frozenset({"COMPASS_MOT3_Z"})
    assert rig.write().standing is Standing.OLD
    assert rig.autopilot.calibration() == OLD


def test_a_vehicle_that_changed_since_the_backup_is_not_touched(rig: Rig) -> None:
    rig.autopilot.values["COMPASS_OFS_X"] = 1.5
    outcome = rig.write()
    assert (outcome.reason, outcome.standing) == (Reason.CHANGED, Standing.OLD)
    assert "COMPASS_OFS_X must read back as 100.51; instead received 1.5" in outcome.why
    assert rig.autopilot.writes == []


def test_another_vehicle_after_a_gap_gets_no_write(rig: Rig) -> None:
    def swap(number: int) -> None:
        if len(rig.autopilot.writes) == 10 and rig.autopilot.values["COMPASS_DEV_ID"] != 5:
            rig.autopilot.reboot(rig.clock.now)
            rig.autopilot.values.update(OLD, COMPASS_DEV_ID=5.0)
            rig.autopilot.writes.clear()

    rig.link.before_message = swap
    outcome = rig.write()
    assert outcome.reason is Reason.ANOTHER_VEHICLE
    assert f"COMPASS_DEV_ID must read back as {DEVICES[0]}; instead received 5" in outcome.why
    # Before the reboot showed, the switch may have been confirmed off once more, nothing else.
    assert set(rig.autopilot.writes) <= {("COMPASS_MOTCT", 0.0)} | set(NEW.items())


def test_a_twin_that_takes_the_vehicles_place_gets_no_write(rig: Rig) -> None:
    """Everything is alike but the flight controller's own number."""

    def swap(number: int) -> None:
        if len(rig.autopilot.writes) == 10 and rig.autopilot.uid == UID:
            rig.autopilot.reboot(rig.clock.now)
            rig.autopilot.uid = UID[::-1]
            rig.autopilot.values.update(OLD)
            rig.autopilot.writes.clear()

    rig.link.before_message = swap
    outcome = rig.write()
    assert outcome.reason is Reason.ANOTHER_VEHICLE
    assert f"must be {UID.hex()}; instead it is {UID[::-1].hex()}" in outcome.why
    assert set(rig.autopilot.writes) <= {("COMPASS_MOTCT", 0.0)} | set(NEW.items())


def test_a_twin_that_was_exchanged_before_the_write_is_not_touched(rig: Rig) -> None:
    rig.autopilot.uid = UID[::-1]
    outcome = rig.write()
    assert (outcome.reason, outcome.standing) == (Reason.ANOTHER_VEHICLE, Standing.OLD)
    assert rig.autopilot.writes == []


def test_a_reboot_verifies_everything_anew(rig: Rig) -> None:
    def reboot(number: int) -> None:
        if len(rig.autopilot.writes) == 20 and not rig.autopilot.booted_at:
            rig.autopilot.reboot(rig.clock.now)

    rig.link.before_message = reboot
    assert rig.write().good
    assert any("rebooted" in event.why for event in rig.of(Restarted))
    assert rig.autopilot.calibration() == NEW


def test_other_systems_are_ignored(rig: Rig) -> None:
    rig.link.strangers = [
        sign(mavlink.MAVLink_heartbeat_message(2, 3, 128, 0, 4, 3), SYSTEM + 1, 1),
        sign(mavlink.MAVLink_heartbeat_message(6, 8, 128, 0, 4, 3), SYSTEM, 190),
        sign(
            mavlink.MAVLink_param_value_message(b"COMPASS_MOTCT", 7.0, INT8, 9, 65535),
            SYSTEM + 1,
            1,
        ),
    ]
    assert rig.write().good


def test_a_request_to_stop_rolls_back(rig: Rig) -> None:
    outcome = rig.write(stop=lambda: len(rig.autopilot.writes) > 5)
    assert (outcome.reason, outcome.standing) == (Reason.STOPPED, Standing.OLD)
    assert rig.of(RollingBack) == [RollingBack(Reason.STOPPED, "it was interrupted")]
    assert rig.autopilot.calibration() == OLD


def test_a_second_ctrl_c_gives_up_at_once(rig: Rig) -> None:
    def interrupt(number: int) -> None:
        if rig.autopilot.writes:
            raise KeyboardInterrupt

    rig.link.before_message = interrupt
    with pytest.raises(KeyboardInterrupt):
        rig.write()
    assert rig.autopilot.calibration()["COMPASS_MOTCT"] == 0


def test_a_lost_link_says_what_may_stand(rig: Rig) -> None:
    def cut(number: int) -> None:
        rig.link.dead = rig.link.dead or rig.autopilot.values["COMPASS_MOTCT"] == 0

    rig.link.before_message = cut
    outcome = rig.write()
    assert (outcome.reason, outcome.standing) == (Reason.LINK_LOST, Standing.UNSURE)
    with pytest.raises(LinkError, match=r"(?s)nothing was heard for 10 s.*\n  magcomp restore"):
        raise_for_failure(outcome, rig.backup)


def test_a_backup_that_exists_is_kept_and_nothing_written(rig: Rig) -> None:
    rig.backup.write_text("mine")
    with pytest.raises(OutputError, match="must not exist yet"):
        rig.write()
    assert rig.autopilot.writes == []


def test_a_journal_that_cannot_be_written_rolls_back(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: object, events: list[Event]) -> None:
        if any(isinstance(e, Intends) and e.stage is Stage.ON for e in events):
            raise OutputError("the disk is full")

    monkeypatch.setattr("magcomp.writing.journal.Journal.record", full)
    outcome = rig.write()
    assert (outcome.reason, outcome.standing) == (Reason.JOURNAL, Standing.OLD)
    assert rig.autopilot.calibration() == OLD


FAULTS = ("reboot", "lossy", "cut", "mend", "interrupt")


@settings(max_examples=examples(40), deadline=None)
@given(
    seed=st.integers(0, 2**32),
    loss=st.sampled_from([0.0, 0.1, 0.3]),
    faults=st.dictionaries(st.integers(0, 600), st.sampled_from(FAULTS), max_size=6),
)
def test_no_storm_of_faults_puts_half_a_calibration_in_force(
    tmp_path_factory: pytest.TempPathFactory, seed: int, loss: float, faults: dict[int, str]
) -> None:
    network = Network(loss, latency=0.02, jitter=0.05, seed=seed)
    rig = Rig(tmp_path_factory.mktemp("storm"), network)
    begin = rig.link.messages

    def strike(number: int) -> None:
        match faults.get(number - begin):
            case "reboot":
                rig.autopilot.reboot(rig.clock.now, stored=False)
            case "lossy":
                network.loss = 0.5
            case "cut":
                network.loss = 1.0
            case "mend":
                network.loss = 0.0
            case "interrupt":
                raise KeyboardInterrupt

    rig.link.before_message = strike
    try:
        outcome = rig.write()
    except KeyboardInterrupt:
        outcome = None
    rig.link.drain()
    for state in rig.autopilot.states:
        assert state["COMPASS_MOTCT"] == 0 or state in (OLD, NEW)
    if outcome is not None and outcome.standing in {Standing.OLD, Standing.NEW}:
        assert rig.autopilot.calibration() == (NEW if outcome.good else OLD)


plan_names = st.sampled_from([*list(NEW)[:4], "COMPASS_MOTCT", "COMPASS_DEV_ID", "OTHER"])
values = st.sampled_from([0.0, 1.0, 2.0, float("nan"), *list(NEW.values())[:4]]) | st.floats()
incoming = st.one_of(
    st.builds(ParamValue, plan_names, values, st.integers(0, 255)),
    st.builds(ParamRefused, plan_names | st.text(), st.text()),
    st.builds(Heartbeat, st.sampled_from([False, False, False, True])),
    st.builds(BootTime, st.floats(0, 5000)),
    st.builds(Pong, st.integers(0, 10**12), st.floats(0, 5000)),
    st.builds(OwnNumber, st.sampled_from(["", "0a0b", QUAD.uid])),
    st.just(Heard()),
)


def small_plan() -> WritePlan:
    names = [*list(NEW)[:4], "COMPASS_MOTCT"]
    return WritePlan(
        vehicle=QUAD,
        old={name: OLD[name] for name in names},
        new={name: NEW[name] for name in names[:-1]},
        switches={"COMPASS_MOTCT": 1.0},
        identity={"COMPASS_DEV_ID": 97539.0},
    )


class Driver:
    """Feeds a sequence and keeps what it writes."""

    def __init__(self) -> None:
        self.now = 0.0
        self.plan = small_plan()
        self.sequence = WriteSequence(self.plan, now=self.now)
        self.disarmed = False
        self.asked: list[Any] = []

    def step(self, message: Any, wait: float) -> None:
        self.now += wait
        if isinstance(message, Heartbeat):
            self.disarmed = not message.armed
        if message is not None:
            self.sequence.handle(message, self.now)
        _, self.asked = self.sequence.poll(self.now)
        allowed = {("COMPASS_MOTCT", 0.0), ("COMPASS_MOTCT", 1.0), ("COMPASS_MOTCT", 2.0)}
        allowed |= set(self.plan.new.items()) | set(self.plan.old.items())
        for sent in self.asked:
            if isinstance(sent, SetValue):
                assert (sent.name, sent.value) in allowed
                assert self.disarmed
        assert math.isfinite(self.sequence.wake(self.now))


@given(st.lists(st.tuples(incoming | st.none(), st.floats(0, 12)), max_size=60))
def test_arbitrary_messages_never_cause_a_write_outside_the_plan(
    steps: list[tuple[Any, float]],
) -> None:
    driver = Driver()
    for message, wait in steps:
        driver.step(message, wait)


@given(st.lists(st.tuples(incoming, st.booleans(), st.floats(0, 1)), max_size=80))
def test_not_even_with_a_vehicle_that_answers_now_and_then(
    steps: list[tuple[Any, bool, float]],
) -> None:
    """Reaches the deep stages: half of the questions are answered well."""
    driver = Driver()
    held = {**driver.plan.old, **driver.plan.identity}
    driver.step(Heartbeat(False), 0.0)
    for message, well, wait in steps:
        if not well:
            driver.step(message, wait)
            continue
        for sent in driver.asked:
            if isinstance(sent, SetValue):
                held[sent.name] = sent.value
            if isinstance(sent, Ping):
                driver.sequence.handle(Pong(sent.token, driver.now), driver.now)
            elif isinstance(sent, AskOwnNumber):
                driver.sequence.handle(OwnNumber(QUAD.uid), driver.now)
            else:
                driver.sequence.handle(ParamValue(sent.name, held[sent.name]), driver.now)
        driver.step(Heartbeat(False), wait)


def test_backup_and_intention_are_on_the_disk_before_the_first_write(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[str] = []
    names: dict[int, str] = {}

    def sync(descriptor: int) -> None:
        names[descriptor] = Path(f"/dev/fd/{descriptor}").resolve().name
        steps.append(names[descriptor])

    send = rig.link.send

    def watched(message: Any) -> None:
        steps.append(message.get_type())
        send(message)

    monkeypatch.setattr("os.fsync", sync)
    rig.link.send = watched
    assert rig.write().good
    before = steps[: steps.index("PARAM_SET")]
    assert before[0].startswith(".backup.param")
    assert before.count("backup.journal") == 2
    assert before[-1] == "backup.journal"
    assert steps.index("PARAM_REQUEST_READ") > before.index("backup.journal")
