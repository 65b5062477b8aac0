"""What limits a bound is named: which headings, loads and leans the next flight should add."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import Flown, problem_of

from magcomp.fit import fit
from magcomp.judge.evidence import cover
from magcomp.judge.heading_error import variance_shares
from magcomp.judge.lacking import lacking, widest_gap
from magcomp.model import MOTOR, OFFSET, SOFT_IRON, MotorFit, Samples

TOP_A = 40.0


@pytest.fixture(scope="module")
def flown() -> tuple[MotorFit, Samples]:
    problem = problem_of(Flown(seed=4, seconds=120.0, tilt=0.3).recording())
    found = fit(problem, "flight")
    return found, problem.sample(found.lags)


def unsure_of(found: MotorFit, part: slice) -> MotorFit:
    """The fit with one group of parameters far less certain than the others."""
    size = 0.1 if part is SOFT_IRON else 10.0
    variances = np.full(12, 1e-10)
    variances[part] = size**2
    return replace(found, covariance=np.diag(variances))


def said(found: MotorFit, samples: Samples) -> str:
    covered = cover(samples, found.correction.apply(samples.raw, samples.u))
    return lacking(found, samples, covered, found.u_high)


@pytest.mark.parametrize(
    ("name", "part"), [("motor", MOTOR), ("offset", OFFSET), ("soft iron", SOFT_IRON)]
)
def test_the_bound_is_put_down_to_the_group_that_is_uncertain(flown, name, part):
    shares = variance_shares(unsure_of(flown[0], part), TOP_A)
    assert shares[name] > 0.99 * sum(shares.values())


def test_the_shares_of_the_motor_vector_grow_with_the_square_of_the_load(flown):
    found = unsure_of(flown[0], MOTOR)
    low, high = (variance_shares(found, u)["motor"] for u in (TOP_A / 2, TOP_A))
    assert high == pytest.approx(4 * low, rel=0.05)


def test_a_fit_motor_by_motor_is_put_down_to_what_its_total_leaves(flown):
    """The mean of four vectors that are uncertain each for itself is half as uncertain."""
    found = unsure_of(flown[0], MOTOR)
    motor = np.tile(found.correction.vector[:, None], 4)
    variances = np.concatenate([np.diag(found.covariance), np.full(9, 10.0**2)])
    by_motor = replace(
        found,
        correction=replace(found.correction, motor=motor),
        covariance=np.diag(variances),
    )
    one, four = (variance_shares(each, TOP_A)["motor"] for each in (found, by_motor))
    assert four == pytest.approx(one / 4, rel=1e-3)


def test_headings_never_seen_under_load_are_named(flown):
    found, samples = flown
    yaw = np.mod(np.degrees(samples.attitude[:, 2]), 360.0)
    hard = samples.total > found.u_low + 0.6 * (found.u_high - found.u_low)
    away = samples.where(~(hard & (yaw > 200.0) & (yaw < 290.0)))
    text = said(unsure_of(found, MOTOR), away)
    assert text.startswith("headings 200° to 290° were never seen above")
    assert text.endswith("climb hard while facing there")


def test_a_load_that_hardly_changed_is_named(flown):
    found, samples = flown
    steady = samples.where(samples.total > 0.6 * found.u_high)
    assert said(unsure_of(found, MOTOR), steady).startswith("the motors only worked between")


@pytest.mark.parametrize("part", [OFFSET, SOFT_IRON])
def test_headings_never_seen_at_all_are_named(flown, part):
    found, samples = flown
    yaw = np.mod(np.degrees(samples.attitude[:, 2]), 360.0)
    text = said(unsure_of(found, part), samples.where((yaw > 70.0) & (yaw < 350.0)))
    assert text.startswith("headings 350° to 70° were never seen: turn")


@pytest.mark.parametrize("part", [OFFSET, SOFT_IRON])
def test_where_most_headings_are_missing_those_that_were_seen_are_named(flown, part):
    found, samples = flown
    yaw = np.mod(np.degrees(samples.attitude[:, 2]), 360.0)
    text = said(unsure_of(found, part), samples.where((yaw < 60.0) | (yaw > 340.0)))
    assert text.startswith("only headings 340° to 60° were seen: turn")


@pytest.mark.parametrize("part", [OFFSET, SOFT_IRON])
def test_a_vehicle_that_hardly_leaned_is_told_to(flown, part):
    found, samples = flown
    level = replace(samples, down=np.tile([0.0, 0.0, 1.0], (len(samples.down), 1)))
    assert said(unsure_of(found, part), level).startswith("the vehicle never leaned more than 0°")


def test_where_all_was_seen_only_time_helps(flown):
    assert "record longer" in said(unsure_of(flown[0], MOTOR), flown[1])
    assert "record longer" in said(unsure_of(flown[0], OFFSET), flown[1])


@pytest.mark.parametrize("turn", [0.0, 90.0, 210.0, 340.0])
def test_a_gap_turns_with_the_headings(turn):
    seen = np.radians(np.arange(0.0, 250.0, 2.0) + turn)
    first, last = widest_gap(seen)
    assert (first, last - first) == ((250.0 + turn) % 360.0, 110.0)


def test_no_heading_at_all_is_a_whole_turn():
    assert widest_gap(np.zeros(0)) == (0.0, 360.0)
