"""A vector for each motor: found where the flight tells the motors apart, else taken as alike."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from synthetic import INTERFERENCE, earth
from unequal import VECTORS, Unequal

from magcomp.align import (
    controls,
    currents_of_motors,
    drawn_and_driven,
    readings,
    to_undo,
)
from magcomp.align.control import exponent_of
from magcomp.align.motors import drive_of_motors
from magcomp.fit import Problem, best_form, fit
from magcomp.fit.field_model import SIZE
from magcomp.fit.motors import contrasts, differences_of, no_surer_than
from magcomp.fit.robust import Estimate
from magcomp.judge import judge
from magcomp.judge.forms import forms, left_deg
from magcomp.model import CURRENT, Lags, Series

ALIKE = Unequal(seed=2, vectors=np.tile(INTERFERENCE, (4, 1)))


def problem_of(flown, motors):
    recording = flown.recording()
    found = controls(recording)
    forms = currents_of_motors(recording) if motors else [c for c in found if c.kind == CURRENT]
    new, in_force = readings(recording, 1), to_undo(recording, found)
    return best_form([Problem(new, form, in_force, earth()) for form in forms])


@cache
def fitted(flown_seed, apart=0.35):
    problem = problem_of(Unequal(seed=flown_seed, apart=apart), motors=True)
    return problem, fit(problem)


def left_in_flight(flown, problem, found):
    """Heading error against the truth, degrees, in all but a hundredth of the flight."""
    samples = problem.sample(Lags(flown.field_lag, found.lags.regressor))
    exact = flown.added_at(samples.time - flown.current_lag)
    corrected = found.correction.apply(samples.raw, samples.u)
    clean = (samples.raw + flown.exact.offset) @ flown.exact.soft_iron.T - exact
    return left_deg(corrected - clean, clean, samples)


def test_the_currents_of_the_motors_add_up_to_the_battery_and_follow_each_motor():
    flown = Unequal(seed=1)
    found = currents_of_motors(flown.recording())
    control = found[2]
    assert len({each.origin for each in found}) == len(found)
    middle = control.series.time[50:-50]
    true = flown.drawn_at(middle)
    found = control.series.value[50:-50]
    assert control.numbers == (1, 2, 3, 4)
    assert np.abs(found - true).max() < 0.06 * true.max()
    assert np.abs(control.total.value[50:-50] - flown.current_at(middle)).max() < 0.5


def with_controllers(flown, motors=(0, 1, 2, 3)):
    """Outputs that are alike for all motors, and speed controllers that read 5 % too little."""
    recording = flown.recording()
    time = np.arange(0.0, flown.seconds + 1.0, 0.1)
    rng = np.random.default_rng([flown.seed, 9])
    told = 0.95 * flown.drawn_at(time) + rng.normal(scale=0.1, size=(len(time), 4))
    outputs = recording.outputs.value.copy()
    outputs[:, :4] = outputs[:, :4].mean(axis=1, keepdims=True)
    return replace(
        recording,
        outputs=Series(recording.outputs.time, outputs),
        esc_currents={motor: Series(time, told[:, motor]) for motor in motors},
    )


def test_speed_controllers_that_report_every_motors_current_tell_it():
    flown = Unequal(seed=1)
    found = currents_of_motors(with_controllers(flown))
    assert all("shared out by the speed controllers" in each.origin for each in found)
    middle = found[0].series.time[50:-50]
    # Their own scale is not the battery's, by which the firmware multiplies.
    whole = found[0].total.value[50:-50] - flown.current_at(middle)
    each = found[0].series.value[50:-50] - flown.drawn_at(middle)
    assert np.sqrt(np.mean(whole**2)) < 0.4
    assert np.sqrt(np.mean(each**2)) < 0.15
    short = currents_of_motors(with_controllers(flown, motors=(0, 1, 2)))
    assert all("motor outputs" in each.origin for each in short)


def test_each_motors_vector_is_found_from_what_the_speed_controllers_report():
    recording = with_controllers(Unequal(seed=1))
    forms = currents_of_motors(recording)
    found = controls(recording)
    new, in_force = readings(recording, 1), to_undo(recording, found)
    by_motor = fit(best_form([Problem(new, form, in_force, earth()) for form in forms]))
    apart = np.linalg.norm(-by_motor.correction.motor.T - VECTORS, axis=1)
    assert np.all(apart < 0.07 * np.linalg.norm(VECTORS, axis=1))


def test_each_motors_vector_is_found_within_a_twentieth():
    _, found = fitted(1)
    apart = np.linalg.norm(-found.correction.motor.T - VECTORS, axis=1)
    assert np.all(apart < 0.05 * np.linalg.norm(VECTORS, axis=1))


def test_motor_by_motor_leaves_half_a_degree_where_one_current_leaves_three():
    flown = Unequal(seed=1)
    problem, found = fitted(1)
    single = problem_of(flown, motors=False)
    assert left_in_flight(flown, single, fit(single)) > 3.0
    assert left_in_flight(flown, problem, found) < 0.5


@pytest.mark.parametrize("seed", [2, 3])
def test_motors_that_are_alike_are_fitted_no_worse_than_by_one_current(seed):
    flown = replace(ALIKE, seed=seed)
    problem, single = (problem_of(flown, motors) for motors in (True, False))
    by_motor, by_current = fit(problem), fit(single)
    assert left_in_flight(flown, problem, by_motor) < 0.2
    assert left_in_flight(flown, problem, by_motor) < 0.1 + left_in_flight(
        flown, single, by_current
    )
    spread = np.ptp(by_motor.correction.motor, axis=1)
    assert spread.max() < 0.05 * np.linalg.norm(INTERFERENCE)


def test_a_vector_lies_within_what_its_covariance_allows():
    _, found = fitted(1)
    std = np.sqrt(np.diag(found.covariance))
    error = -found.correction.motor.T.reshape(-1) - VECTORS.reshape(-1)
    assert np.abs(error / np.concatenate([std[:3], std[12:]])).max() < 6.0


def test_a_flight_that_does_not_tell_the_motors_apart_says_what_to_fly():
    problem, found = fitted(1, 0.002)
    _, verdict = judge(problem, found)
    assert any("can hardly be told apart" in reason for reason in verdict.reasons)
    assert any("brisk" in reason for reason in verdict.reasons)
    _, told = judge(*fitted(1))
    assert not any("told apart" in reason for reason in told.reasons)


def test_what_differs_in_a_turn_asks_for_turns():
    problem, found = fitted(1)
    yaw = contrasts(4) @ np.array([1.0, 1.0, -1.0, -1.0]) / 2.0
    doubt = np.kron(np.outer(yaw, yaw), 25.0 * np.eye(3)) + 1e-6 * np.eye(9)
    _, verdict = judge(problem, replace(found, told_apart=doubt))
    assert any("fly turns that start and stop briskly" in reason for reason in verdict.reasons)


def best_of(flown):
    problem = problem_of(flown, motors=False)
    motors = currents_of_motors(flown.recording())[0]
    tried = forms(problem, fit(problem), motors, None)
    return {form.name: form for form in tried}, next(f.name for f in tried if f.is_best)


def test_the_simplest_form_that_explains_the_flight_is_the_best():
    assert best_of(ALIKE)[1] == CURRENT
    tried, best = best_of(Unequal(seed=1))
    assert best == "motors"
    assert tried[CURRENT].left_deg > 3.0
    assert tried["motors"].held_out < 0.5 * tried[CURRENT].held_out


def test_a_field_that_bends_with_the_current_is_seen_and_weighed():
    tried, best = best_of(replace(ALIKE, bend=3.0, swing=12.0))
    assert best == "curved current"
    _, slope, bend = np.array(tried["curved current"].curve)
    u = np.linspace(10.0, 40.0, 7)
    # 3 mGauss per A and per 50 A, along x.
    true = np.outer(u, INTERFERENCE) + np.outer(3.0 * u**2 / 50.0, [1.0, 0.0, 0.0])
    off = np.outer(u, slope) + np.outer(u**2, bend) - true
    # A straight line would be off by 9 mGauss.
    assert np.abs(off - off.mean(axis=0)).max() < 3.0
    assert tried[CURRENT].curve == ()
    assert 0.5 < tried[CURRENT].left_deg < 10.0


def test_motors_that_the_flight_does_not_tell_apart_are_taken_as_alike():
    problem = problem_of(replace(ALIKE, apart=0.01), motors=True)
    found = fit(problem)
    doubt = np.sqrt(np.diag(found.told_apart)).max()
    spread = np.ptp(found.correction.motor, axis=1).max()
    assert doubt > 0.2
    assert spread < 0.5 * doubt


def test_a_difference_that_the_flight_does_not_show_is_not_known_to_be_nothing():
    problem = problem_of(Unequal(seed=1), motors=True)
    alike = problem.control.series.value.copy()
    # Motors 1 and 2 always draw the same: what each adds cannot be known.
    alike[:, :2] = alike[:, :2].mean(axis=1, keepdims=True)
    series = replace(problem.control.series, value=alike)
    found = fit(replace(problem, control=replace(problem.control, series=series)))
    assert np.sqrt(np.diag(found.told_apart)).max() > 20.0


def test_differences_are_no_better_known_than_by_plain_least_squares():
    tell = differences_of(SIZE + 9)
    rng = np.random.default_rng(1)
    root = rng.normal(size=(SIZE + 9, SIZE + 9))
    sure = Estimate(np.zeros(len(root)), root @ root.T, np.ones(2), 0.0, np.zeros((4, 2)))
    plain = replace(sure, covariance=9.0 * sure.covariance)
    stretch = no_surer_than(plain, sure)
    wide = stretch @ sure.covariance @ stretch.T
    np.testing.assert_allclose(tell @ wide @ tell.T, tell @ plain.covariance @ tell.T)
    common = np.eye(len(root)) - tell.T @ tell
    np.testing.assert_allclose(common @ wide @ common, common @ sure.covariance @ common, atol=1e-9)
    np.testing.assert_array_equal(no_surer_than(sure, plain), np.eye(len(root)))


@pytest.mark.parametrize("exponent", [0.65, 1.0, 1.9])
def test_what_a_motor_draws_is_a_power_of_duty_and_volts_where_that_explains_no_less(exponent):
    flown = Unequal(seed=3, exponent=exponent, per_motor={"COMPASS_PMOT_EN": 0.0})
    recording = flown.recording()
    drive = drive_of_motors(recording).series
    found, _ = exponent_of(recording.current, drive, 0.0)
    assert found == pytest.approx(exponent, abs=0.02)
    drawn, driven = drawn_and_driven(recording)
    low = driven.series.value < 0.7 * driven.series.value.max()
    share, of_it = (
        np.log(each.series.value[low] / each.series.value.max()) for each in (drawn, driven)
    )
    assert np.median(share / of_it) == pytest.approx(exponent, abs=0.03)


def test_where_volts_explain_less_the_duties_alone_tell_it():
    flown = Unequal(seed=3, exponent=1.9)
    recording = flown.recording()
    volts = recording.voltage
    wrong = Series(volts.time, volts.value * (1.0 + 0.1 * np.sin(volts.time)))
    drawn, _ = drawn_and_driven(replace(recording, voltage=wrong))
    truth = flown.drawn_at(drawn.series.time)
    assert np.median(np.abs(drawn.series.value / truth - 1.0)) < 0.03
