"""The paper's method: turns at steady levels, a centre each, and the line through them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import recordings
from synthetic import EXACT, INTERFERENCE, Flown, Turned, drifting, problem_of

from magcomp.errors import FitRejectedError
from magcomp.fit import fit
from magcomp.fit.levels import drift_of_centres, fit_levels, through_centres, usable_levels
from magcomp.fit.wander import Wander
from magcomp.model import MOTOR, OFFSET, Lags, MotorFit, Series, pack

UNCALIBRATED = {"COMPASS_MOTCT": 0.0}
RIG = {"in_force": UNCALIBRATED, "noise": 1.5}


class Hasty(Turned):
    """Turned by hand: every way round at each level, but never far over."""

    def attitude_at(self, time):
        return super().attitude_at(time) * np.array([0.45, 0.5, 1.0])


def turned(seed: int = 1, **parts: object) -> MotorFit:
    return fit(Turned(seed=seed, **(RIG | parts)).problem(), "levels")


@pytest.mark.parametrize("seed", range(5))
def test_hard_iron_soft_iron_and_motors_come_out_of_turns_at_three_levels(seed):
    found = turned(seed)
    assert np.linalg.norm(found.interference - INTERFERENCE) < 0.02 * np.linalg.norm(INTERFERENCE)
    assert np.linalg.norm(found.correction.offset - EXACT.offset) < 2.0
    assert np.abs(found.correction.soft_iron - EXACT.soft_iron).max() < 0.01


def test_there_is_a_centre_for_each_level_and_the_line_is_straight():
    found = turned(levels=(0.5, 12.0, 25.0, 35.0, 45.0), seconds=400.0)
    assert [round(level.u, 1) for level in found.levels] == [0.5, 12.0, 25.0, 35.0, 45.0]
    assert found.line.straightness > 0.999
    for level in found.levels:
        std = np.sqrt(np.trace(level.covariance))
        assert np.linalg.norm(level.centre - EXACT.centre(level.u)) < 4 * std


def test_the_covariance_is_what_repetition_shows():
    weights, of_motor = [], []
    for seed in range(16):
        found = turned(seed)
        error = pack(found.correction) - pack(EXACT)
        weights.append(error @ np.linalg.solve(found.covariance, error) / 12)
        of_motor.append(np.mean(error[MOTOR] ** 2 / np.diag(found.covariance)[MOTOR]))
    # Mean of 16 χ²₁₂ / 12 is good to 0.1; a factor of two either way is an honest covariance.
    assert 0.5 < np.mean(weights) < 2.0
    assert 0.4 < np.mean(of_motor) < 2.0


def test_wild_readings_do_not_move_the_answer():
    recording = Turned(seed=2, **RIG).recording()
    rng = np.random.default_rng(2)
    field = recording.field[1]
    value = field.value.copy()
    wild = rng.random(len(value)) < 0.05
    value[wild] += rng.normal(scale=200.0, size=(int(wild.sum()), 3))
    dirty = replace(recording, field={1: Series(field.time, value)})
    clean, found = (fit(problem_of(r), "levels") for r in (recording, dirty))
    moved = np.linalg.norm(found.interference - clean.interference)
    assert moved < 0.02 * np.linalg.norm(INTERFERENCE)


def test_turning_the_sensor_turns_centres_line_and_soft_iron():
    """Strength knows no attitude, so any rotation of the sensor may be tried."""
    rng = np.random.default_rng(3)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    recording = Turned(seed=3, **RIG).recording()
    field = recording.field[1]
    other = replace(recording, field={1: Series(field.time, field.value @ turn.T)})
    before, after = (fit(problem_of(r), "levels") for r in (recording, other))
    assert np.allclose(after.interference, turn @ before.interference, atol=0.01)
    assert np.allclose(after.correction.offset, turn @ before.correction.offset, atol=0.2)
    assert np.allclose(
        after.correction.soft_iron, turn @ before.correction.soft_iron @ turn.T, atol=1e-3
    )


def test_one_level_is_refused_and_counted():
    class Briefly(Turned):
        def current_at(self, time: np.ndarray) -> np.ndarray:
            return np.where(time < self.seconds - 5.0, 0.5, 45.0)

    with pytest.raises(FitRejectedError, match="instead the log holds 1") as caught:
        fit(Briefly(seconds=80.0, **RIG).problem(), "levels")
    assert "\n" not in str(caught.value)


def test_turns_about_one_axis_only_are_no_turns_about_all_axes():
    class Flat(Turned):
        def attitude_at(self, time: np.ndarray) -> np.ndarray:
            return super().attitude_at(time) * [0.0, 0.0, 1.0]

    with pytest.raises(FitRejectedError, match="turns about all axes"):
        fit(Flat(**RIG).problem(), "levels")


def test_the_lags_are_estimated_though_the_centres_do_not_need_them():
    found = turned(field_lag=0.12)
    assert abs(found.lags.field - 0.12) < 3 * found.lags_std.field
    assert found.lags_std.field < 0.02


@pytest.mark.parametrize(("name", "count"), [("turntable_paper", 3), ("turntable_five_levels", 5)])
def test_auto_takes_levels_for_a_turntable_and_says_why(name, count):
    found = recordings.result(name, 1).fit
    assert found.method == "levels"
    assert len(found.levels) == count
    assert found.why == f"the vehicle was turned at {count} steady levels of current"


def test_auto_takes_levels_for_turns_made_of_formulas():
    assert fit(Turned(**RIG).problem()).method == "levels"


def test_auto_takes_gravity_too_where_turns_leave_the_centres_uncertain():
    """Ellipsoids of caps are loose along their axis; the flight's second residual is not."""

    def missed(found: MotorFit) -> float:
        return float(np.linalg.norm(found.correction.centre(45.0) - EXACT.centre(45.0)))

    problems = [Hasty(seed=seed, **RIG).problem() for seed in range(3)]
    found, by_levels = ([fit(p, method) for p in problems] for method in ("auto", "levels"))
    assert {each.method for each in found} == {"flight"}
    assert all("steady levels" in each.why for each in found)
    assert sum(map(missed, found)) < 0.7 * sum(map(missed, by_levels))


def test_a_turntable_can_be_fitted_as_a_flight_too():
    problem = Turned(seed=4, **RIG).problem()
    found = fit(problem, "flight")
    assert found.method == "flight"
    assert np.linalg.norm(found.interference - INTERFERENCE) < 0.03 * np.linalg.norm(INTERFERENCE)


def test_samples_of_unsteady_current_belong_to_no_level():
    problem = Flown(seed=1).problem()
    assert len(problem.sample(Lags())) > 0
    with pytest.raises(FitRejectedError):
        fit(problem, "levels")


def test_the_covariance_holds_what_a_sensor_drifts_from_level_to_level():
    weights = []
    for seed in range(10):
        recording = drifting(Turned(seed=seed, **RIG).recording(), seed)
        found = fit(problem_of(recording), "levels")
        error = (pack(found.correction) - pack(EXACT))[OFFSET]
        weights.append(np.mean(error**2 / np.diag(found.covariance)[OFFSET]))
    assert 0.3 < np.mean(weights) < 2.5


def test_without_drift_the_covariance_of_centres_stays_that_of_the_noise():
    still, moved = Wander(drift_mgauss=0.2), Wander(drift_mgauss=3.0)
    problem = Turned(seed=1, **RIG).problem()
    rows, level = usable_levels(problem)
    ellipsoids = fit_levels(problem, rows, level)[1]
    drifts = (drift_of_centres(rows.time, level, each) for each in (still, moved))
    least, more = (
        through_centres(problem, rows, level, ellipsoids.drifting(drift)) for drift in drifts
    )
    assert np.allclose(pack(least.correction), pack(more.correction), rtol=1e-2, atol=0.5)
    of_offset = [np.diag(each.covariance)[OFFSET].mean() for each in (least, more)]
    assert of_offset[1] > 3.0 * of_offset[0]


class Partly(Turned):
    """Two low levels held, and then a flight at a multiple of them."""

    def current_at(self, time):
        until = 0.7 * self.seconds
        held = np.where(time < until / 2.0, *self.levels)
        wave = np.sin(time / 2.1) + np.sin(time / 5.3)
        return np.where(time < until, held, 32.0 + 6.0 * wave)


def test_levels_held_at_a_part_of_the_current_are_not_taken_for_sure_at_the_top():
    made = Partly(seed=1, seconds=300.0, levels=(1.0, 8.0), **RIG)
    found = fit(problem_of(made.recording()), "auto")
    assert len(usable_levels(made.problem())[0]) > 0.4 * len(made.problem().readings)
    assert found.method == "flight"
