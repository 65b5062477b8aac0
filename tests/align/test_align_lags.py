"""Lags: known delays come back, and their standard errors say how well."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic import EXACT, Flown

from magcomp.fit import fit
from magcomp.fit.flight import estimate_lags

SEEDS = range(50)
FAST = {"seconds": 120.0, "current_hz": 25.0, "noise": 1.5}


def test_lags_of_a_known_correction_come_back_and_their_standard_errors_are_honest():
    """z = error / stated error has a mean near 0 and a spread near 1 over many recordings."""
    z = []
    for seed in SEEDS:
        rng = np.random.default_rng([seed, 20])
        true = rng.uniform(-0.05, 0.2, 2)
        flown = Flown(seed=seed, field_lag=true[0], current_lag=true[1], **FAST)
        lags, std = estimate_lags(flown.problem(), EXACT)
        z.append([(lags.field - true[0]) / std.field, (lags.regressor - true[1]) / std.regressor])
    z = np.array(z)
    # 50 draws: the mean is good to 0.14, the root mean square to 10 %; 2 and 3 of those.
    assert np.all(np.abs(z.mean(axis=0)) < 0.45)
    assert np.all(np.sqrt(np.mean(z**2, axis=0)) < 1.4)
    assert np.all(np.sqrt(np.mean(z**2, axis=0)) > 0.6)
    assert np.abs(z).max() < 4.0


@pytest.mark.parametrize(("field_lag", "current_lag"), [(0.0, 0.0), (0.07, 0.15), (0.2, -0.05)])
def test_a_flight_fit_finds_both_lags_within_three_standard_errors(field_lag, current_lag):
    flown = Flown(seed=3, field_lag=field_lag, current_lag=current_lag, **FAST)
    found = fit(flown.problem(), "flight")
    assert abs(found.lags.field - field_lag) < 3 * found.lags_std.field
    assert abs(found.lags.regressor - current_lag) < 3 * found.lags_std.regressor
    assert found.lags_std.field < 0.02


def test_a_lag_ignored_is_error_believed():
    """Why lags are estimated at all: held at zero, the same recording is explained far worse."""
    flown = Flown(seed=4, field_lag=0.2, current_lag=0.0, noise=0.5, tilt=0.3)
    problem = flown.problem()
    found = fit(problem, "flight")
    samples = problem.sample(type(found.lags)(0.0, 0.0))
    field = EXACT.apply(samples.raw, samples.u)
    along = np.einsum("ij,ij->i", field, samples.down) - problem.earth.vertical
    assert np.std(along) > 3 * found.noise
