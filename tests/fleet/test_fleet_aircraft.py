"""Flights put together by aircraft: whose they are, which disagree and why, what needs doing."""

from __future__ import annotations

import json

import numpy as np
import pytest
from made_flights import DAY, FIRST, MOTOR, fleet, log_of, row, selected

from magcomp.fleet.aircraft import aircraft
from magcomp.fleet.as_json import fleet_object
from magcomp.fleet.as_text import fleet_text
from magcomp.fleet.findings import Attention, Holds, changed_since, scattering, texts
from magcomp.fleet.flights import select
from magcomp.fleet.row import Row, State, without_fit
from magcomp.fleet.run import Known, key
from magcomp.fleet.store import table_of
from magcomp.report.as_json import dumps
from magcomp.report.look import Look


def scattered(count: int, seed: int = 0, **changed: object) -> list[Row]:
    rng = np.random.default_rng(seed)
    return [row(k, MOTOR + 0.02 * rng.normal(size=3), **changed) for k in range(count)]


def test_flights_that_agree_are_pooled_and_need_nothing() -> None:
    (found,) = aircraft(selected(scattered(8)))
    (compass,) = found.compasses
    assert compass.pooled is not None
    assert compass.pooled.count == 8
    np.testing.assert_allclose(compass.pooled.motor, MOTOR, atol=4 * 0.02 / np.sqrt(8))
    assert (found.attention, compass.holds) == (Attention.NONE, Holds.YES)


def test_boards_tell_aircraft_apart_though_their_compasses_are_of_one_kind() -> None:
    rows = [row(k, uid=f"board{k % 3}") for k in range(9)]
    assert sorted(each.uid for each in aircraft(selected(rows))) == ["board0", "board1", "board2"]


def test_a_log_without_board_goes_with_the_one_board_that_has_its_compasses() -> None:
    (found,) = aircraft(selected([row(0), row(1, uid="")]))
    assert (found.known_by, found.logs) == ("board", 2)


def test_a_log_without_board_goes_with_none_of_two() -> None:
    rows = [row(0, uid="one"), row(1, uid="two"), row(2, uid="")]
    assert sorted(each.known_by for each in aircraft(selected(rows))) == [
        "board",
        "board",
        "compasses",
    ]


def test_logs_of_nobody_are_not_put_together() -> None:
    rows = [row(k, uid="", device_ids="") for k in range(3)]
    assert [each.known_by for each in aircraft(selected(rows))] == ["log"] * 3


def test_flights_of_which_each_says_something_else_have_no_common_answer() -> None:
    rng = np.random.default_rng(1)
    (found,) = aircraft(selected([row(k, MOTOR + rng.normal(size=3)) for k in range(6)]))
    assert not found.compasses[0].agree
    assert not any("several aircraft" in each.text for each in found.findings)
    rows = [row(k, MOTOR + rng.normal(size=3), uid="") for k in range(6)]
    (weak,) = aircraft(selected(rows))
    assert any("several aircraft" in each.text for each in weak.findings)
    assert any("no common answer" in each.text for each in found.findings)
    assert all(each.compasses[0].agree for each in aircraft(selected(scattered(6))))
    assert not aircraft(selected(scattered(1)))[0].compasses[0].agree


def test_a_flight_apart_is_named_with_what_differs_and_left_out() -> None:
    rows = scattered(9)
    rows[4] = row(4, MOTOR + np.array([0.0, 2.0, 0.0]), firmware="4.5.7", u_high=12.0)
    (found,) = aircraft(selected(rows))
    ((index, why),) = found.compasses[0].apart
    assert index == 4
    assert "firmware 4.5.7" in why
    assert "only up to 12 A" in why
    assert found.compasses[0].pooled is not None
    assert found.compasses[0].pooled.count == 8
    assert found.attention is Attention.LOOK


def test_a_step_is_dated_and_what_was_before_is_not_pooled() -> None:
    rows = scattered(6) + [row(6 + k, MOTOR + np.array([1.5, 0.0, 0.0])) for k in range(5)]
    (found,) = aircraft(selected(rows))
    (compass,) = found.compasses
    assert compass.drift_deg > 5.0
    assert compass.agreeing == (6, 7, 8, 9, 10)
    assert found.attention is Attention.ACT
    day = np.datetime64(int(FIRST + 6 * DAY), "s").astype("datetime64[D]")
    assert any(f"changed on {day}" in each.text for each in found.findings)


@pytest.mark.parametrize(
    ("before", "holds", "attention"),
    [
        (1.0, Holds.YES, Attention.NONE),
        (4.0, Holds.BARELY, Attention.LOOK),
        (25.0, Holds.NO, Attention.ACT),
        (float("nan"), Holds.UNKNOWN, Attention.NONE),
    ],
)
def test_the_newest_flight_tells_whether_the_calibration_holds(
    before: float, holds: Holds, attention: Attention
) -> None:
    (found,) = aircraft(selected([row(0, before_deg=50.0), row(1, before_deg=before)]))
    assert (found.compasses[0].holds, found.attention) == (holds, attention)


def test_a_rejected_fit_is_not_pooled() -> None:
    rows = [*scattered(4), row(4, 50 * MOTOR, verdict="rejected", reasons="too weak")]
    (found,) = aircraft(selected(rows))
    assert found.compasses[0].pooled is not None
    assert found.compasses[0].pooled.count == 4
    assert "too weak" in found.findings[0].text


def test_another_compass_in_the_same_place_is_not_compared() -> None:
    rows = [row(k, 3 * MOTOR, device_id=1, device_ids="1") for k in range(3)]
    rows += [row(3 + k) for k in range(3)]
    (found,) = aircraft(selected(rows))
    assert len(found.compasses[0].flights) == 3
    assert "was another one before" in found.findings[0].text


def test_a_copy_counts_once() -> None:
    made = row(0)
    copy = without_fit(log_of(row(1)), made.digest, "", state=State.COPY)
    known = Known({key(log_of(each)): made.digest for each in (made, *copy)}, {}, frozenset())
    found = select(table_of([*copy, made]), [log_of(made), log_of(row(1))], known)
    assert (len(found.flights), len(found.unusable), found.copies) == (1, 0, 1)


def test_flights_before_the_day_asked_for_are_left_out() -> None:
    rows = scattered(5)
    known = Known({key(log_of(each)): each.digest for each in rows}, {}, frozenset())
    found = select(table_of(rows), [log_of(each) for each in rows], known, FIRST + 2.5 * DAY)
    assert len(found.flights) == 2


def test_what_needs_attention_leads() -> None:
    rows = [row(k, uid=f"u{k}", before_deg=[0.5, 30.0, 4.0, 12.0][k]) for k in range(4)]
    assert [each.uid for each in aircraft(selected(rows))] == ["u1", "u3", "u2", "u0"]


def test_nothing_hostile_reaches_the_terminal() -> None:
    evil = "\x1b[2J\x07evil\n"
    made = [row(0, uid=evil, firmware=evil, before_deg=20.0), row(1, uid="ok")]
    bad = without_fit(log_of(row(2)), "f" * 64, f"bad {evil}")
    text = fleet_text(fleet([*made, *bad]), Look(), verbose=True)
    assert "\x1b" not in text
    assert "\x07" not in text
    assert "evil" in text


def test_numbers_that_are_none_are_null() -> None:
    rows = [row(0, before_deg=float("nan"), start_unix_s=float("inf"), strength=float("nan"))]
    document = json.loads(dumps(fleet_object(fleet(rows))))
    assert document["aircraft"][0]["compasses"][0]["flights"][0]["before_deg"] is None


def test_compasses_that_differ_in_degrees_alone_are_told_together_by_the_largest() -> None:
    rows = [row(0, before_deg=9.0), row(0, compass=2, before_deg=12.04), row(0, compass=3)]
    (found,) = fleet(rows).aircraft
    (said,) = texts(found.findings)
    assert said.startswith("compasses 1 and 2: the calibration in force does not hold")
    assert "wrong by up to 12.0° at" in said


def test_what_differs_is_told_as_a_bound_and_what_is_alike_as_it_is() -> None:
    moved = [
        changed_since(slot, "step", 1.7e9, degrees, 25.0, "current")
        for slot, degrees in ((1, 9.0), (2, 12.0))
    ]
    assert "by up to 12.0° of heading" in texts(moved)[0]
    assert "by 9.0° of heading" in texts(moved[:1] * 2)[0]
    apart = [scattering(slot, 3, 5.0 + slot, 25.0, "current") for slot in (1, 2)]
    assert "by about 7.0° of heading" in texts(apart)[0]
