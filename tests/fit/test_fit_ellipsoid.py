"""Ellipsoids of raw field: centre, shape, outliers, honest covariance, and what rotating does."""

from __future__ import annotations

import numpy as np
import pytest
import truth
from hypothesis import given, settings
from hypothesis import strategies as st

from magcomp.errors import FitRejectedError
from magcomp.fit import fit_ellipsoid, fit_ellipsoids

STRENGTH = 500.0
CENTRE = np.array([-120.0, 45.0, 80.0])
SHAPE = np.array([[1.08, 0.04, -0.03], [0.04, 0.93, 0.02], [-0.03, 0.02, 1.01]])


def directions(rng: np.random.Generator, count: int) -> np.ndarray:
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def readings(
    rng: np.random.Generator,
    count: int = 400,
    noise: float = 2.0,
    centre: np.ndarray = CENTRE,
    shape: np.ndarray = SHAPE,
) -> np.ndarray:
    """Raw field turned over the whole sphere: D⁻¹ · field + centre, with noise."""
    field = STRENGTH * directions(rng, count)
    return field @ np.linalg.inv(shape).T + centre + rng.normal(scale=noise, size=(count, 3))


def rotation(rng: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


def test_exact_readings_give_the_exact_centre_and_shape():
    found = fit_ellipsoid(readings(np.random.default_rng(1), noise=0.0), STRENGTH)
    assert np.allclose(found.centres[0], CENTRE, atol=0.05)
    assert np.allclose(found.soft_iron, SHAPE, atol=2e-4)


@pytest.mark.parametrize("seed", range(10))
def test_noisy_readings_give_them_within_a_few_standard_errors(seed):
    found = fit_ellipsoid(readings(np.random.default_rng(seed)), STRENGTH)
    std = np.sqrt(np.diag(found.covariance))
    assert np.all(np.abs(found.centres[0] - CENTRE) < 4.5 * std[6:9])
    assert found.noise == pytest.approx(2.0, rel=0.2)


def test_the_covariance_is_what_repetition_shows():
    """Squared errors weighed by the stated covariance average to the number of parameters."""
    squares, of_centre = [], []
    for seed in range(80):
        found = fit_ellipsoid(readings(np.random.default_rng(seed)), STRENGTH)
        error = np.concatenate(
            [
                found.soft_iron[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
                - SHAPE[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
                found.centres[0] - CENTRE,
            ]
        )
        squares.append(error @ np.linalg.solve(found.covariance, error))
        of_centre.append(error[6:] @ np.linalg.solve(found.centre_covariance(0), error[6:]))
    # χ² of 9 degrees: mean 9, and the mean of 80 within 3 · √(18 / 80); 25 % for the estimate.
    assert 9.0 / 1.25 - 1.4 < np.mean(squares) < 9.0 * 1.25 + 1.4
    assert 3.0 / 1.25 - 0.8 < np.mean(of_centre) < 3.0 * 1.25 + 0.8


@pytest.mark.parametrize("share", [0.05, 0.1])
def test_wild_readings_do_not_move_it(share):
    rng = np.random.default_rng(3)
    raw = readings(rng)
    wild = rng.random(len(raw)) < share
    raw[wild] += rng.normal(scale=300.0, size=(int(wild.sum()), 3))
    found = fit_ellipsoid(raw, STRENGTH)
    assert np.linalg.norm(found.centres[0] - CENTRE) < 1.0
    assert np.abs(found.soft_iron - SHAPE).max() < 0.005


def test_levels_share_a_shape_and_have_a_centre_each():
    rng = np.random.default_rng(4)
    centres = CENTRE + np.multiply.outer([0.0, 30.0, 50.0], [1.5, -0.8, 2.0])
    raw = np.concatenate([readings(rng, 200, centre=c) for c in centres])
    found = fit_ellipsoids(raw, np.repeat(np.arange(3), 200), STRENGTH)
    assert np.linalg.norm(found.centres - centres, axis=1).max() < 1.5
    for index in range(3):
        std = np.sqrt(np.diag(found.centre_covariance(index)))
        assert np.all(np.abs(found.centres[index] - centres[index]) < 4.5 * std)


def test_a_level_turned_about_one_axis_borrows_the_shape_of_the_others():
    rng = np.random.default_rng(5)
    whole = readings(rng, 300)
    turn = np.linspace(0, 2 * np.pi, 200)
    tilt = 0.35 * np.sin(3 * turn)
    ring = STRENGTH * np.column_stack(
        [np.cos(turn) * np.cos(tilt), np.sin(turn) * np.cos(tilt), np.sin(tilt)]
    )
    moved = CENTRE + np.array([40.0, -10.0, 15.0])
    partial = ring @ np.linalg.inv(SHAPE).T + moved + rng.normal(scale=2.0, size=ring.shape)
    raw = np.concatenate([whole, partial])
    level = np.repeat([0, 1], [300, 200])
    found = fit_ellipsoids(raw, level, STRENGTH)
    std = np.sqrt(np.diag(found.centre_covariance(1)))
    assert np.all(np.abs(found.centres[1] - moved) < 4.5 * std)
    assert std[2] > std[0]


def test_more_readings_of_a_level_make_its_centre_sharper():
    rng = np.random.default_rng(6)
    raw = np.concatenate([readings(rng, 100), readings(rng, 1600)])
    found = fit_ellipsoids(raw, np.repeat([0, 1], [100, 1600]), STRENGTH)
    few, many = (np.sqrt(np.trace(found.centre_covariance(k))) for k in (0, 1))
    assert 2.0 < few / many < 6.0  # √16, but for the shared shape and the scatter of estimates


@given(st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_turning_the_body_turns_the_centre_and_conjugates_the_shape(seed):
    rng = np.random.default_rng(seed)
    raw, turn = readings(rng, 150), rotation(rng)
    before, after = fit_ellipsoid(raw, STRENGTH), fit_ellipsoid(raw @ turn.T, STRENGTH)
    assert np.allclose(after.centres[0], turn @ before.centres[0], atol=0.1)
    assert np.allclose(after.soft_iron, turn @ before.soft_iron @ turn.T, atol=5e-4)


@given(st.integers(0, 10**6), st.floats(0.3, 3.0))
@settings(max_examples=15, deadline=None)
def test_a_stronger_earth_scales_the_centre_and_leaves_the_shape(seed, scale):
    raw = readings(np.random.default_rng(seed), 150)
    before, after = (fit_ellipsoid(k * raw, k * STRENGTH) for k in (1.0, scale))
    assert np.allclose(after.centres[0], scale * before.centres[0], atol=0.1 * scale)
    assert np.allclose(after.soft_iron, before.soft_iron, atol=5e-4)


@given(st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_the_order_of_the_readings_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    raw = readings(rng, 150)
    before, after = fit_ellipsoid(raw, STRENGTH), fit_ellipsoid(rng.permutation(raw), STRENGTH)
    assert np.allclose(after.centres, before.centres, atol=1e-5)
    assert np.allclose(after.soft_iron, before.soft_iron, atol=1e-7)


def test_too_few_readings_are_refused_in_one_sentence():
    with pytest.raises(FitRejectedError, match="at least 12 readings; instead received 5"):
        fit_ellipsoid(np.ones((5, 3)), STRENGTH)


def test_a_compass_that_says_the_same_all_the_time_is_refused_in_one_sentence():
    stuck = np.full((50, 3), 100.0) + np.random.default_rng(7).normal(size=(50, 3))
    for raw in (np.full((50, 3), 100.0), stuck):
        with pytest.raises(FitRejectedError, match="needs readings from all round"):
            fit_ellipsoid(raw, STRENGTH)


def test_readings_on_a_straight_line_come_with_their_doubt():
    found = fit_ellipsoid(np.outer(np.linspace(-1, 1, 50), [400.0, 200.0, 80.0]), STRENGTH)
    assert np.sqrt(np.trace(found.centre_covariance(0))) > 0.2 * STRENGTH


def test_the_shape_is_always_symmetric_and_never_mirrored():
    rng = np.random.default_rng(8)
    for _ in range(10):
        shape = np.diag(rng.uniform(0.7, 1.4, 3))
        found = fit_ellipsoid(readings(rng, 100, noise=20.0, shape=shape), STRENGTH)
        assert np.array_equal(found.soft_iron, found.soft_iron.T)
        assert np.linalg.eigvalsh(found.soft_iron)[0] > 0


REAL = truth.REAL / "ellipsoid_qmc5883l.csv"


@pytest.mark.skipif(not REAL.exists(), reason="the real readings are not on this machine")
def test_a_real_sensor_turned_by_hand():
    raw = np.loadtxt(REAL, delimiter=",", skiprows=3)
    strength = float(np.median(np.linalg.norm(raw - np.median(raw, axis=0), axis=1)))
    found = fit_ellipsoid(raw, strength)
    assert np.linalg.norm(found.centres[0] - [6159.0, 253.0, 3446.0]) < 0.02 * strength
