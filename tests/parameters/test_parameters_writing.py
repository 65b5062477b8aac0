"""What stands on the vehicle after a write, whatever happens on the way."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest
from fake_autopilot import NEW, OLD, QUAD, WANTED, FakeAutopilot, FakeLink, Network, VirtualClock

from magcomp.parameters.events import Outcome, Standing
from magcomp.parameters.files import read_parameter_file
from magcomp.parameters.journal import read_journal
from magcomp.parameters.plan import plan
from magcomp.parameters.writer import read_current, write


class Killed(BaseException):
    """The program ends here, as by SIGKILL."""


def upload(link: FakeLink, backup: Path, wanted=WANTED, **options) -> Outcome:
    current = read_current(link, QUAD, wanted, clock=link.clock)
    return write(
        plan(current, wanted, QUAD), link, backup=backup, clock=link.clock, **options
    )


def restore(autopilot: FakeAutopilot, clock: VirtualClock, backup: Path) -> Outcome:
    clock.now += 10.0
    link = FakeLink(autopilot, clock)
    return upload(link, backup.with_name("second.param"), read_parameter_file(backup))


def assert_never_half_written(autopilot: FakeAutopilot) -> None:
    for state in autopilot.states:
        assert state["COMPASS_MOTCT"] == 0 or state in (OLD, NEW)


def test_a_good_link_carries_three_compasses_in_less_than_two_seconds(tmp_path: Path) -> None:
    autopilot, clock = FakeAutopilot(OLD), VirtualClock()
    link = FakeLink(autopilot, clock)
    current = read_current(link, QUAD, WANTED, clock=clock)
    begin = clock.now
    todo = plan(current, WANTED, QUAD)
    outcome = write(todo, link, backup=tmp_path / "b.param", clock=clock)
    assert outcome == Outcome(Standing.NEW)
    assert autopilot.calibration() == NEW
    assert len(todo.changes) == 37
    assert clock.now - begin < 2.0
    assert_never_half_written(autopilot)
