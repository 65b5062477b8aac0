"""A compass mounted otherwise than its orientation says is named with the turn that it needs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import truth
from synthetic import Flown, Turned, problem_of

from magcomp.align import controls, expected_earth, readings, reported
from magcomp.align.orientation import orientation_complaint, right_turn
from magcomp.autopilots.rotations import named, number_of, right_angles, turn
from magcomp.fit import Problem
from magcomp.model import ParameterChange, ParameterHistory, Recording, Samples
from magcomp.sources import read


@pytest.fixture(scope="module")
def flown() -> tuple[Recording, Problem, Samples]:
    recording = Flown(seed=6, seconds=90.0, tilt=0.35).recording()
    problem = problem_of(recording)
    return recording, problem, problem.sample(problem.usual_lags())


def mounted(samples: Samples, turned: np.ndarray) -> Samples:
    """The readings of the same compass, which needs a turn to stand in the vehicle's axes."""
    return replace(samples, raw=samples.raw @ turned, present=samples.present @ turned)


def oriented(recording: Recording, number: float) -> Recording:
    values = {"COMPASS_DEV_ID": 97539.0, "COMPASS_ORIENT": number}
    changes = tuple(ParameterChange(0.0, name, value) for name, value in values.items())
    return replace(
        recording, parameters=ParameterHistory((*recording.parameters.changes, *changes))
    )


def test_there_are_24_turns_by_right_angles_and_each_is_a_rotation():
    turns = right_angles()
    assert len(turns) == 24
    for number, matrix in turns.items():
        assert np.array_equal(matrix @ matrix.T, np.eye(3))
        assert np.linalg.det(matrix) == pytest.approx(1.0)
        assert number_of(matrix) == number


def test_pitch_by_180_is_roll_and_yaw_by_180():
    assert number_of(turn(0, 180, 0)) == number_of(turn(180, 0, 180))
    assert named(10) == "roll 180° and yaw 90°"


@pytest.mark.parametrize("number", sorted(set(right_angles()) - {0}))
def test_each_turn_is_found_in_a_flight(flown, number):
    _, problem, samples = flown
    assert right_turn(mounted(samples, right_angles()[number]), problem.earth) == number


def test_a_compass_that_stands_as_it_says_needs_none(flown):
    _, problem, samples = flown
    assert right_turn(samples, problem.earth) is None


def test_turns_on_a_rig_are_found_too():
    problem = Turned(seed=1).problem()
    samples = problem.sample(problem.usual_lags())
    assert right_turn(samples, problem.earth) is None
    assert right_turn(mounted(samples, right_angles()[8]), problem.earth) == 8


def test_a_vehicle_that_hardly_leans_cannot_tell(flown):
    _, problem, samples = flown
    level = replace(samples, down=np.tile([0.0, 0.0, 1.0], (len(samples.time), 1)))
    assert right_turn(mounted(level, right_angles()[2]), problem.earth) is None
    # Upside down looks like an offset of twice the vertical field.
    assert right_turn(mounted(level, right_angles()[8]), problem.earth) is None


def test_the_orientation_to_set_comes_on_top_of_the_one_that_is(flown):
    recording, problem, samples = flown
    askew = mounted(samples, right_angles()[2])
    told = orientation_complaint(oriented(recording, 2.0), askew, problem.earth)
    assert told.startswith("compass 1 is not mounted as its orientation says: turned by yaw 90°")
    assert "set COMPASS_ORIENT to 4 (yaw 180°)" in told
    assert "set COMPASS_ORIENT to 2 (yaw 90°)" in orientation_complaint(
        oriented(recording, 0.0), askew, problem.earth
    )


def test_one_that_stands_as_it_says_is_left_in_peace(flown):
    recording, problem, samples = flown
    assert orientation_complaint(recording, samples, problem.earth) == ""


@pytest.mark.parametrize(
    "name", ["flight", "flight_uncalibrated", "turntable_paper", "sweep_current"]
)
def test_recordings_of_the_real_firmware_give_no_complaint(name):
    recording = read(truth.FIXTURES / f"{name}.tlog")
    found, earth = controls(recording), expected_earth(recording)
    for compass in recording.field:
        problem = Problem(readings(recording, compass), found[0], reported(found), earth)
        samples = problem.sample(problem.usual_lags())
        assert orientation_complaint(recording, samples, earth) == ""
