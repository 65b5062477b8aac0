"""A vehicle that stands still while its motors work: the field against the current, directly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import recordings
from synthetic import EXACT, INTERFERENCE, Flown, Swept, drifting, problem_of

from magcomp.errors import FitRejectedError
from magcomp.fit import fit, is_still
from magcomp.model import MOTOR, Lags, MotorFit, Series

SIZE = float(np.linalg.norm(INTERFERENCE))


@pytest.mark.parametrize("seed", range(5))
def test_the_motor_vector_comes_out_in_the_corrected_field(seed):
    found = fit(Swept(seed=seed).problem(), "sweep")
    assert np.linalg.norm(found.interference - INTERFERENCE) < 0.01 * SIZE
    assert found.free == {"motor"}


def test_hard_and_soft_iron_in_force_stay_because_a_sweep_cannot_see_them():
    found = fit(Swept().problem(), "sweep")
    assert np.allclose(found.correction.offset, EXACT.offset, atol=1e-4)
    assert np.allclose(found.correction.soft_iron, EXACT.soft_iron, atol=1e-6)


def test_the_answer_does_not_depend_on_where_the_nose_points():
    found = [fit(Swept(heading=h).problem(), "sweep").interference for h in (0.0, 1.5, 3.0, 4.5)]
    assert np.ptp(found, axis=0).max() < 0.01 * SIZE


def test_the_scatter_over_repetitions_is_within_the_stated_error():
    found = [fit(Swept(seed=s).problem(), "sweep") for s in range(16)]
    error = np.array([f.interference - INTERFERENCE for f in found])
    stated = np.mean([np.diag(f.covariance)[MOTOR] for f in found], axis=0)
    assert np.all(np.mean(error**2, axis=0) < 1.5 * stated)


@pytest.mark.parametrize("lag", [0.0, 0.1, 0.25])
def test_the_lag_of_the_current_comes_out_of_ramps(lag):
    class Ramped(Swept):
        def current_at(self, time: np.ndarray) -> np.ndarray:
            return 20.0 + 18.0 * np.sin(2 * np.pi * time / 8.0)

    found = fit(Ramped(current_lag=lag, current_hz=25.0).problem(), "sweep")
    assert abs(found.lags.regressor - lag) < 3.5 * found.lags_std.regressor
    assert found.lags_std.regressor < 0.02
    assert np.isnan(found.lags.field)  # nothing turned


@pytest.mark.parametrize("lag", [0.0, 0.1, 0.3])
def test_sudden_steps_hide_the_lag_but_not_the_vector(lag):
    found = fit(Swept(current_lag=lag, current_hz=4.0).problem(), "sweep")
    assert np.linalg.norm(found.interference - INTERFERENCE) < 0.01 * SIZE


def test_wild_readings_do_not_move_the_answer():
    recording = Swept(seed=2).recording()
    rng = np.random.default_rng(2)
    value = recording.field[1].value.copy()
    wild = rng.random(len(value)) < 0.05
    value[wild] += rng.normal(scale=300.0, size=(int(wild.sum()), 3))
    dirty = replace(recording, field={1: Series(recording.field[1].time, value)})
    found = fit(problem_of(dirty), "sweep")
    assert np.linalg.norm(found.interference - INTERFERENCE) < 0.015 * SIZE


def test_a_current_that_stays_is_refused_in_one_sentence():
    class Steady(Swept):
        def current_at(self, time: np.ndarray) -> np.ndarray:
            return np.where(time < 0.5, 19.0, 20.0)

    with pytest.raises(FitRejectedError, match="must change during a sweep; instead it stayed"):
        fit(Steady().problem(), "sweep")


def test_standing_still_is_told_from_flying_by_tilt_and_by_the_field_not_by_the_heading():
    assert is_still(Swept().problem().sample(Lags()))
    assert not is_still(Flown().problem().sample(Lags()))

    class Turning(Swept):
        def attitude_at(self, time: np.ndarray) -> np.ndarray:
            return super().attitude_at(time) + np.outer(time, [0.0, 0.0, 0.2])

    assert not is_still(Turning().problem().sample(Lags()))


@pytest.mark.parametrize(
    ("name", "quantity"), [("sweep_current", "current"), ("sweep_throttle_only", "throttle")]
)
def test_auto_takes_a_sweep_for_a_sweep_and_says_why(name, quantity):
    found = recordings.result(name, 1).fit
    assert found.method == "sweep"
    assert found.why.startswith(f"the vehicle stood still while the {quantity} changed")


def test_a_sweep_holds_no_turns_for_the_method_of_levels():
    with pytest.raises(FitRejectedError, match="turns about all axes") as caught:
        fit(Swept().problem(), "levels")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("lag", [0.05, 0.3])
def test_the_lag_of_a_sweep_in_sudden_steps_lies_within_three_standard_errors(lag):
    found = fit(Swept(current_lag=lag).problem(), "sweep")
    assert abs(found.lags.regressor - lag) < 3 * found.lags_std.regressor


def drifted(seed: int) -> MotorFit:
    """One slow sweep up and down of a sensor that drifts."""
    made = Slowly(seed=seed)
    return fit(problem_of(drifting(made.recording(), seed, size=3.0)), "sweep")


class Slowly(Swept):
    def current_at(self, time: np.ndarray) -> np.ndarray:
        return 1.0 + 20.0 * np.clip(1.0 - np.abs(time / 50.0 - 1.0), 0.0, 1.0)


def test_a_drift_that_looks_like_the_current_is_in_the_stated_error():
    found = [drifted(seed) for seed in range(12)]
    error = np.array([f.interference - INTERFERENCE for f in found])
    stated = np.array([np.diag(f.covariance)[MOTOR] for f in found])
    # From the readings and the soft iron alone it is 31.
    assert 0.3 < np.mean(error**2 / stated) < 5.0


def test_no_drift_is_made_of_a_current_that_is_told_late():
    """What passes within seconds is not drift: the vector stays as sure as it is."""
    found = fit(Swept(current_hz=1.0).problem(), "sweep")
    assert np.sqrt(np.diag(found.covariance)[MOTOR]).max() < 0.01 * SIZE
