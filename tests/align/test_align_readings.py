"""New readings of a compass: repeats, truncation, gaps, parameter changes, disarmed time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import EXACT, Flown, problem_of

from magcomp.align import controls, readings, reported, sample, thinned
from magcomp.autopilots import ardupilot
from magcomp.errors import MissingDataError, UsageError
from magcomp.model import Lags, ParameterChange, ParameterHistory, Recording, Series


@pytest.fixture
def recording() -> Recording:
    return Flown(seconds=60.0).recording()


def with_field(recording: Recording, time: np.ndarray, value: np.ndarray) -> Recording:
    return replace(recording, field={1: Series(time, value)})


# --- repeats ------------------------------------------------------------------------


def test_a_reading_repeated_by_a_fast_stream_counts_once(recording):
    plain = readings(recording, 1)
    field = recording.field[1]
    fast = np.sort(np.concatenate([field.time, field.time + 0.03, field.time + 0.06]))
    stream = with_field(recording, fast, np.repeat(field.value, 3, axis=0))
    kept = readings(stream, 1)
    assert np.array_equal(kept.time, plain.time)
    assert np.array_equal(kept.reported, plain.reported)


def test_a_reading_that_comes_back_later_is_new(recording):
    field = recording.field[1]
    value = field.value.copy()
    value[10], value[12] = value[11] + 1.0, value[11] + 1.0
    assert len(readings(with_field(recording, field.time, value), 1)) == len(field)


# --- the cut to whole numbers --------------------------------------------------------


def test_the_mean_error_of_a_field_cut_to_whole_numbers_goes_away():
    exact = readings(Flown(seconds=400.0, noise=3.0).recording(), 1)
    cut = readings(Flown(seconds=400.0, noise=3.0, truncated=True).recording(), 1)
    index = np.searchsorted(exact.time, cut.time)
    error = cut.reported - exact.reported[index]
    positive = exact.reported[index] > 2.0
    negative = exact.reported[index] < -2.0
    # The cut is uniform over one unit: σ = 0.289, so a mean of n has 0.289 / √n.
    for rows in (positive, negative):
        assert abs(error[rows].mean()) < 4 * 0.289 / np.sqrt(rows.sum())


def test_a_field_with_decimals_is_left_alone(recording):
    assert np.array_equal(readings(recording, 1).reported, recording.field[1].value)


# --- time that cannot be used ---------------------------------------------------------


def test_readings_in_a_gap_of_the_attitude_are_left_out(recording):
    attitude = recording.attitude
    keep = (attitude.time < 20.0) | (attitude.time > 24.0)
    gap = replace(recording, attitude=Series(attitude.time[keep], attitude.value[keep]))
    kept = readings(gap, 1)
    assert not np.any((kept.time > 20.05) & (kept.time < 23.95))
    assert len(kept) == pytest.approx(len(readings(recording, 1)) - 40, abs=1)


def test_slow_attitude_is_no_gap(recording):
    attitude = recording.attitude
    slow = replace(recording, attitude=Series(attitude.time[::50], attitude.value[::50]))
    assert len(readings(slow, 1)) > 0.95 * len(readings(recording, 1))


@pytest.mark.parametrize("often_last", [True, False])
def test_what_is_asked_for_more_often_later_was_no_gap_before(recording, often_last):
    attitude = recording.attitude
    middle = attitude.time[-1] / 2.0
    seldom = np.arange(len(attitude)) % 25 == 0
    keep = np.where((attitude.time > middle) == often_last, True, seldom)
    keep &= (attitude.time < 10.0) | (attitude.time > 13.0)
    changed = replace(recording, attitude=Series(attitude.time[keep], attitude.value[keep]))
    kept = readings(changed, 1)
    assert len(kept) > 0.9 * len(readings(recording, 1))
    assert not np.any((kept.time > 10.6) & (kept.time < 12.4))


def test_readings_near_a_change_of_calibration_are_left_out():
    changed = (ParameterChange(30.0, "COMPASS_OFS_X", 10.0),)
    kept = readings(Flown(seconds=60.0, changed=changed).recording(), 1)
    assert not np.any(np.abs(kept.time - 30.0) <= 1.5)
    assert kept.time.min() < 28.0 < 32.0 < kept.time.max()
    assert len(kept.in_force) == 2


def test_each_reading_is_undone_with_what_was_in_force_at_its_time():
    flown = Flown(seconds=60.0, noise=0.0, changed=(ParameterChange(30.0, "COMPASS_OFS_X", 10.0),))
    problem = flown.problem()
    samples = problem.sample(Lags(flown.field_lag, flown.current_lag))
    expected = flown.sensed_at(samples.time - flown.field_lag)
    assert np.abs(samples.raw - expected).max() < 1e-6


def test_start_and_end_cut_the_recording(recording):
    kept = readings(recording, 1, start=10.0, end=20.0)
    assert kept.time.min() >= 10.0
    assert kept.time.max() <= 20.0
    assert len(kept) == pytest.approx(100, abs=2)


def test_disarmed_time_is_left_out_where_there_is_enough_armed_time(recording):
    armed = Series(np.array([0.0, 10.0, 50.0, 60.0]), np.array([0.0, 1.0, 0.0, 0.0]))
    kept = readings(replace(recording, armed=armed), 1)
    assert kept.time.min() >= 10.0
    assert kept.time.max() < 50.0


@pytest.mark.parametrize("pause_s", [4.0, 5.5, 6.5, 9.0])
def test_a_short_pause_between_armed_stretches_is_kept(recording, pause_s):
    time = np.array([0.0, 10.0, 25.0, 25.0 + pause_s, 55.0, 60.0])
    armed = Series(time, np.array([0.0, 1.0, 0.0, 1.0, 0.0, 0.0]))
    kept = readings(replace(recording, armed=armed), 1)
    assert kept.time.min() >= 10.0
    paused = (kept.time > 25.1) & (kept.time < 24.9 + pause_s)
    assert paused.any() == (pause_s < 6.0)


@pytest.mark.parametrize("armed_s", [0.0, 20.0])
def test_disarmed_time_is_used_where_there_is_nothing_better(recording, armed_s):
    time = np.array([0.0, 10.0, 10.0 + armed_s, 60.0])
    armed = Series(time, np.array([0.0, 1.0 if armed_s else 0.0, 0.0, 0.0]))
    kept = readings(replace(recording, armed=armed), 1)
    assert len(kept) == len(readings(recording, 1))


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"start": 500.0}, "before the log ends at 60 s; instead received 500 s"),
        ({"end": -1.0}, "after the log begins at 0 s; instead received -1 s"),
    ],
)
def test_a_time_the_log_does_not_reach_is_told_where_it_ends(recording, asked, said):
    with pytest.raises(UsageError, match=said):
        readings(recording, 1, **asked)


def test_a_time_without_readings_says_so(recording):
    field = recording.field[1]
    late = field.time > 30.0
    silent = with_field(recording, field.time[late], field.value[late])
    with pytest.raises(MissingDataError, match=f"none of its {late.sum()} is there"):
        readings(silent, 1, end=20.0)


def test_a_log_of_hours_is_thinned_evenly_and_a_short_one_is_not(recording):
    every = readings(recording, 1)
    some = thinned(every, 100)
    assert thinned(every, len(every)) is every
    assert 50 < len(some) <= 100
    assert np.array_equal(some.time, every.time[:: -(-len(every) // 100)])
    assert some.attitude is every.attitude


# --- what is missing is named ----------------------------------------------------------


def test_a_compass_that_is_not_there_is_named_with_those_that_are(recording):
    with pytest.raises(MissingDataError, match="readings of compass 2; instead it holds compass 1"):
        readings(recording, 2)


@pytest.mark.parametrize("attitude", [None, Series(np.zeros(1), np.zeros((1, 3)))])
def test_no_attitude_is_named(recording, attitude):
    with pytest.raises(MissingDataError, match="attitude"):
        readings(replace(recording, attitude=attitude), 1)


def test_a_time_without_readings_is_named(recording):
    with pytest.raises(
        MissingDataError, match=r"usable .* from 59\.99 s, and the log ends at 60 s; "
    ):
        readings(recording, 1, start=59.99)


def test_a_motor_correction_in_force_without_its_control_quantity_is_named():
    in_force = {"COMPASS_MOTCT": 1.0, "COMPASS_MOT_X": 3.0}
    recording = Flown(seconds=60.0).recording()
    from_elsewhere = replace(
        recording,
        parameters=type(recording.parameters)(
            tuple(ParameterChange(0.0, n, v) for n, v in in_force.items())
        ),
    )
    found = controls(recording)
    with pytest.raises(MissingDataError, match="by throttle was in force"):
        sample(readings(from_elsewhere, 1), found[0], reported(found), Lags())


# --- samples at given lags ---------------------------------------------------------------


@pytest.mark.parametrize("kind", ["off", "current"])
def test_at_the_true_lags_the_exact_correction_leaves_nothing(kind):
    in_force = None
    if kind == "current":
        in_force = {
            "COMPASS_MOTCT": 2.0,
            **ardupilot.correction_parameters(
                replace(EXACT, motor=np.array([2.0, 0.5, -1.0])), 1, 1.0
            ),
        }
    flown = Flown(noise=0.0, in_force=in_force, current_hz=50.0)
    problem = problem_of(flown.recording())
    samples = problem.sample(Lags(flown.field_lag, flown.current_lag))
    field = EXACT.apply(samples.raw, samples.u)
    assert np.linalg.norm(field, axis=1) == pytest.approx(problem.earth.strength, abs=0.2)
    assert np.einsum("ij,ij->i", field, samples.down) == pytest.approx(
        problem.earth.vertical, abs=0.5
    )


def test_the_stated_rates_are_the_derivatives():
    flown = Flown(noise=0.0, current_hz=50.0, fast_s=5.0)
    problem, step = flown.problem(), 0.02
    here = problem.sample(Lags(0.07, 0.05))
    later = problem.sample(Lags(0.07 - step, 0.05 - step))
    earlier = problem.sample(Lags(0.07 + step, 0.05 + step))
    assert np.allclose(here.u_rate, (later.u - earlier.u) / (2 * step), atol=0.3)
    assert np.allclose(here.down_rate, (later.down - earlier.down) / (2 * step), atol=0.01)


# --- many changes ---------------------------------------------------------------------


def with_changes(recording: Recording, times: np.ndarray) -> Recording:
    """One change of an offset at each time, all values different."""
    made = (ParameterChange(float(t), "COMPASS_OFS_X", n / 8) for n, t in enumerate(times, 1))
    history = ParameterHistory((*recording.parameters.changes, *made))
    return replace(recording, parameters=history)


def test_the_cost_of_changes_is_that_of_the_readings_between_them(recording, monkeypatch):
    asked = []
    at = ardupilot.calibration_at

    def counted(*arguments):
        asked.append(arguments)
        return at(*arguments)

    monkeypatch.setattr(ardupilot, "calibration_at", counted)
    bursts = np.concatenate([np.linspace(t, t + 1.0, 2000) for t in (10.0, 25.0, 40.0)])
    kept = readings(with_changes(recording, bursts), 1)
    assert len(asked) <= 4
    assert len(kept.in_force) == 4
    for edge in (10.0, 25.0, 40.0):
        assert not ((kept.time > edge - 1.5) & (kept.time < edge + 2.5)).any()


def test_each_reading_falls_under_the_correction_of_its_time(recording):
    times = np.array([7.0, 9.0, 20.0, 21.0, 35.0, 59.0])
    changed = with_changes(recording, times)
    kept = readings(changed, 1)
    for time, stretch in zip(kept.time, kept.stretch, strict=True):
        assert np.abs(times - time).min() > 1.5
        expected = ardupilot.calibration_at(changed.parameters, 1, time).offset
        assert np.array_equal(kept.in_force[stretch].correction.offset, expected)
    last = changed.parameters.last("COMPASS_OFS_X", 0.0)
    assert kept.in_force[-1].correction.offset[0] == last
