"""What stands on the vehicle after a write, whatever happens on the way."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from fake_autopilot import (
    NEW,
    OLD,
    QUAD,
    SYSTEM,
    WANTED,
    FakeAutopilot,
    FakeLink,
    Network,
    VirtualClock,
    sign,
)
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.errors import LinkError, OutputError
from magcomp.writing.events import Outcome, Standing
from magcomp.writing.exchange import Timing
from magcomp.writing.files import read_parameter_file
from magcomp.writing.journal import read_journal
from magcomp.writing.plan import plan
from magcomp.writing.writer import read_current, write


class Killed(BaseException):
    """The program ends here, as by SIGKILL."""


def upload(link: FakeLink, backup: Path, wanted=WANTED, **options) -> Outcome:
    current = read_current(link, QUAD, wanted, clock=link.clock)
    return write(plan(current, wanted, QUAD), link, backup=backup, clock=link.clock, **options)


def restore(autopilot: FakeAutopilot, clock: VirtualClock, backup: Path) -> Outcome:
    clock.now += 10.0
    link = FakeLink(autopilot, clock)
    return upload(link, backup.with_name("second.param"), read_parameter_file(backup))


def assert_never_half_written(autopilot: FakeAutopilot) -> None:
    for state in autopilot.states:
        assert state["COMPASS_MOTCT"] == 0 or state in (OLD, NEW)


def test_a_good_link_adds_less_than_two_seconds_to_the_waits_for_storage(tmp_path: Path) -> None:
    autopilot, clock = FakeAutopilot(OLD), VirtualClock()
    link = FakeLink(autopilot, clock)
    current = read_current(link, QUAD, WANTED, clock=clock)
    begin = clock.now
    todo = plan(current, WANTED, QUAD)
    outcome = write(todo, link, backup=tmp_path / "b.param", clock=clock)
    assert outcome == Outcome(Standing.NEW)
    assert autopilot.calibration() == NEW
    assert len(todo.changes) == 37
    assert clock.now - begin < 3 * Timing().storing + 2.0
    assert_never_half_written(autopilot)


LOSSY = {"loss": 0.3, "latency": 0.2}


@pytest.mark.parametrize("seed", range(10))
def test_thirty_per_cent_loss_each_way_and_200_ms_latency_are_survived(
    tmp_path: Path, seed: int
) -> None:
    autopilot, clock = FakeAutopilot(OLD), VirtualClock()
    link = FakeLink(autopilot, clock, Network(**LOSSY, seed=seed))
    assert upload(link, tmp_path / "b.param") == Outcome(Standing.NEW)
    assert autopilot.calibration() == NEW
    assert_never_half_written(autopilot)


@pytest.mark.parametrize("seed", range(20))
def test_duplicates_and_reordering_never_mix_old_and_new(tmp_path: Path, seed: int) -> None:
    autopilot, clock = FakeAutopilot(OLD), VirtualClock()
    network = Network(0.2, 0.2, latency=0.02, jitter=0.5, seed=seed)
    link = FakeLink(autopilot, clock, network)
    assert upload(link, tmp_path / "b.param").good
    link.drain()
    assert autopilot.calibration() in (NEW, {**NEW, "COMPASS_MOTCT": 0.0})
    assert_never_half_written(autopilot)


def dies(link: FakeLink) -> None:
    link.dead = True


def is_pulled(link: FakeLink) -> None:
    link.broken = True
    link.dead = True


def reboots(link: FakeLink) -> None:
    link.autopilot.reboot(link.clock.now)


def reboots_before_the_newest_writes_are_stored(link: FakeLink) -> None:
    link.autopilot.reboot(link.clock.now, stored=False)


def is_killed(link: FakeLink) -> None:
    raise Killed


def is_killed_and_then_the_vehicle_reboots(link: FakeLink) -> None:
    link.reboots_at_the_end = True
    raise Killed


def a_stranger_confirms(link: FakeLink) -> None:
    """From now on another system says, all the time, that everything is as wanted."""
    link.strangers = [
        sign(mavlink.MAVLink_param_value_message(name.encode(), value, 9, 40, 65535), SYSTEM, 2)
        for name, value in NEW.items()
    ]
    link.dead = True


def is_interrupted(link: FakeLink) -> None:
    raise KeyboardInterrupt


def arms(link: FakeLink) -> None:
    link.autopilot.armed = True


FAULTS = [
    dies,
    is_pulled,
    reboots,
    reboots_before_the_newest_writes_are_stored,
    is_killed,
    is_killed_and_then_the_vehicle_reboots,
    a_stranger_confirms,
    is_interrupted,
    arms,
]


def messages_of_a_clean_write(folder: Path) -> int:
    link = FakeLink(FakeAutopilot(OLD), VirtualClock())
    current = read_current(link, QUAD, WANTED, clock=link.clock)
    before = link.messages
    write(plan(current, WANTED, QUAD), link, backup=folder / "clean.param", clock=link.clock)
    return link.messages - before


@pytest.mark.parametrize("step", [41, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_at_any_message_leaves_all_old_or_all_new_or_off_and_restorable(
    tmp_path: Path, fault: Callable[[FakeLink], None], step: int
) -> None:
    """The table of all cases: the fault comes just before message 0, 1, 2, ... of the write."""
    count = messages_of_a_clean_write(tmp_path)
    assert count > 2 * 3 * 37
    stood = {"old": 0, "new": 0, "off": 0}
    cases = range(FAULTS.index(fault) % step, count, step)
    for at in cases:
        folder = tmp_path / str(at)
        folder.mkdir()
        stood[stands_after(fault, at, folder)] += 1
    assert sum(stood.values()) == len(cases)


def stands_after(fault: Callable[[FakeLink], None], at: int, folder: Path) -> str:
    autopilot, clock = FakeAutopilot(OLD), VirtualClock()
    link = FakeLink(autopilot, clock)
    backup = folder / "b.param"
    current = read_current(link, QUAD, WANTED, clock=clock)
    begin = link.messages

    def strike(number: int) -> None:
        if number == begin + at:
            fault(link)

    link.before_message = strike
    outcome = None
    try:
        outcome = write(plan(current, WANTED, QUAD), link, backup=backup, clock=clock)
    except Killed:
        link.drain()
        if link.reboots_at_the_end:
            autopilot.reboot(clock.now, stored=False)
    autopilot.armed = False
    assert_never_half_written(autopilot)
    held = autopilot.calibration()
    journal = read_journal(backup)
    assert journal.outcome == outcome
    check_claim(journal.standing, held)
    if outcome is not None and outcome.good:
        assert held == NEW
        return "new"
    states = len(autopilot.states)
    assert restore(autopilot, clock, backup).good
    assert autopilot.calibration() == OLD
    for state in autopilot.states[states:]:
        assert state["COMPASS_MOTCT"] == 0 or state in (OLD, NEW)
    return "old" if held == OLD else "new" if held == NEW else "off"


LAST = 10_000


@pytest.mark.parametrize("at", [*range(0, 180, 30), LAST])
@pytest.mark.parametrize("kind", [OSError, ValueError, LinkError, OutputError])
def test_an_error_in_whoever_is_told_rolls_back_and_is_raised_again(
    tmp_path: Path, kind: type[Exception], at: int
) -> None:
    autopilot = FakeAutopilot(OLD)
    link, told = FakeLink(autopilot, VirtualClock()), 0

    def fail(event: object) -> None:
        nonlocal told
        told += 1
        if told > at or isinstance(event, Outcome):
            raise kind("the terminal is gone")

    with pytest.raises(kind, match="the terminal is gone") as raised:
        upload(link, tmp_path / "b.param", on_event=fail)
    assert told == at + 1 or at == LAST
    assert autopilot.calibration() in (OLD, NEW)
    journal = read_journal(tmp_path / "b.param")
    check_claim(journal.standing, autopilot.calibration())
    assert journal.standing in (Standing.OLD, Standing.NEW)
    assert f"the vehicle holds {journal.standing.value}" in str(raised.value.__notes__)
    assert_never_half_written(autopilot)


def test_an_error_in_whoever_is_asked_to_stop_rolls_back_too(tmp_path: Path) -> None:
    autopilot = FakeAutopilot(OLD)

    def stop() -> bool:
        if len(autopilot.writes) > 5:
            raise RuntimeError("no screen")
        return False

    with pytest.raises(RuntimeError, match="no screen"):
        upload(FakeLink(autopilot, VirtualClock()), tmp_path / "b.param", stop=stop)
    assert autopilot.calibration() == OLD


@pytest.mark.parametrize("seed", range(6))
def test_replies_five_seconds_late_are_no_confirmation_of_what_came_later(
    tmp_path: Path, seed: int
) -> None:
    autopilot, clock = FakeAutopilot(OLD), VirtualClock()
    link = FakeLink(autopilot, clock, Network(0.05, 0.05, latency=2.5, jitter=0.1, seed=seed))
    current = read_current(link, QUAD, WANTED, clock=clock)
    begin = clock.now
    outcome = write(plan(current, WANTED, QUAD), link, backup=tmp_path / "b.param", clock=clock)
    link.drain()
    check_claim(outcome.standing, autopilot.calibration())
    assert clock.now - begin < 2 * Timing().limit + 10.0
    assert_never_half_written(autopilot)


@pytest.mark.parametrize("seed", range(12))
def test_without_timesync_only_time_proves_and_no_late_echo_does(tmp_path: Path, seed: int) -> None:
    autopilot, clock = FakeAutopilot(OLD), VirtualClock()
    autopilot.answers_timesync = False
    link = FakeLink(autopilot, clock, Network(0.2, 0.1, latency=0.3, jitter=0.4, seed=seed))
    outcome = upload(link, tmp_path / "b.param")
    assert outcome.good
    assert autopilot.calibration() == NEW
    assert_never_half_written(autopilot)


def check_claim(standing: Standing, held: dict[str, float]) -> None:
    """What the journal or the outcome says is true."""
    match standing:
        case Standing.OLD:
            assert held == OLD
        case Standing.NEW:
            assert held == NEW
        case Standing.OFF:
            assert held["COMPASS_MOTCT"] == 0
        case Standing.UNSURE:
            assert held in (OLD, NEW) or held["COMPASS_MOTCT"] == 0


@pytest.mark.parametrize("words", [True, False])
def test_what_is_denied_is_left_as_it_is_and_all_else_brought_back(
    tmp_path: Path, words: bool
) -> None:
    """The vehicle denies two names, before and in the roll-back."""
    autopilot = FakeAutopilot(OLD, read_only=frozenset({"COMPASS_MOT_Y", "COMPASS_ODI3_Z"}))
    autopilot.reports_errors, autopilot.denies_in_words = not words, words
    outcome = upload(FakeLink(autopilot, VirtualClock()), tmp_path / "b.param")
    assert outcome.standing is Standing.OLD
    assert autopilot.calibration() == OLD
