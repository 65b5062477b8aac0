"""Motor vectors of several flights: the true mean, the true scatter, and changes that are real."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import special

from magcomp.fleet.matrices import is_definite
from magcomp.fleet.pooled import (
    SURE,
    chances_apart,
    change,
    changes,
    distances,
    pool,
    pools,
)

TRUTH = np.array([-1.4, 0.8, -1.9])


def flights(
    rng: np.random.Generator, count: int, scatter: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Motor vectors with covariances of all shapes and of very different sizes."""
    roots = rng.normal(size=(count, 3, 3)) * rng.uniform(0.01, 0.1, (count, 1, 1))
    covariances = roots @ np.swapaxes(roots, 1, 2) + 1e-4 * np.eye(3)
    noise = np.einsum("kij,kj->ki", np.linalg.cholesky(covariances), rng.normal(size=(count, 3)))
    return TRUTH + noise + scatter * rng.normal(size=(count, 3)), covariances


@pytest.mark.parametrize("scatter", [0.0, 0.3])
def test_the_mean_is_as_far_from_the_truth_as_its_covariance_says(scatter: float) -> None:
    rng = np.random.default_rng(1)
    distances, scatters = [], []
    for _ in range(200):
        pooled = pool(*flights(rng, 12, scatter))
        apart = pooled.motor - TRUTH
        distances.append(apart @ np.linalg.solve(pooled.covariance, apart))
        scatters.append(pooled.scatter)
    inside = np.mean(np.array(distances) < special.chdtri(3, 0.05))
    assert 0.88 < inside <= 0.99
    assert np.mean(scatters) == pytest.approx(scatter, abs=0.03)


def test_one_flight_is_its_own_mean() -> None:
    motors, covariances = flights(np.random.default_rng(2), 1)
    pooled = pool(motors, covariances)
    np.testing.assert_allclose(pooled.motor, motors[0])
    np.testing.assert_allclose(pooled.covariance, covariances[0])
    assert pooled.scatter == 0.0


@pytest.mark.parametrize("count", [3, 4, 9])
def test_all_flights_at_once_as_one_after_the_other(count: int) -> None:
    motors, covariances = flights(np.random.default_rng(count), count, 0.2)
    which = np.arange(count)[::2]
    (chances,), (aparts,) = chances_apart(motors[None], covariances[None], which[None])
    for index, chance, apart in zip(which, chances, aparts, strict=True):
        others = np.arange(count) != index
        rest = pool(motors[others], covariances[others])
        spread = covariances[index] + rest.covariance + rest.scatter**2 * np.eye(3)
        away = motors[index] - rest.motor
        np.testing.assert_allclose(apart, away, rtol=1e-6, atol=1e-9)
        expected = special.chdtrc(3, away @ np.linalg.solve(spread, away))
        assert chance == pytest.approx(expected, rel=1e-5)


def test_mere_scatter_is_no_change() -> None:
    rng = np.random.default_rng(3)
    times = np.arange(10) * 86400.0
    found = sum(change(times, *flights(rng, 10, 0.3)) is not None for _ in range(300))
    # SURE for a drift, and as much for all the places of a step together.
    assert found <= 300 * 2 * SURE + 3


def test_a_step_is_found_where_it_is() -> None:
    motors, covariances = flights(np.random.default_rng(4), 12, 0.05)
    moved = np.array([0.0, 1.0, 0.5])
    motors[7:] += moved
    found = change(np.arange(12) * 86400.0, motors, covariances)
    assert found is not None
    assert (found.kind, found.first) == ("step", 7)
    np.testing.assert_allclose(found.difference, moved, atol=0.15)


def test_a_drift_is_no_step() -> None:
    motors, covariances = flights(np.random.default_rng(5), 20)
    share = np.linspace(0.0, 1.0, 20)
    motors += np.multiply.outer(share, [1.0, 0.0, -2.0])
    found = change(share * 1e7, motors, covariances)
    assert found is not None
    assert found.kind == "drift"
    np.testing.assert_allclose(found.difference, [1.0, 0.0, -2.0], atol=0.1)


def test_flights_of_one_moment_have_no_drift() -> None:
    motors, covariances = flights(np.random.default_rng(6), 3, 5.0)
    assert change(np.zeros(3), motors, covariances) is None
    assert change(np.full(3, np.nan), motors, covariances) is None


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 60), st.floats(0.0, 1.0))
def test_who_is_furthest_is_found_among_the_few_that_are_looked_at(
    seed: int, count: int, far: float
) -> None:
    rng = np.random.default_rng(seed)
    motors, covariances = flights(rng, count)
    motors[count // 2] += far
    pooled = pool(motors, covariances)
    (chances,), _ = chances_apart(motors[None], covariances[None], np.arange(count)[None])
    worst = int(np.argmin(chances))
    if chances[worst] < SURE / count:
        (squared,) = distances(motors[None], covariances[None], [pooled])
        looked_at = np.argsort(squared)[-6:]
        heaviest = np.argmin(np.trace(covariances, axis1=1, axis2=2))
        assert worst in looked_at or worst == heaviest


@given(st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
def test_definite_is_what_the_eigenvalues_say(entries: list[float]) -> None:
    xx, yy, zz, xy, xz, yz = entries
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    least = float(np.linalg.eigvalsh(matrix)[0])
    if abs(least) > 1e-6:
        assert is_definite(matrix[None])[0] == (least > 0.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_what_is_not_finite_is_not_definite(bad: float) -> None:
    assert not is_definite(np.diag([bad, 1.0, bad])[None])[0]


def test_many_compasses_at_once_are_each_as_alone() -> None:
    rng = np.random.default_rng(9)
    made = [flights(rng, 12, scatter) for scatter in (0.0, 0.05, 0.3, 0.0)]
    motors, covariances = (np.stack(each) for each in zip(*made, strict=True))
    motors[3, 6:] += 2.0
    times = np.stack([np.arange(12.0), np.zeros(12), np.arange(12.0), np.arange(12.0)])
    for together, *alone in zip(pools(motors, covariances), motors, covariances, strict=True):
        one = pool(*alone)
        np.testing.assert_allclose(together.motor, one.motor)
        np.testing.assert_allclose(together.covariance, one.covariance)
        assert together.scatter == pytest.approx(one.scatter)
    found = changes(times, motors, covariances)
    assert found[3] is not None
    assert (found[3].kind, found[3].first) == ("step", 6)
    for together, *alone in zip(found, times, motors, covariances, strict=True):
        one = change(*alone)
        assert (together is None) == (one is None)
        if together is not None and one is not None:
            assert (together.kind, together.first) == (one.kind, one.first)
