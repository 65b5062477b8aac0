"""From a recording to parameters: several compasses, one control quantity, nothing half done."""

from __future__ import annotations

import struct
from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import recordings
import truth
from effort import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from logs_made_of_logs import Frame, frames, write
from pymavlink.dialects.v20 import ardupilotmega as dialect
from synthetic import EXACT, INTERFERENCE, Flown, Swept, Turned, waves, with_both

from magcomp.analysis import Options, analyse, parameter_set
from magcomp.autopilots import ardupilot
from magcomp.errors import FitRejectedError, MissingDataError, ParameterFileError, UsageError
from magcomp.model import (
    Analysis,
    Grade,
    ParameterChange,
    ParameterHistory,
    Recording,
    Series,
)
from magcomp.sources import read

SIZE = float(np.linalg.norm(INTERFERENCE))
STORED = ardupilot.vector_parameters("MOT", 2, (7.0, -6.0, 5.0))


def vector(parameters, kind: str, compass: int) -> np.ndarray:
    return np.array([parameters[name] for name in ardupilot.vector_names(kind, compass)])


def with_parameters(recording: Recording, values: dict[str, float]) -> Recording:
    changes = recording.parameters.changes + tuple(
        ParameterChange(0.0, name, value) for name, value in values.items()
    )
    return replace(recording, parameters=ParameterHistory(changes))


def disturbed(recording: Recording, compass: int, size: float = 120.0) -> Recording:
    series = recording.field[compass]
    rng = np.random.default_rng(compass)
    wander = np.stack([waves(rng, series.time, 20.0, 4.0) for _ in range(3)], axis=1)
    changed = Series(series.time, series.value + size * wander)
    return replace(recording, field={**recording.field, compass: changed})


# --- three compasses in one run --------------------------------------------------------------


def test_three_compasses_in_one_run_get_what_each_would_get_alone():
    recording = Flown(seed=1, compasses=(1, 2, 3)).recording()
    together = analyse(recording)
    assert [c.fit.compass for c in together.compasses] == [1, 2, 3]
    for result in together.compasses:
        alone = analyse(recording, Options(compass=result.fit.compass)).compasses[0]
        assert np.allclose(alone.fit.interference, result.fit.interference, atol=1e-3)
        assert set(alone.parameters) == set(result.parameters)


def test_every_compass_is_written_by_its_own_names_and_one_switch_for_all():
    values = parameter_set(analyse(Flown(seed=1, compasses=(1, 2, 3)).recording())).values
    names = {
        name
        for compass in (1, 2, 3)
        for kind in ("MOT", "OFS", "DIA", "ODI")
        for name in ardupilot.vector_names(kind, compass)
    }
    assert set(values) == names | {"COMPASS_MOTCT"}
    assert list(values)[-1] == "COMPASS_MOTCT"
    assert values["COMPASS_MOTCT"] == 2.0


def test_a_compass_that_is_not_in_the_log_is_named():
    with pytest.raises(MissingDataError, match="compass 3; instead it holds compass 1"):
        analyse(Flown(seconds=60.0).recording(), Options(compass=3))


# --- what is written ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["flight", "turntable_paper", "sweep_throttle_only"])
def test_every_value_is_a_float32_as_the_vehicle_will_say_it_back(name):
    for value in parameter_set(recordings.analysis(name)).values.values():
        assert np.isfinite(value)
        assert value == float(np.float32(value))


@pytest.mark.parametrize("name", ["flight", "flight_wrong_mot", "turntable_paper"])
def test_offsets_are_written_wherever_a_motor_vector_is(name):
    for result in recordings.analysis(name).compasses:
        n = result.fit.compass
        assert set(ardupilot.vector_names("MOT", n)) <= set(result.parameters)
        assert set(ardupilot.vector_names("OFS", n)) <= set(result.parameters)


def test_offsets_learned_in_the_hover_give_back_the_interference_they_swallowed():
    """docs/autopilots.md, ArduPilot: learning: when MOT is added, OFS must be re-centred."""
    hover = 25.0
    learned = replace(
        EXACT,
        offset=EXACT.offset + np.linalg.solve(EXACT.soft_iron, EXACT.vector) * hover,
        motor=np.zeros(3),
    )
    in_force = {"COMPASS_MOTCT": 0.0, **ardupilot.correction_parameters(learned, 1, 1.0)}
    flown = Flown(seed=2, in_force=in_force, amperes=hover, swing=10.0, seconds=300.0, tilt=0.3)
    parameters = analyse(flown.recording()).compasses[0].parameters
    assert np.linalg.norm(vector(parameters, "MOT", 1) + INTERFERENCE) < 0.05 * SIZE
    assert np.linalg.norm(vector(parameters, "OFS", 1) - EXACT.offset) < 5.0
    assert np.linalg.norm(learned.offset - EXACT.offset) > 50.0


def test_a_scale_in_force_stays_and_the_soft_iron_is_written_for_it():
    scale = 1.2
    unmoved = replace(EXACT, motor=np.zeros(3))
    in_force = {
        "COMPASS_MOTCT": 0.0,
        "COMPASS_SCALE": scale,
        **ardupilot.correction_parameters(unmoved, 1, scale),
    }
    parameters = analyse(Flown(seed=3, in_force=in_force).recording()).compasses[0].parameters
    applied = ardupilot.calibration(parameters | {"COMPASS_SCALE": scale}, 1)
    assert np.allclose(scale * applied.soft_iron, EXACT.soft_iron, atol=1e-5)
    assert np.linalg.norm(applied.motor + INTERFERENCE) < 0.03 * SIZE


def two_compasses_one_disturbed() -> Recording:
    return disturbed(Flown(seed=4, compasses=(1, 2)).recording(), 2)


def test_a_rejected_compass_whose_stored_vector_would_come_into_force_gets_zeros():
    found = analyse(with_parameters(two_compasses_one_disturbed(), STORED))
    first, second = found.compasses
    assert first.verdict.grade is not Grade.REJECTED
    assert second.verdict.grade is Grade.REJECTED
    assert np.array_equal(vector(second.parameters, "MOT", 2), np.zeros(3))
    assert not set(ardupilot.vector_names("OFS", 2)) & set(second.parameters)


def test_a_rejected_compass_that_is_already_compensated_is_left_as_it_is():
    in_force = {
        "COMPASS_MOTCT": 2.0,
        **ardupilot.correction_parameters(EXACT, 1, 1.0),
        **ardupilot.correction_parameters(EXACT, 2, 1.0),
    }
    recording = disturbed(Flown(seed=4, compasses=(1, 2), in_force=in_force).recording(), 2)
    second = analyse(recording).compasses[1]
    assert second.verdict.grade is Grade.REJECTED
    assert second.parameters == {}


def test_a_compass_nobody_asked_for_is_not_woken_by_the_switch():
    recording = with_parameters(Flown(seed=4, compasses=(1, 2)).recording(), STORED)
    parameters = analyse(recording, Options(compass=1)).compasses[0].parameters
    assert np.array_equal(vector(parameters, "MOT", 2), np.zeros(3))


def test_where_every_compass_is_rejected_nothing_is_written():
    recording = disturbed(Flown(seed=5).recording(), 1)
    found = analyse(recording)
    assert found.grade is Grade.REJECTED
    assert parameter_set(found).values == {}


def test_a_user_who_insists_gets_the_whole_fit():
    found = analyse(disturbed(Flown(seed=5).recording(), 1))
    values = parameter_set(found, include_rejected=True).values
    assert np.allclose(vector(values, "MOT", 1), found.compasses[0].fit.correction.vector)
    assert values["COMPASS_MOTCT"] == 2.0


# --- the control quantity ------------------------------------------------------------------------


@pytest.mark.parametrize("follows", ["current", "throttle"])
def test_the_quantity_the_field_follows_is_used_and_the_scores_are_told(follows):
    found = analyse(with_both(follows, 6))
    result = found.compasses[0]
    assert result.fit.regressor == follows
    assert result.parameters["COMPASS_MOTCT"] == {"current": 2.0, "throttle": 1.0}[follows]
    assert any(note.startswith(f"{follows} is used") for note in found.notes)
    unit = 1.0 if follows == "current" else 60.0
    assert np.linalg.norm(result.fit.interference / unit - INTERFERENCE) < 0.06 * SIZE


def test_current_is_used_where_throttle_is_no_better():
    plain = Flown(seed=7).recording()
    same = Series(plain.current.time, plain.current.value / 60.0)
    assert analyse(replace(plain, throttle=same)).compasses[0].fit.regressor == "current"


def test_a_regressor_asked_for_is_used_whatever_predicts_better():
    found = analyse(with_both("current", 6), Options(regressor="throttle"))
    assert found.compasses[0].fit.regressor == "throttle"


def test_a_regressor_the_log_lacks_is_named_with_what_it_holds():
    with pytest.raises(MissingDataError, match="throttle that changes; instead it holds only cur"):
        analyse(Flown(seconds=60.0).recording(), Options(regressor="throttle"))


def test_asking_for_throttle_does_not_forget_the_current_that_was_compensated():
    """The correction in force multiplied the current, so the current is needed to undo it."""
    wrong = replace(EXACT, motor=np.array([3.0, 2.0, -1.0]))
    in_force = {"COMPASS_MOTCT": 2.0, **ardupilot.correction_parameters(wrong, 1, 1.0)}
    plain = Flown(seed=8, in_force=in_force).recording()
    both = replace(plain, throttle=Series(plain.current.time, plain.current.value / 60.0))
    found = analyse(both, Options(regressor="throttle")).compasses[0].fit
    assert np.linalg.norm(found.interference / 60.0 - INTERFERENCE) < 0.05 * SIZE


# --- what is missing, and what is wrong -----------------------------------------------------------


def test_without_a_position_the_field_of_the_readings_serves_and_a_note_says_so():
    recording = Flown(seed=9).recording()
    found = analyse(replace(recording, position=None))
    assert any("no position" in note for note in found.notes)
    error = found.compasses[0].fit.interference - INTERFERENCE
    assert np.linalg.norm(error) < 0.05 * SIZE


def test_without_a_control_quantity_the_pilot_is_asked_whether_it_was_armed():
    with pytest.raises(MissingDataError, match="was the vehicle ever armed"):
        analyse(replace(Flown(seconds=60.0).recording(), current=None))


def test_without_a_compass_the_messages_that_carry_one_are_named():
    with pytest.raises(MissingDataError, match="RAW_IMU, SCALED_IMU2 or SCALED_IMU3"):
        analyse(replace(Flown(seconds=60.0).recording(), field={}))


def test_a_parameter_that_is_no_number_is_named():
    recording = with_parameters(Flown(seconds=60.0).recording(), {"COMPASS_DIA_Y": np.nan})
    with pytest.raises(ParameterFileError, match="COMPASS_DIA_Y must be a finite number"):
        analyse(recording)


@pytest.mark.parametrize("method", ["levels", "sweep"])
def test_a_method_that_cannot_work_is_refused_in_one_sentence(method):
    with pytest.raises(FitRejectedError) as caught:
        analyse(recordings.recording("flight"), Options(method=method, compass=1))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "method"),
    [("flight", "flight"), ("turntable_paper", "levels"), ("sweep_current", "sweep")],
)
def test_each_method_asked_for_by_name_gives_what_auto_gives_where_auto_takes_it(name, method):
    asked = analyse(recordings.recording(name), Options(method=method, compass=1)).compasses[0]
    assert asked.fit.method == method
    assert np.allclose(asked.fit.interference, recordings.result(name, 1).fit.interference)


@pytest.mark.parametrize(
    "wrong",
    [{"method": "guess"}, {"regressor": "volts"}, {"start": 5, "end": 5}],
)
def test_options_that_cannot_be_are_refused(wrong):
    with pytest.raises(UsageError, match="must be"):
        Options(**wrong)


@settings(max_examples=examples(12))
@given(st.floats(0.0, 30.0), st.floats(60.0, 100.0))
def test_a_part_of_the_log_is_fitted_by_its_own_readings(start, end):
    recording = part()
    found = analyse(recording, Options(start=start, end=end, method="sweep")).compasses[0]
    assert found.verdict.coverage.seconds <= end - start + 1.0
    assert np.linalg.norm(found.fit.interference - INTERFERENCE) < 0.02 * SIZE


@cache
def part() -> Recording:
    return Swept(seconds=100.0).recording()


# --- the truth of a simulation is never looked at ---------------------------------------------


def test_a_recording_has_no_room_for_the_truth():
    assert {f.name for f in fields(Recording)} == {
        "source", "vehicle", "start_unix_s", "duration_s", "field", "attitude", "gyro", "accel",
        "throttle", "current", "voltage", "outputs", "position", "armed", "parameters", "report",
        "format", "battery", "other_currents", "applied", "raw_compasses", "attitude_source",
        "other_attitudes", "esc_currents", "forward",
    }  # fmt: skip
    for name in ("flight", "sweep_current"):
        assert not any(n.startswith("SIM_") for n in recordings.recording(name).parameters.names)


def test_a_log_without_simstate_and_with_other_sim_parameters_gives_the_same_numbers(tmp_path):
    def altered(frame: Frame) -> Frame:
        if frame.message != dialect.MAVLINK_MSG_ID_PARAM_VALUE or frame.payload[8:12] != b"SIM_":
            return frame
        return replace(frame, payload=struct.pack("<f", 1234.5) + frame.payload[4:])

    source = truth.FIXTURES / "turntable_paper.tlog"
    told = [f for f in frames(source) if f.payload[8:12] == b"SIM_"]
    shown = [f for f in frames(source) if f.message == dialect.MAVLINK_MSG_ID_SIMSTATE]
    assert told
    assert shown
    blind = write(
        tmp_path / "turntable_paper.tlog",
        (altered(f) for f in frames(source) if f.message != dialect.MAVLINK_MSG_ID_SIMSTATE),
    )
    first = Options(compass=1)
    found, expected = analyse(read(blind), first), recordings.analysis("turntable_paper", first)
    assert values_of(found) == values_of(expected)


def values_of(analysis: Analysis) -> list:
    return [
        (dict(c.parameters), c.verdict.heading_error, c.verdict.residual)
        for c in analysis.compasses
    ]


def test_the_same_recording_gives_the_same_answer_to_the_last_digit():
    recording = Turned(seed=1, in_force={"COMPASS_MOTCT": 0.0}).recording()
    assert values_of(analyse(recording)) == values_of(analyse(recording))


# --- real aircraft, whose truth nobody knows ------------------------------------------------------


def real(name: str) -> Path:
    path = truth.REAL / name
    if not path.exists():
        pytest.skip(f"{path} is not on this machine")
    return path


@pytest.fixture(scope="module")
def quad_2015() -> Analysis:
    return analyse(read(real("quad_2015.tlog")))


def test_a_badly_disturbed_compass_is_explained_twice_as_well_on_unseen_stretches(quad_2015):
    second = next(c for c in quad_2015.compasses if c.fit.compass == 2)
    assert second.verdict.residual.held_out <= 0.5 * second.verdict.residual.held_out_before
    assert any("on stretches it did not see" in reason for reason in second.verdict.reasons)


def test_a_compass_with_nothing_to_show_is_not_called_good(quad_2015):
    first = next(c for c in quad_2015.compasses if c.fit.compass == 1)
    assert first.verdict.grade is not Grade.GOOD


def test_an_old_log_without_a_current_is_judged_by_throttle():
    found = analyse(read(real("quad_2013.tlog")))
    assert {c.fit.regressor for c in found.compasses} == {"throttle"}
    assert all(c.verdict.reasons for c in found.compasses)
