"""What a pilot is told: the right thing next, and nothing dangerous."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magcomp.buffer import BANDS, LEVELS, SECTORS, Coverage, sphere_cell
from magcomp.live.guide import (
    View,
    guide,
    level_seconds,
    levels_done,
    pilot_is_done,
    wanted_heading,
)
from magcomp.live.situation import Situation
from magcomp.model import Grade

CELLS = BANDS * SECTORS
LEVEL = (0.0, 0.0, 0.0)


def coverage(**cells_of_level):
    """Cells seen by level: ``l3=range(20)``."""
    counts = np.zeros((LEVELS, CELLS), dtype=np.int64)
    for name, cells in cells_of_level.items():
        counts[int(name[1:]), list(cells)] = 10
    return Coverage(counts)


def headings(sectors, band=BANDS - 1):
    return [band * SECTORS + sector for sector in sectors]


def view(situation, **changes):
    start = View(
        situation=situation,
        armed=True,
        throttle=0.3,
        attitude=LEVEL,
        height_m=20.0,
        coverage=coverage(),
        seconds=0.0,
    )
    return replace(start, **changes)


# ---------------------------------------------------------------- what is said


@pytest.mark.parametrize("situation", list(Situation))
def test_what_was_enough_stays_enough_whatever_comes_after(situation):
    said = guide(view(situation, was_enough=True))
    assert said.enough
    assert said.share_done == 1.0


def test_only_who_has_flown_everything_can_be_told_that_a_compass_is_rejected():
    begun = view(Situation.FLYING, coverage=throttles_flown({0, 1}), seconds=30.0)
    assert guide(replace(begun, grade=Grade.REJECTED)).early
    flown = replace(begun, coverage=throttles_flown(range(SECTORS)), seconds=90.0)
    assert not guide(replace(flown, grade=Grade.REJECTED)).early
    assert guide(view(Situation.GROUND)).early


def test_a_disarmed_stand_is_never_told_to_raise_the_throttle():
    held = coverage(l0=[0], l1=[0], l2=[0], l3=[0], l4=[0])
    for grade in (None, Grade.MARGINAL, Grade.REJECTED):
        told = guide(
            view(Situation.STILL, armed=False, coverage=held, seconds=60.0, grade=grade)
        ).text
        assert "raise" not in told
        assert "lower" not in told


def test_steps_that_are_all_held_are_enough_once_the_answer_is_steady():
    held = coverage(l0=[0], l1=[0], l2=[0], l3=[0], l4=[0])
    still = view(Situation.STILL, coverage=held, seconds=60.0, grade=Grade.MARGINAL)
    assert guide(still).missing == ("a sure answer",)
    assert guide(replace(still, stable_refits=2)).enough


@given(yaw=st.floats(-3.1, 3.1), seen=st.sets(st.integers(0, SECTORS - 1), min_size=1, max_size=11))
def test_the_heading_wanted_lies_on_the_side_that_is_told(yaw, seen):
    flying = view(
        Situation.FLYING, attitude=(0.0, 0.0, yaw), coverage=throttles_flown(seen), seconds=90.0
    )
    turn = math.remainder(wanted_heading(flying) - yaw, math.tau)
    if len(seen) == SECTORS - 1 or abs(turn) > 3.1:
        return  # one sector does not matter, and both ways round are the same
    assert ("to the left" in guide(flying).text) == (turn < 0.0)


def throttles_flown(sectors):
    """Coverage of a flight that has used three throttles, and seen some headings."""
    return coverage(l2=headings(sectors), l3=headings(sectors), l4=headings(sectors))


def test_a_flight_is_turned_towards_the_headings_that_are_missing():
    # Heading north; a turn to the right moves the field to the left, to lower sectors.
    flown = view(Situation.FLYING, coverage=throttles_flown({0, 1, 2, 3, 4, 5}), seconds=90.0)
    assert guide(flown).text == "turn slowly to the right"
    flown = replace(flown, coverage=throttles_flown({0, 11, 10, 9, 8, 7}))
    assert guide(flown).text == "turn slowly to the left"


def test_turning_as_told_is_what_makes_progress():
    """Whoever follows the advice sees every heading within one full turn."""
    seen: set[int] = set()
    yaw, last = 0.4, -1.0
    for _ in range(3 * SECTORS):
        seen.add(sphere_cell(math.cos(yaw), -math.sin(yaw), 0.0) % SECTORS)
        flown = throttles_flown(seen)
        now = guide(view(Situation.FLYING, coverage=flown, attitude=(0, 0, yaw), seconds=90.0))
        assert now.share_done >= last
        last = now.share_done
        if "turn slowly" not in now.text:
            break
        yaw += (1 if "right" in now.text else -1) * math.tau / SECTORS
    assert len(seen) >= SECTORS - 1


def test_with_all_headings_it_asks_for_other_throttles_by_climbing_and_descending():
    seen = coverage(l3=headings(range(SECTORS)))
    assert guide(view(Situation.FLYING, coverage=seen, seconds=30.0)).text == "climb"
    seen = coverage(l3=headings(range(SECTORS)), l5=headings({1, 2}))
    assert guide(view(Situation.FLYING, coverage=seen, seconds=30.0)).text == "descend"


@pytest.mark.parametrize("height", [None, 0.5, 5.0])
def test_nobody_is_told_to_descend_when_low_or_of_unknown_height(height):
    seen = coverage(l3=headings(range(SECTORS)), l5=headings({1, 2}))
    told = guide(view(Situation.FLYING, coverage=seen, seconds=30.0, height_m=height))
    assert "descend" not in told.text


def test_a_flight_ends_when_the_answer_is_good_and_no_longer_changes():
    seen = coverage(l2=headings(range(6)), l3=headings(range(SECTORS)), l4=headings(range(6)))
    enough = view(Situation.FLYING, coverage=seen, seconds=90.0, grade=Grade.GOOD, stable_refits=2)
    assert guide(enough).enough
    assert "land and disarm" in guide(enough).text
    assert not guide(replace(enough, stable_refits=1)).enough
    assert not guide(replace(enough, grade=Grade.MARGINAL)).enough
    assert not guide(replace(enough, bound_deg=0.9)).enough
    assert guide(replace(enough, bound_deg=0.9, seconds=300.0)).enough
    assert guide(replace(enough, armed=False)).text == "that is enough"


def test_who_has_landed_waits_for_the_answer_of_the_whole_flight_and_gets_it():
    seen = coverage(l2=headings(range(6)), l3=headings(range(SECTORS)), l4=headings(range(6)))
    landed = view(Situation.FLYING, armed=False, coverage=seen, seconds=90.0, answered=False)
    assert "wait for the answer" in guide(landed).text
    assert "wait for the answer" in guide(replace(landed, grade=Grade.GOOD)).text
    good = guide(replace(landed, grade=Grade.GOOD, bound_deg=2.0, answered=True))
    assert good.enough
    assert good.text == "that is enough"
    poor = guide(replace(landed, grade=Grade.MARGINAL, answered=True))
    assert not poor.enough
    assert "fly once more" in poor.text


def test_a_held_vehicle_is_turned_then_tilted_then_given_more_throttle():
    flat = view(Situation.HELD, throttle=0.0)
    assert "turn slowly to the" in guide(flat).text
    ring = view(Situation.HELD, throttle=0.0, coverage=coverage(l0=headings(range(SECTORS))))
    assert re.search("tilt|side", guide(ring).text)
    done = view(Situation.HELD, throttle=0.0, coverage=coverage(l0=range(40)))
    assert guide(done).text == "raise the throttle to 20 % and hold"
    high = view(Situation.HELD, throttle=0.25, coverage=coverage(l2=range(40)))
    assert guide(high).text == "lower the throttle to 0 % and hold"


def test_three_levels_and_a_steady_answer_end_a_held_measurement():
    seen = coverage(l0=range(40), l2=range(40), l4=range(40))
    held = view(Situation.HELD, coverage=seen, throttle=0.4, grade=Grade.GOOD, stable_refits=2)
    assert guide(held).enough
    waiting = guide(replace(held, stable_refits=0))
    assert not waiting.enough
    assert waiting.text.startswith("disarm to end")


def test_a_still_vehicle_is_led_through_steps_of_throttle():
    seen = coverage(l0=[1])
    still = view(Situation.STILL, throttle=0.0, coverage=seen, seconds=10.0)
    assert guide(still).text == "only if it is tied down: raise the throttle to 10 % and hold"
    brief = view(Situation.STILL, throttle=0.1, coverage=seen, seconds=10.0)
    assert guide(brief).text == "hold the throttle where it is"


def test_before_anything_it_says_how_to_begin():
    assert "arm and fly" in guide(view(Situation.GROUND, armed=False)).text
    blind = view(Situation.GROUND, armed=None, attitude=None)
    assert guide(blind).text == "waiting for the vehicle's attitude"


def test_seconds_and_levels_follow_the_coverage():
    seen = coverage(l0=range(36), l4=range(12))
    assert levels_done(seen) == (0,)
    shown = view(Situation.HELD, coverage=seen, seconds=48.0)
    assert level_seconds(shown)[0] == pytest.approx(36.0)
    assert level_seconds(shown)[4] == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("situation", "disarmed_s", "levels", "done"),
    [
        (Situation.FLYING, 5.0, 0, True),
        (Situation.FLYING, 1.0, 0, False),
        (Situation.STILL, 5.0, 0, True),
        (Situation.HELD, 5.0, 1, False),
        (Situation.HELD, 5.0, 3, True),
        (Situation.GROUND, 99.0, 9, False),
        (Situation.UNSURE, 99.0, 0, True),
        (Situation.UNSURE, 1.0, 0, False),
    ],
)
def test_disarming_ends_what_has_begun(situation, disarmed_s, levels, done):
    assert pilot_is_done(situation, disarmed_s, levels) is done


def test_where_nobody_knows_whether_it_flies_a_good_answer_ends_it_too():
    seen = coverage(l3=headings(range(SECTORS)))
    unsure = view(Situation.UNSURE, coverage=seen, seconds=90.0, grade=Grade.GOOD, stable_refits=2)
    assert guide(unsure).enough
    assert not guide(replace(unsure, seconds=30.0)).enough
    assert not guide(replace(unsure, stable_refits=0)).enough


# ---------------------------------------------------------------- what is never said


@st.composite
def views(draw, situation):
    counts = np.zeros((LEVELS, CELLS), dtype=np.int64)
    for _ in range(draw(st.integers(0, 4))):
        level = draw(st.integers(0, LEVELS - 1))
        cells = draw(st.lists(st.integers(0, CELLS - 1), max_size=CELLS))
        counts[level, cells] = draw(st.integers(1, 1000))
    angle = st.floats(-math.pi, math.pi)
    return View(
        situation=situation,
        armed=draw(st.sampled_from([True, False, None])),
        throttle=draw(st.none() | st.floats(0.0, 1.0)),
        attitude=draw(st.none() | st.tuples(angle, angle, angle)),
        height_m=draw(st.none() | st.floats(-10.0, 200.0)),
        coverage=Coverage(counts),
        seconds=draw(st.floats(0.0, 1e4)),
        grade=draw(st.none() | st.sampled_from(list(Grade))),
        stable_refits=draw(st.integers(0, 10)),
    )


@given(views(Situation.FLYING))
def test_in_the_air_there_is_no_word_of_throttle_tilt_or_disarming_before_landing(seen):
    text = guide(seen).text
    assert not re.search(r"throttle|%|tilt|nose|side|over|motor", text)
    assert "disarm" not in text or "land and disarm" in text


@given(views(Situation.FLYING))
def test_nobody_low_is_told_to_descend(seen):
    if seen.height_m is None or seen.height_m < 8.0:
        assert "descend" not in guide(seen).text


@given(views(Situation.UNSURE))
def test_as_long_as_it_may_be_free_nobody_is_told_another_throttle(seen):
    assert not re.search(r"raise|lower|%|climb", guide(seen).text)


@given(views(Situation.STILL))
def test_a_still_vehicle_gets_more_throttle_only_if_tied_down(seen):
    text = guide(seen).text
    assert "raise the throttle" not in text or text.startswith("only if it is tied down")


@given(st.sampled_from(list(Situation)).flatmap(views))
def test_guidance_is_a_share_and_a_text_in_every_situation(seen):
    told = guide(seen)
    assert 0.0 <= told.share_done <= 1.0 + 1e-9
    assert told.text
    assert told.enough == (told.share_done == 1.0)
    if told.share_done > 0.0:
        assert told.enough == (not told.missing)
