"""How far a calibration in force may be off: each belief is tried, and the likely ones count."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from synthetic import NOTHING, Flown

from magcomp.fit import beliefs
from magcomp.fit.flight import (
    OPEN_OFFSET_MGAUSS,
    TRUSTED_OFFSET_MGAUSS,
    UNPROVEN_OFFSET_MGAUSS,
    FlightEstimate,
    Problem,
    estimate,
)
from magcomp.fit.robust import Prior
from magcomp.fit.wander import Posterior, Wander
from magcomp.model import OFFSET

CALIBRATED = None
DRIFTING = Wander(drift_mgauss=3.0)
ALL = {OPEN_OFFSET_MGAUSS, UNPROVEN_OFFSET_MGAUSS, TRUSTED_OFFSET_MGAUSS}


def flown(in_force: Mapping[str, float] | None) -> tuple[Problem, FlightEstimate]:
    problem = Flown(seed=1, seconds=60.0, in_force=in_force).problem()
    return problem, estimate(problem, 1)


def answered(monkeypatch, found: tuple[Problem, FlightEstimate], evidence: Mapping[float, float]):
    """What comes out where each width of the offset's belief answers with itself, and its groups.

    Beliefs that ``evidence`` does not name are not possible.
    """
    problem, least = found

    def of_belief(_part, start, known: Prior, *_others) -> Posterior | None:
        width = float(known.width[OFFSET][0])
        if width not in evidence:
            return None
        moved = start.copy()
        moved[OFFSET] += width
        return Posterior(moved, least.covariance, evidence[width], DRIFTING)

    monkeypatch.setattr(beliefs, "likeliest", lambda *_: DRIFTING)
    monkeypatch.setattr(beliefs, "posterior", of_belief)
    answer, free = beliefs.with_wander(problem, least, 1)
    return float((answer.parameters - least.parameters)[OFFSET][0]), free


@pytest.mark.parametrize("width", sorted(ALL))
def test_the_belief_that_makes_the_data_likely_answers(monkeypatch, width):
    evidence = {each: 0.0 if each == width else -50.0 for each in ALL}
    if width == OPEN_OFFSET_MGAUSS:
        evidence = {width: 0.0}
    moved, free = answered(monkeypatch, flown(CALIBRATED), evidence)
    assert moved == pytest.approx(width, rel=1e-6)
    assert free == (1 if width == TRUSTED_OFFSET_MGAUSS else 4)


def test_of_beliefs_as_likely_as_each_other_the_trusted_one_counts_a_quarter(monkeypatch):
    alike = dict.fromkeys((UNPROVEN_OFFSET_MGAUSS, TRUSTED_OFFSET_MGAUSS), 0.0)
    moved, _ = answered(monkeypatch, flown(CALIBRATED), alike)
    mean = (UNPROVEN_OFFSET_MGAUSS + 0.25 * TRUSTED_OFFSET_MGAUSS) / 1.25
    assert moved == pytest.approx(mean, rel=1e-6)


def test_a_vehicle_that_was_never_calibrated_is_not_calibrated_at_zero(monkeypatch):
    found = flown(NOTHING)
    everything_likely = dict.fromkeys(ALL, 0.0)
    assert answered(monkeypatch, found, {OPEN_OFFSET_MGAUSS: 0.0})[1] == 4
    with pytest.MonkeyPatch.context() as patch:
        tried: list[float] = []

        def recorded(_part, _start, known: Prior, *_others) -> None:
            tried.append(float(known.width[OFFSET][0]))

        patch.setattr(beliefs, "likeliest", lambda *_: DRIFTING)
        patch.setattr(beliefs, "posterior", recorded)
        assert beliefs.with_wander(*found, 1)[0] is found[1]
    assert set(tried) == {OPEN_OFFSET_MGAUSS} < set(everything_likely)


def test_standard_errors_are_wider_for_the_sizes_that_are_estimates_themselves(monkeypatch):
    problem, least = flown(CALIBRATED)
    one = Posterior(least.parameters, least.covariance, 0.0, DRIFTING)
    monkeypatch.setattr(beliefs, "likeliest", lambda *_: DRIFTING)
    monkeypatch.setattr(beliefs, "posterior", lambda *_: one)
    wider = beliefs.with_wander(problem, least, 1)[0]
    assert np.allclose(wider.covariance, 1.16**2 * least.covariance)
