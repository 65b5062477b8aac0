"""What wanders and drifts, marginalised in bands, against the same with full matrices."""

from __future__ import annotations

import numpy as np
import pytest

from magcomp.fit.field_model import SIZE, TILT
from magcomp.fit.robust import Prior
from magcomp.fit.wander import (
    STATES,
    Posterior,
    Reduced,
    Rows,
    Wander,
    likeliest,
    marginal,
    mixed,
    posterior,
    reduced,
    stretches,
    weighed,
)
from magcomp.model import OFFSET, FloatArray

WANDER = Wander(tilt_rad=0.01, tilt_s=7.0, drift_mgauss=2.0, drift_s=30.0, control_share=0.05)


def rows(seed: int, seconds: float = 40.0) -> Rows:
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0.0, seconds, 160))
    slopes = rng.normal(size=(len(time), 2, SIZE))
    slopes[:, :, TILT] *= 300.0
    return Rows(time, rng.normal(size=(len(time), 2)), slopes, rng.normal(size=(len(time), 2)))


def states_of(made: Rows) -> FloatArray:
    """Columns of every state of every stretch, shape (2 n, stretches · 6)."""
    number = stretches(made.time)
    each = np.concatenate(
        [made.slopes[:, :, TILT], made.slopes[:, :, OFFSET], made.pulls[:, :, None]], axis=2
    )
    full = np.zeros((len(made.time), 2, number.max() + 1, STATES))
    for reading, stretch in enumerate(number):
        full[reading, :, stretch] = each[reading]
    return full.reshape(2 * len(made.time), -1)


def covariance_of(time: FloatArray, wander: Wander) -> FloatArray:
    sizes = [wander.tilt_rad] * 2 + [wander.drift_mgauss] * 3 + [wander.control_share]
    times = [wander.tilt_s] * 2 + [wander.drift_s] * 3 + [wander.control_s]
    full = np.zeros((len(time), STATES, len(time), STATES))
    for state, (size, constant) in enumerate(zip(sizes, times, strict=True)):
        apart = np.abs(time[:, None] - time)
        full[:, state, :, state] = size**2 * np.exp(-apart / constant)
    return full.reshape(len(time) * STATES, -1)


@pytest.mark.parametrize("seed", range(3))
def test_bands_give_what_full_matrices_give(seed):
    made = rows(seed)
    weights = np.random.default_rng(seed).uniform(0.5, 2.0, (len(made.time), 2))
    part = reduced(made, weights)
    information, loss = marginal(part, WANDER)
    states = states_of(made)
    whole = np.diag(1.0 / weights.reshape(-1)) + states @ covariance_of(part.time, WANDER) @ (
        states.T
    )
    columns = np.concatenate([made.slopes.reshape(-1, SIZE), made.values.reshape(-1, 1)], axis=1)
    assert np.allclose(information, columns.T @ np.linalg.solve(whole, columns), rtol=1e-6)
    log_det = np.linalg.slogdet(whole)[1] + np.sum(np.log(weights))
    assert loss == pytest.approx(-0.5 * log_det, rel=1e-6)


def test_every_reading_falls_into_one_stretch_of_a_second_or_more():
    number = stretches(np.array([0.0, 0.4, 1.2, 9.0, 9.1]))
    assert number.tolist() == [0, 0, 1, 2, 2]


def drifting(size: float, seed: int) -> tuple[Rows, FloatArray]:
    """Residuals of offsets that drift, of a size in mGauss, for parameters of zero."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 240.0, 0.2)
    made = rows(seed)
    slopes = np.random.default_rng(seed).normal(size=(len(time), 2, SIZE)) / np.sqrt(3)
    drift = np.zeros((len(time), 3))
    for row in range(1, len(time)):
        kept = np.exp(-0.2 / 60.0)
        drift[row] = kept * drift[row - 1] + size * np.sqrt(1 - kept**2) * rng.normal(size=3)
    values = np.einsum("ngk,nk->ng", slopes[:, :, OFFSET], drift)
    values += rng.normal(scale=0.5, size=values.shape)
    return Rows(time, values, slopes, 0.0 * values), made.time


@pytest.mark.parametrize(("size", "low", "high"), [(0.05, 0.0, 0.7), (4.0, 1.4, 12.1)])
def test_the_size_of_a_drift_is_found(size, low, high):
    made, _ = drifting(size, 3)
    known = Prior(np.zeros(SIZE), np.ones(SIZE))
    found = likeliest(reduced(made, np.full(made.values.shape, 4.0)), known, np.zeros(SIZE))
    assert low <= found.drift_mgauss <= high
    assert found.tilt_rad <= np.radians(0.35)


def test_the_covariance_holds_what_repetition_shows():
    known = Prior(np.zeros(SIZE), np.full(SIZE, 50.0))
    far = []
    for seed in range(8):
        made, _ = drifting(3.0, seed)

        def at(parameters: FloatArray, made: Rows = made) -> Reduced:
            moved = made.values + made.slopes @ parameters
            return weighed(Rows(made.time, moved, made.slopes, made.pulls))

        wander = likeliest(at(np.zeros(SIZE)), known, np.zeros(SIZE))
        found = posterior(at, np.zeros(SIZE), known, lambda _: True, wander)
        far.append(found.parameters[OFFSET] / np.sqrt(np.diag(found.covariance))[OFFSET])
    assert 0.4 < np.sqrt(np.mean(np.square(far))) < 1.6


def test_steps_that_lead_to_what_cannot_be_are_no_answer():
    made, _ = drifting(1.0, 1)
    known = Prior(np.zeros(SIZE), np.ones(SIZE))
    part = weighed(made)
    assert posterior(lambda _: part, np.zeros(SIZE), known, lambda _: False, WANDER) is None


def test_a_mixture_leans_on_the_evidence_and_holds_what_lies_apart():
    one = Posterior(np.zeros(SIZE), np.eye(SIZE), 0.0, WANDER)
    other = Posterior(np.full(SIZE, 2.0), np.eye(SIZE), 0.0, WANDER)
    found = mixed([one, other])
    assert np.allclose(found.parameters, 1.0)
    assert np.allclose(np.diag(found.covariance), 2.0)
    sure = mixed([one, Posterior(np.full(SIZE, 2.0), np.eye(SIZE), -20.0, WANDER)])
    assert np.allclose(sure.parameters, 0.0, atol=1e-6)
