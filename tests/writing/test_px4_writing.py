"""What stands on a PX4 vehicle after a write, whatever happens on the way."""

from __future__ import annotations

import itertools

import pytest
from fake_autopilot import FakeLink, Network, VirtualClock
from fake_px4 import NEW, OLD, QUAD, SWITCH, FakePx4
from px4_faults import FAULTS, clean_messages, is_so, strike, upload

from magcomp import autopilots
from magcomp.model import ParameterSet


def test_the_switch_goes_off_first_and_on_last_and_integers_travel_as_bytes(tmp_path):
    vehicle = FakePx4(OLD)
    assert upload(FakeLink(vehicle, VirtualClock()), tmp_path / "b.param").good
    assert vehicle.calibration() == NEW
    assert vehicle.writes[0] == (SWITCH, 0.0)
    assert vehicle.writes[-1] == (SWITCH, 1.0)


def test_compensation_is_written_before_offsets_and_each_vector_together(tmp_path):
    """Whatever the order in the file."""
    vehicle, clock = FakePx4(OLD), VirtualClock()
    mixed = ParameterSet(dict(sorted(NEW.items(), key=lambda item: item[0][::-1])), QUAD)
    assert upload(FakeLink(vehicle, clock), tmp_path / "b.param", mixed).good
    kinds = [name[10:] for name, _ in vehicle.writes if name != SWITCH]
    assert [kind for kind, _ in itertools.groupby(kinds)] == ["COMP", "OFF", "SCALE", "ODIAG"]
    slots = [name[7] for name, _ in vehicle.writes if name.endswith("COMP")]
    assert slots == sorted(slots)


def test_what_was_confirmed_is_still_there_after_a_power_cut(tmp_path):
    vehicle, clock = FakePx4(OLD), VirtualClock()
    assert upload(FakeLink(vehicle, clock), tmp_path / "b.param").good
    vehicle.reboot(clock.now, stored=False)
    assert vehicle.calibration() == NEW


def test_after_each_stage_that_writes_px4_has_the_time_to_save():
    _, seconds = clean_messages()
    assert seconds > 3 * autopilots.of(QUAD).storage_s > 3 * 2.0


@pytest.mark.parametrize("seed", range(4))
def test_a_bad_link_is_survived(tmp_path, seed):
    vehicle = FakePx4(OLD)
    network = Network(0.25, 0.1, latency=0.1, jitter=0.1, seed=seed)
    assert upload(FakeLink(vehicle, VirtualClock(), network), tmp_path / "b.param").good
    assert vehicle.calibration() == NEW


def test_a_name_whose_write_is_answered_by_silence_is_rolled_back(tmp_path):
    """As PX4 answers a write of another type than the parameter has."""
    vehicle = FakePx4(OLD)
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
@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_at_any_message_leaves_all_old_or_all_new_or_off_and_restorable(
    tmp_path, kind, step
):
    messages, _ = clean_messages()
    assert messages > 2 * 3 * 25
    for at in range(len(kind) % step, messages, step):
        folder = tmp_path / str(at)
        folder.mkdir()
        assert strike(FAULTS[kind], at, folder).bad == (False, False, False)
