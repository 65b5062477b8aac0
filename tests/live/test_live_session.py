"""A live session against the simulated ArduCopter: what it shows, keeps, answers and writes."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from live_vehicle import COMPENSATION, PATIENCE_S, RATES, alive, free_port, held, landed
from logs_made_of_logs import SWEEP, frames, write
from truth import FIXTURES

from magcomp.analysis import Options, analyse, parameter_set
from magcomp.errors import (
    AddressError,
    LinkError,
    LinkTimeoutError,
    OutputError,
    VehicleRefusedError,
    WriteError,
)
from magcomp.live.session import LiveSession
from magcomp.live.situation import Situation
from magcomp.model import Grade, ParameterSet
from magcomp.simulate import Faults
from magcomp.sources.tlog import read_tlog
from magcomp.writing.events import Standing
from magcomp.writing.journal import read_journal

ONE = Options(compass=1, regressor="current")
DEVICE_IDS = (97539, 131874, 263178)


def until(condition, session):
    """Wait for a snapshot that fulfils a condition."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        shown = session.snapshot()
        if condition(shown):
            return shown
        threading.Event().wait(0.05)
    raise AssertionError(f"never came: {session.snapshot().guidance}")


def open_session(flown, **options):
    return LiveSession.open(flown.address, system=1, **options)


def open_to_write(flown):
    """A session that fits nothing and hardly streams: only what is written is looked at."""
    return open_session(flown, refit_share=0.0, rates={"VFR_HUD": 1.0})


@pytest.fixture(scope="class")
def flight(tmp_path_factory):
    """A flight, recorded live to its end: session and vehicle after it, and its file.

    Both live until the class ends: what needs no flight stands outside.
    """
    path = tmp_path_factory.mktemp("live") / "flight.tlog"
    wanted = {"record": path, "rates": RATES, "options": ONE}
    with alive("flight", speed=30.0) as flown, open_session(flown, **wanted) as session:
        session.wait_ready(PATIENCE_S)
        flying = until(lambda shown: shown.situation is Situation.FLYING, session)
        until(lambda shown: flown.vehicle.program_over and shown.armed is False, session)
        session.stop_recording()
        yield flown.vehicle, session, path, flying


@pytest.fixture(scope="class")
def answer(flight):
    """What the session makes of the flight."""
    return flight[1].analyse(ONE)


class TestAFlight:
    def test_the_vehicle_is_found_and_its_readings_shown(self, flight):
        _, session, path, flying = flight
        assert flying.vehicle.device_ids == DEVICE_IDS
        assert flying.connected
        assert flying.ready
        assert flying.armed
        assert [compass.number for compass in flying.compasses] == [1, 2, 3]
        assert all(compass.healthy for compass in flying.compasses)
        assert flying.current > 1.0
        assert flying.voltage > 15.0
        assert 0.0 < flying.throttle < 1.0
        assert flying.recording_path == path
        assert session.snapshot().recording_bytes == path.stat().st_size

    def test_the_compass_points_where_the_autopilot_thinks(self, flight):
        _, _, _, flying = flight
        yaw = flying.attitude_deg[2]
        for compass in flying.compasses:
            # Magnetic against true, and the motors' interference: the same direction at least.
            assert abs((compass.heading_deg - yaw + 180.0) % 360.0 - 180.0) < 60.0

    def test_a_flight_is_followed_to_its_end_and_refits_come_by_themselves(self, flight):
        vehicle, session, _, _ = flight
        shown = session.snapshot()
        assert shown.situation is Situation.FLYING
        assert shown.grade is not None
        assert shown.coverage.counts.sum() > 0
        # The vehicle lives on after its programme, for as long as a busy machine takes to notice.
        recorded = session.recording().duration_s
        assert sum(shown.level_seconds) == pytest.approx(recorded, rel=0.1)
        assert sum(shown.level_seconds) > 0.9 * vehicle.duration_s

    def test_no_sample_is_lost_between_link_buffer_and_file(self, flight):
        _, session, path, _ = flight
        assert session.snapshot().link.lost == 0
        live, logged = session.recording(), read_tlog(path)
        for compass in (1, 2, 3):
            np.testing.assert_array_equal(live.field[compass].time, logged.field[compass].time)
            np.testing.assert_array_equal(live.field[compass].value, logged.field[compass].value)
        assert live.parameters == logged.parameters

    def test_what_was_received_live_and_its_own_tlog_fit_to_the_same_numbers(self, flight, answer):
        live, logged = answer, analyse(read_tlog(flight[2]), ONE)
        assert parameter_set(live).values == parameter_set(logged).values
        for one, other in zip(live.compasses, logged.compasses, strict=True):
            assert one.verdict == other.verdict
            np.testing.assert_array_equal(one.fit.covariance, other.fit.covariance)

    def test_the_answer_is_the_vehicle_s_truth(self, flight, answer):
        assert answer.grade is Grade.GOOD
        (result,) = answer.compasses
        truth = flight[0].truth.interference
        np.testing.assert_allclose(result.fit.interference, truth, atol=0.06)

    def test_after_the_end_of_recording_the_file_takes_no_more(self, flight):
        vehicle, session, path, _ = flight
        size = path.stat().st_size
        frames = session.snapshot().link.frames
        until(lambda shown: shown.link.frames > frames + 100, session)
        assert path.stat().st_size == size
        assert not session.snapshot().recording
        assert vehicle.program_over

    def test_the_flown_answer_can_be_written_at_once(self, flight, answer, tmp_path):
        vehicle, session, _, _ = flight
        wanted = parameter_set(answer)
        plan = session.upload_plan(wanted)
        assert session.upload(plan, tmp_path / "old.param").good
        assert all(vehicle.parameters[name] == value for name, value in wanted.values.items())
        assert session.upload_plan(wanted).changes == ()


def test_a_log_is_replayed_as_if_it_were_live():
    log = FIXTURES / "flight_low_rate.tlog"
    with LiveSession.open(f"{log},5000x", refit_share=0.0) as session:
        shown = until(lambda shown: shown.ended, session)
        assert shown.situation is Situation.FLYING
        live, logged = session.recording(), read_tlog(log)
    np.testing.assert_array_equal(live.field[1].time, logged.field[1].time)
    np.testing.assert_array_equal(live.field[1].value, logged.field[1].value)
    assert live.parameters == logged.parameters


def test_what_another_vehicle_on_the_link_does_counts_for_nothing(tmp_path):
    """A sweep on the ground, and above it somebody flies."""
    swept, flown = (
        list(islice(frames(log), 6000)) for log in (SWEEP, FIXTURES / "flight_low_rate.tlog")
    )
    later = swept[0].arrival_us - flown[0].arrival_us
    above = (replace(each, system=2, arrival_us=each.arrival_us + later) for each in flown)
    both = sorted([*swept, *above], key=lambda frame: frame.arrival_us)
    shown = []
    for name, kept in (("alone", swept), ("both", both)):
        log = write(tmp_path / f"{name}.tlog", kept)
        with LiveSession.open(f"{log},5000x", system=1, refit_share=0.0) as session:
            until(lambda shown: shown.ended, session)
            shown.append(session.snapshot())
    alone, beside = shown
    assert beside.situation is alone.situation is Situation.STILL
    assert beside.recorded_s == alone.recorded_s
    assert beside.level_seconds == alone.level_seconds
    np.testing.assert_array_equal(beside.coverage.counts, alone.coverage.counts)


# ---------------------------------------------------------------- what is warned of


def test_what_a_pilot_should_know_is_said_in_words():
    strange = {
        "COMPASS_MOTCT": 2.0,
        "COMPASS_LEARN": 3.0,
        "COMPASS_PMOT_EN": 1.0,
        "COMPASS_USE3": 0.0,
    }
    with alive("sweep", parameters=strange) as flown, open_session(flown) as session:
        session.wait_ready(PATIENCE_S)
        text = " / ".join(until(lambda shown: shown.compasses, session).warnings)
    for part in (
        "COMPASS_MOTCT 2",
        "COMPASS_LEARN is 3",
        "COMPASS_PMOT_EN",
        "compass 3 is not used",
    ):
        assert part in text


def test_a_missing_current_sensor_is_named():
    with (
        alive("sweep", parameters={"BATT_MONITOR": 0.0}) as flown,
        open_session(flown) as session,
    ):
        session.wait_ready(PATIENCE_S)
        until(lambda shown: any("no current sensor" in w for w in shown.warnings), session)
        assert session.snapshot().current is None


# ---------------------------------------------------------------- writing


def test_a_whole_calibration_is_written_and_brought_back(tmp_path):
    with alive(vehicle=landed()) as flown, open_to_write(flown) as session:
        session.wait_ready(PATIENCE_S)
        old = held(flown.vehicle)
        backup, events = tmp_path / "a.param", []
        plan = session.upload_plan(ParameterSet(COMPENSATION), any_vehicle=True)
        assert len(plan.changes) == len(COMPENSATION)
        assert session.upload(plan, backup, events.append).good
        assert held(flown.vehicle) == COMPENSATION
        assert events[-1].standing is Standing.NEW
        back = session.restore_plan(backup)
        assert session.restore(backup, back, tmp_path / "b.param").good
        assert held(flown.vehicle) == old
        assert read_journal(backup).restored


@pytest.mark.slow
def test_a_write_survives_a_third_of_all_frames_lost_each_way_and_200_ms(tmp_path):
    faults = Faults(loss=0.3, latency_s=0.2)
    with (
        alive(vehicle=landed(), speed=1.0, faults=faults) as flown,
        open_session(flown, refit_share=0.0) as session,
    ):
        session.connection.wait_vehicle(PATIENCE_S)
        plan = session.upload_plan(ParameterSet(COMPENSATION), any_vehicle=True)
        assert session.upload(plan, tmp_path / "old.param").good
        assert held(flown.vehicle) == COMPENSATION


def test_an_armed_vehicle_is_not_written(tmp_path):
    with alive("flight", speed=5.0) as flown, open_to_write(flown) as session:
        session.wait_ready(PATIENCE_S)
        until(lambda shown: shown.armed, session)
        old = held(flown.vehicle)
        with pytest.raises(VehicleRefusedError, match="still armed"):
            session.wait_disarmed(0.2)
        plan = session.upload_plan(ParameterSet(COMPENSATION), any_vehicle=True)
        outcome = session.upload(plan, tmp_path / "old.param")
        assert not outcome.good
        assert outcome.standing is Standing.OLD
        assert held(flown.vehicle) == old


def test_another_vehicle_s_parameters_are_refused():
    theirs = ParameterSet({**COMPENSATION, "COMPASS_DEV_ID": 1234.0})
    with alive(vehicle=landed()) as flown, open_to_write(flown) as session:
        session.wait_ready(PATIENCE_S)
        with pytest.raises(VehicleRefusedError, match="1234"):
            session.upload_plan(theirs)
        with pytest.raises(WriteError, match="CAL_MAG0_XOFF must exist on the vehicle"):
            session.upload_plan(ParameterSet({"CAL_MAG0_XOFF": 1.0}), any_vehicle=True)


# ---------------------------------------------------------------- what goes wrong


def test_a_wrong_address_is_said_at_once(tmp_path):
    path = tmp_path / "a.tlog"
    with pytest.raises(AddressError):
        LiveSession.open("nowhere", record=path)
    assert not path.exists()


def test_a_port_in_use_is_said_at_once():
    address = f"udp:127.0.0.1:{free_port()}"
    with LiveSession.open(address), pytest.raises(LinkError):
        LiveSession.open(address)


def test_a_recording_that_cannot_be_made_is_said_at_once(tmp_path):
    (tmp_path / "a.tlog").write_bytes(b"")
    with pytest.raises(OutputError, match="exists"):
        LiveSession.open(f"udp:127.0.0.1:{free_port()}", record=tmp_path / "a.tlog")


def test_silence_is_explained_and_leaves_no_empty_file(tmp_path):
    path = tmp_path / "a.tlog"
    with LiveSession.open(f"udp:127.0.0.1:{free_port()}", record=path) as session:
        with pytest.raises(LinkTimeoutError, match="nothing arrived"):
            session.wait_ready(0.2)
        shown = session.snapshot()
        assert shown.vehicle is None
        assert not shown.connected
        assert shown.guidance.text == "waiting for the vehicle's heartbeat"
    assert not path.exists()


def test_a_disk_that_fails_costs_the_file_but_not_the_measurement(tmp_path):
    full = tmp_path / "full"
    full.symlink_to("/dev/full")
    with (
        alive("sweep") as flown,
        LiveSession.open(flown.address, system=1, record=full, force=True) as session,
    ):
        session.wait_ready(PATIENCE_S)
        shown = until(lambda shown: shown.recording_trouble, session)
        assert "No space left" in shown.warnings[0]
        assert not shown.recording
        before = session.snapshot().level_seconds
        until(lambda shown: sum(shown.level_seconds) > sum(before) + 1.0, session)


def test_a_reboot_is_noticed_and_the_session_goes_on():
    # It has been up for a minute, so that its clock tells, and is silent for less than a gap.
    with alive(vehicle=landed(), speed=2.0) as flown, open_session(flown) as session:
        session.wait_ready(PATIENCE_S)
        until(lambda shown: shown.compasses, session)
        flown.vehicle.reboot()
        until(lambda shown: "the vehicle rebooted" in shown.warnings, session)
        until(lambda shown: shown.compasses and shown.connected, session)


def test_a_closed_session_gives_the_vehicle_its_rates_back():
    vehicle = landed()
    with alive(vehicle=vehicle) as flown:
        with open_session(flown, refit_share=0.0) as session:
            session.wait_ready(PATIENCE_S)
            until(lambda shown: shown.link.rates.get("ATTITUDE", 0.0) > 10.0, session)
        with LiveSession.open(flown.address, system=1, rates={"VFR_HUD": 2.0}) as session:
            session.wait_ready(PATIENCE_S)
            until(lambda shown: shown.link.rates.get("VFR_HUD", 0.0) > 0.5, session)
            assert session.snapshot().link.rates.get("ATTITUDE", 0.0) == 0.0
