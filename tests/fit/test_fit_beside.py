"""Where the calibration in force may be right, what is likeliest beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import EXACT, Flown

from magcomp.fit import fit, likely_beside
from magcomp.model import CORRECTION_SIZE, MOTOR, OFFSET, pack

STD_OFFSET = 1.0
STD_MOTOR = 0.05


@pytest.fixture(scope="module")
def found():
    """A fit whose offsets, where they come out too long, make the motor vector too short."""
    made = fit(Flown(seed=1, seconds=60.0).problem(), "flight")
    covariance = np.diag([STD_MOTOR**2] * 3 + [STD_OFFSET**2] * 3 + [1e-6] * 6)
    for axis in range(3):
        shared = -0.8 * STD_MOTOR * STD_OFFSET
        covariance[axis, OFFSET.start + axis] = covariance[OFFSET.start + axis, axis] = shared
    return replace(
        made, correction=EXACT, covariance=covariance, free=frozenset({"motor", "offset"})
    )


def moved_by(found, away):
    present = replace(EXACT, offset=EXACT.offset - away)
    return pack(likely_beside(found, present)) - pack(found.correction)


def test_what_agrees_counts_for_right_and_the_motors_follow_as_the_fit_has_them_together(found):
    away = np.array([0.5, -0.3, 0.2])
    moved = moved_by(found, away)
    assert np.allclose(moved[OFFSET], -away, atol=0.25 * np.linalg.norm(away))
    # By regression on the offsets: −0.8 · 0.05 / 1 for each mGauss that they give way.
    assert np.allclose(moved[MOTOR], -0.04 * moved[OFFSET], atol=1e-9)


def test_what_is_far_from_the_fit_pulls_nothing(found):
    moved = moved_by(found, np.array([40.0, -30.0, 20.0]))
    assert np.abs(moved).max() < 0.1 * STD_OFFSET


def test_a_soft_iron_that_was_held_is_no_evidence(found):
    other = np.eye(3) * 1.001
    alike = replace(EXACT, soft_iron=other @ EXACT.soft_iron)
    held = pack(likely_beside(found, alike)) - pack(found.correction)
    assert np.allclose(held, np.zeros(CORRECTION_SIZE), atol=1e-9)
    opened = replace(found, free=found.free | {"diagonal", "off-diagonal"})
    assert np.abs(pack(likely_beside(opened, alike)) - pack(EXACT))[6:9].max() > 1e-4
