"""Throttle is asked only as much as it takes to see that it is no better than current."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import Turned, problem_of, with_both

from magcomp.align import controls, expected_earth, readings, reported
from magcomp.analysis.compare import Judged, Rival, beaten, better, comparison, doubted
from magcomp.fit import Problem, fit
from magcomp.judge import apart_at_rest, judge
from magcomp.model import CURRENT, THROTTLE, Control, Grade, MotorFit, Recording


def judged(problem: Problem, method: str = "auto") -> Judged:
    return Judged(problem, *judge(problem, fit(problem, method)))


def forms(recording: Recording) -> list[Control]:
    return [control for control in controls(recording) if control.kind == THROTTLE]


def by_throttle(recording: Recording) -> Judged:
    problem = Problem(
        readings(recording, 1),
        forms(recording)[0],
        reported(controls(recording)),
        expected_earth(recording),
    )
    return judged(problem)


@pytest.fixture(scope="module")
def by_current_best() -> tuple[Recording, Judged]:
    recording = with_both(CURRENT, 5)
    return recording, judged(problem_of(recording))


def test_throttle_that_is_no_better_is_beaten_with_what_a_fit_of_its_own_leaves(by_current_best):
    recording, current = by_current_best
    left = beaten([current], forms(recording))[0].held_out
    assert left > current.held_out
    assert left == pytest.approx(by_throttle(recording).held_out, rel=0.05)


def test_throttle_that_is_better_needs_a_fit_of_its_own():
    recording = with_both(THROTTLE, 5)
    current = judged(problem_of(recording))
    assert beaten([current], forms(recording)) == ()
    assert better({CURRENT: [current], THROTTLE: [by_throttle(recording)]}) == THROTTLE


def test_a_current_that_is_rejected_beats_nothing(by_current_best):
    recording, current = by_current_best
    rejected = replace(current, verdict=replace(current.verdict, grade=Grade.REJECTED))
    assert beaten([rejected], forms(recording)) == ()
    assert beaten([rejected, current], forms(recording)) != ()


def test_only_flights_can_be_compared_in_short():
    recording = Turned(seed=1).recording()
    by_levels = judged(problem_of(recording), "levels")
    assert beaten([by_levels], forms(recording)) == ()


def said(left: float, bound: float, by_current_best: tuple[Recording, Judged]) -> Judged:
    """The same verdict with another residual on unseen readings and another bound throughout."""
    known = by_current_best[1]
    verdict = replace(
        known.verdict,
        grade=Grade.MARGINAL,
        residual=replace(known.verdict.residual, held_out=left),
        heading_error=tuple(replace(row, p95=bound) for row in known.verdict.heading_error),
    )
    return replace(known, verdict=verdict)


@pytest.mark.parametrize(
    ("left", "bound", "chosen"),
    [
        (0.98, 1.0, CURRENT),
        (0.96, 1.0, THROTTLE),
        (0.96, 3.0, CURRENT),
        (0.82, 3.0, CURRENT),
        (0.78, 3.0, THROTTLE),
    ],
)
def test_a_throttle_that_is_little_better_must_bound_the_heading_as_well(
    left, bound, chosen, by_current_best
):
    """Against a current that leaves 1 mGauss with a bound of 2 degrees."""
    current = said(1.0, 2.0, by_current_best)
    throttle = said(left, bound, by_current_best)
    assert better({CURRENT: [current], THROTTLE: [throttle]}) == chosen
    told = comparison({CURRENT: (1.0,), THROTTLE: (left,)}, chosen)
    assert ("bounds the heading better" in told) is (chosen == CURRENT and left < 0.97)


@pytest.mark.parametrize(
    ("left", "apart_deg", "grade"),
    [(0.99, 1.6, Grade.MARGINAL), (0.99, 1.4, Grade.GOOD), (1.01, 9.0, Grade.GOOD)],
)
def test_what_throttle_explains_as_well_it_must_not_contradict_at_rest(
    left, apart_deg, grade, by_current_best
):
    current = by_current_best[1]
    sure = tuple(replace(row, p95=1.0) for row in current.verdict.heading_error)
    verdict = replace(current.verdict, grade=Grade.GOOD, heading_error=sure)
    good = replace(current, verdict=verdict)
    rival = Rival(moved_at_rest(current.fit, apart_deg), left * current.held_out)
    (found,) = doubted({CURRENT: [good]}, CURRENT, [rival])
    assert found.verdict.grade is grade
    told = f"the two differ by {apart_deg:.0f}° at rest"
    assert (told in found.verdict.reasons[0]) is (grade is Grade.MARGINAL)
    whole = replace(
        current, fit=rival.fit, verdict=said(rival.held_out, 1.0, by_current_best).verdict
    )
    (by_whole,) = doubted({CURRENT: [good], THROTTLE: [whole]}, CURRENT)
    assert by_whole.verdict.grade is grade
    assert doubted({THROTTLE: [good]}, THROTTLE, [rival]) == (good,)


def test_all_compasses_tell_together_which_quantity_explains_less(by_current_best):
    current = by_current_best[1]
    good = replace(current, verdict=replace(current.verdict, grade=Grade.GOOD))
    pair = [good, replace(good, fit=replace(good.fit, compass=2))]
    apart = [moved_at_rest(each.fit, 3.0) for each in pair]

    def grades(*shares: float) -> list[Grade]:
        rivals = [Rival(f, k * good.held_out) for f, k in zip(apart, shares, strict=True)]
        return [each.verdict.grade for each in doubted({CURRENT: pair}, CURRENT, rivals)]

    assert grades(0.95, 1.02) == [Grade.MARGINAL] * 2
    assert grades(0.99, 1.03) == [Grade.GOOD] * 2


def moved_at_rest(fit: MotorFit, degrees: float) -> MotorFit:
    """A fit by whatever quantity whose offset turns the heading by so much with the motors off."""
    wrong = fit.correction.offset + np.array([0.0, 1.0, 0.0])
    by_one = apart_at_rest(fit, replace(fit.correction, offset=wrong))
    offset = fit.correction.offset + np.array([0.0, degrees / by_one, 0.0])
    return replace(fit, correction=replace(fit.correction, offset=offset))


def test_one_kind_alone_is_the_better(by_current_best):
    assert better({THROTTLE: [by_current_best[1]]}) == THROTTLE


def test_the_scores_are_told_by_kind():
    told = comparison({CURRENT: (1.04, 2.0), THROTTLE: (1.5, 2.25)}, CURRENT)
    assert told.startswith("current is used because")
    assert told.endswith("current leaves 1.0/2.0 mGauss, throttle leaves 1.5/2.2 mGauss")
