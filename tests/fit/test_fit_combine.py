"""A sweep on the ground and the flight after it are put together, where they agree."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from synthetic import EXACT, INTERFERENCE, FloatArray, Flown, Swept

from magcomp.fit import fit
from magcomp.fit.combine import still_rows, with_sweep
from magcomp.fit.flight import Problem
from magcomp.fit.sweep import fit_sweep
from magcomp.model import MOTOR, OFFSET, SOFT_IRON, Lags, MotorFit, pack

GROUND_S = 40.0
OPEN = {"COMPASS_MOTCT": 0.0}


@dataclass(frozen=True)
class SweptFirst(Flown):
    """A sweep on the ground, then a flight whose load hardly changes."""

    seconds: float = 160.0
    noise: float = 2.0
    swing: float = 3.0
    magnet: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def current_at(self, time: FloatArray) -> FloatArray:
        swept = Swept(seed=self.seed).current_at(time)
        return np.where(time < GROUND_S, swept, super().current_at(time))

    def attitude_at(self, time: FloatArray) -> FloatArray:
        still = Swept(seed=self.seed).attitude_at(time)
        return np.where((time < GROUND_S)[:, None], still, super().attitude_at(time))

    def raw_of(self, true: FloatArray, amperes: FloatArray) -> FloatArray:
        moved = super().raw_of(true, amperes)
        stood = np.arange(len(amperes)) < 10.0 * GROUND_S
        return moved + np.multiply.outer(stood * amperes, self.magnet)


def rows_of(problem: Problem) -> np.ndarray | None:
    return still_rows(problem.sample(Lags()))


def parts(problem: Problem) -> tuple[MotorFit, MotorFit]:
    """The flight and the sweep, each fitted by itself."""
    rows = rows_of(problem)
    return fit(problem.where(~rows), "flight"), fit_sweep(problem.where(rows))


def missed(found: MotorFit) -> float:
    return float(np.linalg.norm(found.interference - INTERFERENCE))


def test_the_stretch_at_rest_is_found():
    problem = SweptFirst(seed=1).problem()
    ground = problem.readings.time < GROUND_S
    assert np.mean(rows_of(problem) == ground) > 0.97


@pytest.mark.parametrize("made", [Flown(seed=1), Flown(seed=2, tilt=0.05), Swept(seed=1)])
def test_a_flight_alone_and_a_sweep_alone_hold_none(made):
    assert rows_of(made.problem()) is None


def test_no_sweep_is_seen_in_the_air():
    """A calm climb keeps its attitude, but its motors never idle."""

    @dataclass(frozen=True)
    class Climbing(SweptFirst):
        def current_at(self, time: FloatArray) -> FloatArray:
            return np.maximum(super().current_at(time), 12.0)

    assert rows_of(Climbing(seed=1).problem()) is None


@pytest.mark.parametrize("in_force", [None, OPEN])
def test_both_together_know_the_motors_better_than_the_flight_alone(in_force):
    alone, together, stated = [], [], []
    for seed in range(4):
        problem = SweptFirst(seed=seed, in_force=in_force).problem()
        flight = parts(problem)[0]
        both = fit(problem)
        assert both.method == "flight"
        assert "known from the sweep too" in both.why
        alone.append(missed(flight))
        together.append(missed(both))
        error = (pack(both.correction) - pack(EXACT))[MOTOR]
        stated.append(np.mean(error**2 / np.diag(both.covariance)[MOTOR]))
    assert np.mean(together) < 0.5 * np.mean(alone)
    # Mean of 4 · χ²₃ / 3 is 1 ± 0.4.
    assert np.mean(stated) < 2.2


def test_offsets_and_soft_iron_still_come_from_the_flight():
    both = fit(SweptFirst(seed=3, in_force=OPEN).problem())
    assert np.linalg.norm(both.correction.offset - EXACT.offset) < 4.0
    assert np.abs(both.correction.soft_iron - EXACT.soft_iron).max() < 0.02


def test_a_sweep_that_contradicts_the_flight_is_left_out():
    """Held down on a bench whose leads carry the current too."""
    problem = SweptFirst(seed=2, magnet=(1.5, -1.0, 0.5)).problem()
    found = fit(problem, "flight")
    assert found.why.endswith("contradicts the flight")
    assert np.allclose(found.interference, parts(problem)[0].interference, atol=1e-9)


def test_the_update_is_that_of_two_gaussian_measurements():
    """In information form: the sum of both precisions, in the parameters."""
    flight, sweep = parts(SweptFirst(seed=4).problem())
    # One digit of the derivatives is enough to check them by differences.
    known = replace(flight, covariance=flight.covariance + 1e-9 * np.eye(12))
    both = with_sweep(known, sweep)
    inverse = np.linalg.inv(sweep.correction.soft_iron)
    doubt = inverse @ sweep.covariance[MOTOR, MOTOR] @ inverse.T

    def shift(parameters: np.ndarray) -> np.ndarray:
        matrix = np.zeros((3, 3))
        places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        for value, (i, j) in zip(parameters[SOFT_IRON], places, strict=True):
            matrix[i, j] = matrix[j, i] = value
        return np.linalg.solve(matrix, parameters[MOTOR])

    packed = pack(flight.correction)
    step = 1e-6
    slopes = np.stack(
        [(shift(packed + step * e) - shift(packed - step * e)) / (2 * step) for e in np.eye(12)],
        axis=1,
    )
    precision = np.linalg.inv(known.covariance) + slopes.T @ np.linalg.solve(doubt, slopes)
    assert np.allclose(both.covariance, np.linalg.inv(precision), rtol=1e-3, atol=1e-8)
    assert np.all(np.diag(both.covariance) <= np.diag(known.covariance) * (1 + 1e-9))
    assert np.all(slopes[:, OFFSET] == 0.0)
