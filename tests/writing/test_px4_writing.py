"""What stands on a PX4 vehicle after a write, whatever happens on the way."""

from __future__ import annotations

import pytest
from fake_autopilot import FakeLink, Network, VirtualClock
from fake_px4 import NEW, OLD, QUAD, SWITCH, WANTED, FakePx4
from test_parameters_writing import (
    Killed,
    arms,
    dies,
    is_interrupted,
    is_killed,
    is_killed_and_then_the_vehicle_reboots,
    reboots,
    reboots_before_the_newest_writes_are_stored,
)

from magcomp.writing.events import Standing
from magcomp.writing.files import read_parameter_file
from magcomp.writing.journal import read_journal
from magcomp.writing.plan import plan
from magcomp.writing.writer import read_current, write

FAULTS = [
    dies,
    reboots,
    reboots_before_the_newest_writes_are_stored,
    is_killed,
    is_killed_and_then_the_vehicle_reboots,
    is_interrupted,
    arms,
]


def upload(link, backup, wanted=WANTED):
    current = read_current(link, QUAD, wanted, clock=link.clock)
    return write(plan(current, wanted, QUAD), link, backup=backup, clock=link.clock)


def is_so(standing, held):
    return {
        Standing.OLD: held == OLD,
        Standing.NEW: held == NEW,
        Standing.OFF: held[SWITCH] == 0,
        Standing.UNSURE: held in (OLD, NEW) or held[SWITCH] == 0,
    }[standing]


def test_the_switch_goes_off_first_and_on_last_and_integers_travel_as_bytes(tmp_path):
    vehicle = FakePx4(OLD)
    assert upload(FakeLink(vehicle, VirtualClock()), tmp_path / "b.param").good
    assert vehicle.calibration() == NEW
    assert vehicle.writes[0] == (SWITCH, 0.0)
    assert vehicle.writes[-1] == (SWITCH, 1.0)


def test_what_was_confirmed_is_still_there_after_a_power_cut(tmp_path):
    vehicle, clock = FakePx4(OLD), VirtualClock()
    assert upload(FakeLink(vehicle, clock), tmp_path / "b.param").good
    vehicle.reboot(clock.now, stored=False)
    assert vehicle.calibration() == NEW


@pytest.mark.parametrize("seed", range(4))
def test_a_bad_link_is_survived(tmp_path, seed):
    vehicle = FakePx4(OLD)
    network = Network(0.25, 0.1, latency=0.1, jitter=0.1, seed=seed)
    assert upload(FakeLink(vehicle, VirtualClock(), network), tmp_path / "b.param").good
    assert vehicle.calibration() == NEW


def test_a_type_that_the_vehicle_does_not_take_is_a_timeout_and_rolled_back(tmp_path):
    vehicle = FakePx4(OLD)
    refused = vehicle.kind

    def kind(name):
        return 9 if name == "CAL_MAG1_ZCOMP" else refused(name)

    vehicle.kind = kind
    answer = vehicle.answer
    vehicle.answer = lambda message, now: (
        []
        if message.get_type() == "PARAM_SET" and message.param_id == "CAL_MAG1_ZCOMP"
        else answer(message, now)
    )
    outcome = upload(FakeLink(vehicle, VirtualClock()), tmp_path / "b.param")
    assert not outcome.good
    assert is_so(outcome.standing, vehicle.calibration())


@pytest.mark.parametrize("step", [37, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_at_any_message_leaves_all_old_or_all_new_or_off_and_restorable(
    tmp_path, fault, step
):
    link = FakeLink(FakePx4(OLD), VirtualClock())
    current = read_current(link, QUAD, WANTED, clock=link.clock)
    before = link.messages
    write(plan(current, WANTED, QUAD), link, backup=tmp_path / "c.param", clock=link.clock)
    count = link.messages - before
    assert count > 2 * 3 * 25
    for at in range(FAULTS.index(fault) % step, count, step):
        folder = tmp_path / str(at)
        folder.mkdir()
        strike_at(fault, at, folder)


def strike_at(fault, at, folder):
    vehicle, clock = FakePx4(OLD), VirtualClock()
    link, backup = FakeLink(vehicle, clock), folder / "b.param"
    current = read_current(link, QUAD, WANTED, clock=clock)
    begin, outcome = link.messages, None

    def strike(number):
        if number == begin + at:
            fault(link)

    link.before_message = strike
    try:
        outcome = write(plan(current, WANTED, QUAD), link, backup=backup, clock=clock)
    except Killed:
        link.drain()
        if link.reboots_at_the_end:
            vehicle.reboot(clock.now, stored=False)
    vehicle.armed = False
    for state in vehicle.states:
        assert state[SWITCH] == 0 or state in (OLD, NEW)
    held, journal = vehicle.calibration(), read_journal(backup)
    assert journal.outcome == outcome
    assert is_so(journal.standing, held)
    clock.now += 10.0
    again = upload(FakeLink(vehicle, clock), folder / "again.param", read_parameter_file(backup))
    assert again.good
    assert vehicle.calibration() == OLD
