"""Errors of the control quantity: found in the residuals, and made independent."""

from __future__ import annotations

import numpy as np
import pytest

from magcomp.fit.control_noise import MOST_SHARE, Noise, noise_of, whitened
from magcomp.model import FloatArray

SENSOR = np.array([1.0, 2.0])


def residuals(control: float, seed: int = 0, count: int = 4000) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    pulls = 5.0 * np.stack([np.cos(angle), np.sin(angle)])
    values = rng.normal(size=(2, count)) * SENSOR[:, None]
    return values + pulls * rng.normal(scale=control, size=count), pulls


@pytest.mark.parametrize("control", [0.3, 0.8, 1.4])
def test_the_size_of_the_error_is_found(control):
    values, pulls = residuals(control)
    found = noise_of(values, pulls, 8.0)
    assert found.control == pytest.approx(control, rel=0.25)
    assert found.sensor == pytest.approx(SENSOR, rel=0.25)


def test_whitened_residuals_are_independent_and_as_large_as_the_sensors_noise():
    values, pulls = residuals(0.8)
    made = whitened(values, pulls, Noise(SENSOR, 0.8))
    assert np.std(made, axis=1) == pytest.approx(SENSOR, rel=0.05)
    turned = np.sign(pulls[0] * pulls[1])
    assert abs(np.mean(turned * made[0] * made[1])) < 0.1


def test_without_an_error_nothing_changes():
    values, pulls = residuals(0.0)
    assert np.allclose(whitened(values, pulls, Noise(SENSOR, 1e-9)), values)


def test_slopes_are_whitened_as_residuals_are():
    values, pulls = residuals(0.8)
    noise = Noise(SENSOR, 0.8)
    both = whitened(np.stack([values, 2.0 * values]), pulls, noise)
    assert np.allclose(both[1], 2.0 * whitened(values, pulls, noise))


def test_motors_that_hardly_show_say_nothing_of_the_current():
    values, pulls = residuals(0.0)
    assert noise_of(values, 0.01 * pulls, 8.0) is None


def test_an_error_is_never_taken_to_be_as_large_as_the_quantity():
    values, pulls = residuals(12.0)
    assert noise_of(values, pulls, 40.0).control == pytest.approx(MOST_SHARE * 40.0)
