"""How much longer to record: from how the bound fell so far."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from magcomp.live.forecast import seconds_until
from magcomp.live.guide import LONG_S
from magcomp.live.progress import HoverBound
from magcomp.model import Analysis
from tests.tui import made

TIMES = (20.0, 30.0, 45.0, 60.0, 90.0)


def law(floor: float, slope: float) -> list[tuple[float, float]]:
    return [(t, math.sqrt(floor**2 + slope / t)) for t in TIMES]


@given(floor=st.floats(0.0, 0.45), slope=st.floats(10.0, 1000.0))
def test_a_bound_that_follows_the_law_reaches_its_goal_when_foretold(floor, slope):
    until = seconds_until(0.5, law(floor, slope))
    assert floor**2 + slope / until == pytest.approx(0.25, rel=1e-3)


@pytest.mark.parametrize(
    "history",
    [
        [],
        law(0.0, 100.0)[:1],
        law(0.6, 100.0),
        [(t, 2.0) for t in TIMES],
        [(t, t) for t in TIMES],
        [(60.0, 2.0), (61.0, 1.9), (62.0, 1.8)],
        [(t, math.inf) for t in TIMES],
        [(0.0, 2.0 - 0.1 * step) for step in range(5)],
    ],
    ids=["none", "one", "floor", "steady", "rising", "moments", "infinite", "on the ground"],
)
def test_nothing_is_foretold_of_a_bound_that_gives_no_reason(history):
    assert seconds_until(0.5, history) is None


def test_two_bounds_are_taken_for_all_random():
    until = seconds_until(0.5, [(20.0, 3.0), (45.0, 2.0)])
    assert seconds_until(0.5, [(20.0, 3.0), (45.0, 3.0 * math.sqrt(20.0 / 45.0))]) == (
        pytest.approx(720.0)
    )
    assert until == pytest.approx(720.0, rel=0.01)


def test_a_goal_that_is_not_reached_yet_is_not_foretold_for_the_past():
    late = [(20.0, 1.0), (40.0, 0.6), (60.0, 0.45), (80.0, 0.4), (100.0, 0.55)]
    assert seconds_until(0.5, late) == pytest.approx(100.0 * 1.1**2)


def test_a_bound_that_jitters_is_foretold_about_as_one_that_does_not():
    times = [20.0 + 10.0 * n for n in range(12)]
    shaken = [(t, math.sqrt(60.0 / t) * (1.0 + 0.1 * (-1) ** n)) for n, t in enumerate(times)]
    assert seconds_until(0.5, shaken) == pytest.approx(240.0, rel=0.15)


def analysis(p95: float) -> Analysis:
    """One compass whose bound is the same at every load."""
    whole = made.analysis()
    result = whole.compasses[0]
    errors = tuple(replace(error, p95=p95) for error in result.verdict.heading_error)
    verdict = replace(result.verdict, heading_error=errors)
    return replace(whole, compasses=(replace(result, verdict=verdict),))


def followed(goes_on: float) -> HoverBound:
    """A vehicle that stood for a minute and then flew, its bound by the law of its time aloft."""
    watch = HoverBound()
    watch.look(False, {"current": 0.4}, None, 60.0)
    for flown, bound in law(0.0, goes_on):
        watch.look(True, {"current": 24.0}, analysis(bound), 60.0 + flown)
    return watch


def test_time_on_the_ground_does_not_count_in_the_forecast():
    assert followed(25.0).bound.enough_at_s == pytest.approx(60.0 + 100.0)


def test_no_forecast_is_later_than_a_good_answer_is_waited_for():
    assert followed(1e4).bound.enough_at_s == LONG_S


def test_beyond_that_nothing_is_foretold():
    watch = followed(1e4)
    watch.look(True, {"current": 24.0}, analysis(3.0), LONG_S + 1.0)
    assert watch.bound.enough_at_s is None
