"""The flight fit and the choice of method on recordings made of formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import EXACT, INTERFERENCE, NOTHING, Flown, problem_of

from magcomp.autopilots import ardupilot
from magcomp.earth import EarthField
from magcomp.errors import FitRejectedError, MissingDataError, UsageError
from magcomp.fit import Problem, fit
from magcomp.fit.field_model import SIZE, lags_of, strength_and_dip
from magcomp.fit.flight import TRUSTED_OFFSET_MGAUSS, TRUSTED_SOFT_IRON, is_physical, prior
from magcomp.model import MotorFit, Series, pack


def weighed(found: MotorFit, names: slice) -> float:
    """Squared error in units of the stated covariance, per parameter."""
    error = (pack(found.correction) - pack(EXACT))[names]
    covariance = found.covariance[names, names]
    return float(error @ np.linalg.solve(covariance, error)) / len(error)


# --- what was put in comes out ------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_a_calibrated_flight_gives_the_motor_vector(seed):
    found = fit(Flown(seed=seed).problem(), "flight")
    assert found.free == {"motor"}
    assert np.linalg.norm(found.interference - INTERFERENCE) < 0.03 * np.linalg.norm(INTERFERENCE)
    assert weighed(found, slice(0, 3)) < 6.0


@pytest.mark.parametrize("seed", range(3))
def test_an_uncalibrated_flight_that_tilts_gives_hard_and_soft_iron_too(seed):
    flown = Flown(seed=seed, in_force=NOTHING, seconds=400.0, tilt=0.35)
    found = fit(flown.problem(), "flight")
    assert found.free == {"motor", "offset", "diagonal", "off-diagonal"}
    assert np.abs(found.correction.soft_iron - EXACT.soft_iron).max() < 0.02
    assert np.linalg.norm(found.correction.offset - EXACT.offset) < 6.0
    assert np.linalg.norm(found.interference - INTERFERENCE) < 0.06 * np.linalg.norm(INTERFERENCE)


@pytest.mark.parametrize("later", [0.05, 0.2])
def test_a_wrong_motor_compensation_in_force_is_undone_first_with_the_lag_it_had(later):
    wrong = {
        "COMPASS_MOTCT": 2.0,
        **ardupilot.correction_parameters(replace(EXACT, motor=np.array([3.0, 2.0, -1.0])), 1, 1.0),
    }
    plain = fit(Flown(seed=2, current_hz=25.0).problem(), "flight")
    flown = Flown(seed=2, in_force=wrong, current_hz=25.0, applied_later=later)
    undone = fit(flown.problem(), "flight")
    difference = np.linalg.norm(undone.interference - plain.interference)
    assert difference < 0.01 * np.linalg.norm(INTERFERENCE)
    assert undone.lags.applied == pytest.approx(flown.current_lag + later, abs=0.02)


def test_a_field_that_follows_the_current_blurred_leaves_the_motor_vector_its_length():
    """What passes too fast for compass and motors is not taken for a smaller slope."""
    fast = {"seed": 4, "current_hz": 25.0, "fast_s": 0.8, "noise": 0.5}
    sharp, blurred = (fit(Flown(**fast, blur=s).problem(), "flight") for s in (0.0, 0.15))
    shorter = 1.0 - np.linalg.norm(blurred.interference) / np.linalg.norm(sharp.interference)
    assert abs(shorter) < 0.005


def test_the_covariance_of_a_flight_is_what_repetition_shows():
    weights = [
        weighed(fit(Flown(seed=100 + s, seconds=90.0).problem(), "flight"), slice(0, 3))
        for s in range(12)
    ]
    # The prior of a trusted hard iron is wider than these recordings' error, so less than 1 is
    # honest; three times is not.
    assert 0.05 < np.mean(weights) < 2.0


def test_wild_readings_do_not_move_the_answer():
    recording = Flown(seed=5).recording()
    field = recording.field[1]
    rng = np.random.default_rng(5)
    value = field.value.copy()
    wild = rng.random(len(value)) < 0.05
    value[wild] += rng.normal(scale=200.0, size=(int(wild.sum()), 3))
    clean = fit(problem_of(recording), "flight")
    dirty = fit(problem_of(replace(recording, field={1: Series(field.time, value)})), "flight")
    moved = np.linalg.norm(dirty.interference - clean.interference)
    assert moved < 0.02 * np.linalg.norm(INTERFERENCE)


@pytest.mark.parametrize("seed", range(4))
def test_a_poor_flight_leans_on_the_calibration_in_force(seed):
    """Hardly tilted, hardly turned: strength and dip alone cannot tell the offsets."""
    found = fit(Flown(seed=seed, seconds=40.0, tilt=0.03, noise=3.0).problem(), "flight")
    assert np.linalg.norm(found.correction.offset - EXACT.offset) < 3 * TRUSTED_OFFSET_MGAUSS
    assert np.allclose(found.correction.soft_iron, EXACT.soft_iron, atol=TRUSTED_SOFT_IRON)


# --- the model's derivatives -----------------------------------------------------------------


@pytest.mark.parametrize("compensated", [False, True], ids=["off", "current in force"])
def test_the_stated_derivatives_are_those_of_the_residuals(compensated):
    """All 24: motor, offset, soft iron, strength, dip, the lags, tilt, lean and blur."""
    in_force = None
    if compensated:
        wrong = replace(EXACT, motor=np.array([3.0, 2.0, -1.0]))
        in_force = {"COMPASS_MOTCT": 2.0, **ardupilot.correction_parameters(wrong, 1, 1.0)}
    # Slow and finely sampled, so that half a step of a lag is as smooth as the formulas.
    flown = Flown(in_force=in_force, noise=0.0, current_hz=50.0, slow_s=30.0, fast_s=10.0)
    problem = flown.problem()
    at = prior(problem, 4).mean
    at[:12] = pack(EXACT)

    def residuals(parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return strength_and_dip(problem.sample(lags_of(parameters)), parameters)

    _, stated = residuals(at)
    steps = np.concatenate(
        [
            np.full(3, 1e-3),
            np.full(3, 1e-2),
            np.full(6, 1e-5),
            [1e-2, 1e-5, 0.04, 0.04, 0.04],
            np.full(7, 1e-3),
        ]
    )
    inside = slice(10, -10)
    for index, step in enumerate(steps):
        shift = step * np.eye(SIZE)[index]
        measured = (residuals(at + shift)[0] - residuals(at - shift)[0]) / (2 * step)
        error = np.abs(measured - stated[:, :, index])[inside]
        assert error.max() <= 0.03 * np.abs(measured).max() + 1e-6, index


# --- what rotating, scaling and shuffling do --------------------------------------------------


def quarter_turn() -> np.ndarray:
    """Body axes x → y, y → −x: keeps z, so roll and pitch can be told in the new axes."""
    return np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def test_a_compass_in_stronger_earth_gives_a_vector_as_much_longer():
    problem = Flown(seed=6, in_force=NOTHING, seconds=300.0, tilt=0.35).problem()
    scale = 1.7
    readings, earth = problem.readings, problem.earth
    in_force = replace(
        readings.in_force[0],
        correction=replace(
            readings.in_force[0].correction, offset=scale * readings.in_force[0].correction.offset
        ),
    )
    stronger = Problem(
        replace(readings, reported=scale * readings.reported, in_force=(in_force,)),
        problem.control,
        problem.in_force,
        EarthField(scale * earth.strength, earth.dip, earth.declination),
    )
    before, after = fit(problem, "flight"), fit(stronger, "flight")
    assert np.allclose(after.interference, scale * before.interference, rtol=0.02, atol=0.02)
    assert np.allclose(after.correction.soft_iron, before.correction.soft_iron, atol=0.005)


def test_turning_the_sensor_about_the_vertical_turns_the_answer_with_it():
    flown = Flown(seed=7)
    recording = flown.recording()
    turn = quarter_turn()
    field = recording.field[1]
    turned_calibration = replace(
        EXACT,
        offset=turn @ EXACT.offset,
        soft_iron=turn @ EXACT.soft_iron @ turn.T,
        motor=np.zeros(3),
    )
    values = {"COMPASS_MOTCT": 0.0, **ardupilot.correction_parameters(turned_calibration, 1, 1.0)}
    # The new body's attitude: its down vector is the old one turned, its heading 90° less.
    roll, pitch, yaw = recording.attitude.value.T
    old_down = np.stack(
        [-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)], axis=1
    )
    down = old_down @ turn.T
    attitude = np.stack([np.arctan2(down[:, 1], down[:, 2]), -np.arcsin(down[:, 0]), yaw], axis=1)
    turned = replace(
        Flown(seed=7, in_force=values).recording(),
        field={1: Series(field.time, field.value @ turn.T)},
        attitude=Series(recording.attitude.time, attitude),
    )
    before, after = fit(problem_of(recording), "flight"), fit(problem_of(turned), "flight")
    assert np.allclose(after.interference, turn @ before.interference, atol=0.01)


def test_the_order_of_the_blocks_of_time_does_not_matter():
    """The second half told first is the same flight."""
    flown = Flown(seed=8, seconds=200.0)
    recording = flown.recording()

    def swapped(series: Series) -> Series:
        time = np.where(series.time < 100.0, series.time + 110.0, series.time - 100.0)
        order = np.argsort(time, kind="stable")
        return Series(time[order], series.value[order])

    other = replace(
        recording,
        field={1: swapped(recording.field[1])},
        attitude=swapped(recording.attitude),
        current=swapped(recording.current),
    )
    before, after = fit(problem_of(recording), "flight"), fit(problem_of(other), "flight")
    assert np.allclose(after.interference, before.interference, atol=0.02)


# --- a mirror --------------------------------------------------------------------------------


@pytest.mark.parametrize("mirror", [np.diag([-1.0, -1.0, 1.0]), -np.eye(3)])
def test_a_mirrored_soft_iron_is_no_answer(mirror):
    problem = Flown(seed=9).problem()
    parameters = prior(problem, 4).mean.copy()
    assert is_physical(parameters)
    parameters[:12] = pack(replace(EXACT, soft_iron=mirror @ EXACT.soft_iron))
    assert not is_physical(parameters)


@pytest.mark.parametrize("seed", range(4))
def test_the_soft_iron_that_comes_out_is_positive_definite(seed):
    exact = replace(EXACT, soft_iron=np.diag([0.75, 1.25, 1.1]))
    flown = Flown(seed=seed, exact=exact, in_force=NOTHING, tilt=0.3, seconds=240.0, noise=6.0)
    found = fit(flown.problem(), "flight")
    assert np.linalg.eigvalsh(found.correction.soft_iron)[0] > 0.3


# --- methods -----------------------------------------------------------------------------------


def test_a_method_that_does_not_exist_is_refused_with_those_that_do():
    with pytest.raises(UsageError, match="auto, sweep, levels, flight; instead received guess"):
        fit(Flown(seconds=30.0).problem(), "guess")


def test_too_few_readings_are_refused():
    with pytest.raises(MissingDataError, match="at least 60 new readings; instead it has"):
        fit(Flown(seconds=6.0).problem())


def test_levels_without_turns_at_steady_levels_are_refused_in_one_sentence():
    with pytest.raises(FitRejectedError, match="turns about all axes") as caught:
        fit(Flown(seed=1).problem(), "levels")
    assert "\n" not in str(caught.value)


def test_a_sweep_in_flight_is_refused_because_the_vehicle_turned():
    """Field against current without a standstill would take every turn for interference."""
    with pytest.raises(FitRejectedError, match="stand still") as caught:
        fit(Flown(seed=1).problem(), "sweep")
    assert "\n" not in str(caught.value)
