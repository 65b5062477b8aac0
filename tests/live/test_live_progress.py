"""What a recording has gained: nothing that was reached is ever lost again."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from magcomp.live.guide import Guidance
from magcomp.live.progress import HEADINGS, Early, Enough, HeadingRing
from magcomp.live.situation import Situation
from magcomp.model import Analysis, Vehicle

SECTOR = math.tau / HEADINGS


def flown(*looks: tuple[float, float]) -> tuple[float, ...]:
    """The ring after looks of (sector, throttle)."""
    ring = HeadingRing()
    for sector, throttle in looks:
        ring.look(True, (0.0, 0.0, (sector + 0.5) * SECTOR), throttle)
    return ring.best


def seen(best: tuple[float, ...]) -> set[int]:
    return {sector for sector, throttle in enumerate(best) if not math.isnan(throttle)}


def test_each_heading_keeps_the_largest_throttle_it_was_flown_with():
    best = flown((3, 0.4), (3, 0.6), (3, 0.2))
    assert best[3] == pytest.approx(0.6)
    assert seen(best) == {3}


def test_headings_passed_between_two_looks_are_seen_north_or_not():
    assert seen(flown((22, 0.4), (26, 0.4))) == {22, 23, 0, 1, 2}
    assert seen(flown((1, 0.4), (-2, 0.4))) == {1, 0, 23, 22}


def test_what_lies_between_two_looks_far_apart_is_not_known():
    assert seen(flown((0, 0.4), (11, 0.4))) == {0, 11}


def test_without_motors_nothing_is_seen():
    ring = HeadingRing()
    ring.look(False, (0.0, 0.0, 1.0), 0.0)
    ring.look(True, None, 0.4)
    ring.look(True, (0.0, 0.0, 1.0), None)
    assert seen(ring.best) == set()


@given(
    st.lists(
        st.tuples(st.sampled_from(list(Situation)), st.floats(0.0, 1.0), st.booleans()),
        max_size=30,
    )
)
def test_enough_only_rises_whatever_the_vehicle_does(looks):
    enough, before = Enough(), dict.fromkeys(Situation, 0.0)
    for situation, share, is_enough in looks:
        was = enough.reached(situation)
        shown = enough.look(situation, Guidance("", share, enough=is_enough))
        assert shown.share_done >= max(before[situation], share)
        if situation is Situation.GROUND:
            assert shown.share_done >= max(before.values())
        assert enough.reached(situation) == (was or is_enough)
        before[situation] = shown.share_done


def test_a_verdict_on_too_little_stays_too_early_until_the_next_one():
    """What was fitted when the flight was too short does not reject a compass once it is long."""
    little, much = (analysis_of(seconds) for seconds in (40.0, 70.0))
    early = Early()
    assert early.look(Guidance("", 0.5, missing=("time",)), 59.0, little)
    flown = Guidance("", 0.9, missing=("a sure answer",))
    assert early.look(flown, 75.0, little)
    assert not early.look(flown, 80.0, much)


def analysis_of(seconds: float) -> Analysis:
    vehicle = Vehicle("ardupilot", "copter", 1, 1)
    return Analysis("a.tlog", seconds, vehicle, (), ())
