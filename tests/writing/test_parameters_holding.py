"""What a vehicle holds, in a line."""

from __future__ import annotations

from dataclasses import replace

from fake_autopilot import NEW, OLD, QUAD

from magcomp.writing.holding import holding


def test_what_acts_is_named_with_its_compasses() -> None:
    everything = "motor compensation by current for compasses 1, 2 and 3"
    assert holding(QUAD, OLD) == everything
    assert holding(QUAD, NEW) == everything.replace("current", "throttle")


def test_compasses_without_a_vector_are_named() -> None:
    second = {f"COMPASS_MOT2_{axis}": 0.0 for axis in "XYZ"}
    assert holding(QUAD, {**OLD, **second}) == (
        "motor compensation by current for compasses 1 and 3, none for compass 2"
    )


def test_a_switch_that_is_0_is_off_whatever_vectors_there_are() -> None:
    assert holding(QUAD, {**OLD, "COMPASS_MOTCT": 0.0}) == "motor compensation off"


def test_values_that_are_no_numbers_spoil_no_line() -> None:
    line = holding(QUAD, {**OLD, "COMPASS_OFS_X": float("nan")})
    assert line.startswith("motor compensation by current")
    assert (
        holding(replace(QUAD, compasses=()), OLD) == "motor compensation by current for compass 1"
    )
