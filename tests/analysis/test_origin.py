"""Hints on where a disturbance comes from, against leads whose field is reckoned by Biot–Savart."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from synthetic import Flown

from magcomp.analysis.origin import hints, origin_of
from magcomp.fit import fit

AMPERE, LONG_M = 1.0, 20.0


@cache
def fitted():
    return fit(Flown(seed=1, seconds=60.0).problem(), "flight")


def leads(way_deg, below_m, beside_m, apart_m=None):
    """Field of a lead, or of a pair, in mGauss/A at a compass: body axes, z down.

    It runs at an angle off the nose, so far below the compass and so far to its own right.
    """
    import magpylib  # noqa: PLC0415 - it brings matplotlib along, which only these tests need

    way = np.array([np.cos(np.radians(way_deg)), np.sin(np.radians(way_deg)), 0.0])
    side = np.array([-way[1], way[0], 0.0])
    place = beside_m * side + np.array([0.0, 0.0, below_m])
    towards = place / np.linalg.norm(place)
    field = np.zeros(3)
    shifts = [(0.0, 1.0)] if apart_m is None else [(-apart_m / 2, 1.0), (apart_m / 2, -1.0)]
    for shift, sign in shifts:
        at = place + shift * towards
        line = magpylib.current.Polyline(
            current=sign * AMPERE, vertices=[at - LONG_M * way, at + LONG_M * way]
        )
        field += line.getB([0.0, 0.0, 0.0])
    return 1e7 * field


@pytest.mark.parametrize("way_deg", [0.0, 45.0, 90.0, 135.0, 20.0])
@pytest.mark.parametrize(("below", "beside"), [(0.08, 0.0), (-0.06, 0.0), (0.05, 0.07)])
def test_a_single_lead_is_placed_by_its_field(way_deg, below, beside):
    found = origin_of(leads(way_deg, below, beside))
    assert found.single_m == pytest.approx(np.hypot(below, beside), rel=0.01)
    turned = np.degrees(found.way) - way_deg
    assert abs((turned + 90.0) % 180.0 - 90.0) < 0.5
    assert np.degrees(found.height) == pytest.approx(
        np.degrees(np.arctan2(abs(below), abs(beside))), abs=0.5
    )


def test_a_lead_beside_the_compass_is_told_from_one_below_it():
    assert origin_of(leads(90.0, 0.0, 0.08)).height_words.startswith("beside")
    assert origin_of(leads(90.0, 0.08, 0.0)).height_words.startswith("straight below")
    assert origin_of(leads(90.0, 0.08, 0.0)).way_words == "across"


@pytest.mark.parametrize("apart", [0.006, 0.01, 0.018])
@pytest.mark.parametrize("distance", [0.06, 0.1])
def test_a_pair_of_leads_lies_in_the_range_and_is_halved_where_it_says(apart, distance):
    found = origin_of(leads(0.0, distance, 0.0, apart))
    assert found.pair_m[0] < distance < found.pair_m[1]
    middle = np.sqrt(found.pair_m[0] * found.pair_m[1])
    there = np.linalg.norm(leads(0.0, middle, 0.0, 0.01))
    farther = np.linalg.norm(leads(0.0, middle + found.halved_m, 0.0, 0.01))
    assert farther == pytest.approx(there / 2, rel=0.05)


@pytest.mark.parametrize("distance", [0.08, 0.15])
def test_a_loop_lies_in_its_range(distance):
    import magpylib  # noqa: PLC0415

    side = np.sqrt(0.002)
    loop = magpylib.current.Circle(current=AMPERE, diameter=2 * np.sqrt(0.002 / np.pi))
    found = origin_of(1e7 * loop.getB([0.0, 0.0, distance]))
    assert found.loop_m[0] < distance + side / 4 < found.loop_m[1] * 1.1


def test_no_field_has_no_place():
    assert origin_of(np.zeros(3)) is None


def test_a_hint_is_marked_as_one_and_little_is_worth_none():
    said = " ".join(hints([fitted()]))
    assert said.count("a hint, not a measurement") >= 1
    assert "Twist the battery leads" in said
    little = replace(fitted(), correction=replace(fitted().correction, motor=np.full(3, 0.01)))
    assert not list(hints([little]))


def test_a_vector_that_is_not_known_is_no_hint():
    fit = fitted()
    doubtful = replace(fit, covariance=fit.covariance * 1e6)
    assert not list(hints([doubtful]))
    (said, *_) = hints([doubtful, replace(fit, compass=2)])
    assert "compass 2" in said


def test_a_compass_is_moved_by_a_centimetre_at_least():
    near = replace(fitted(), correction=replace(fitted().correction, motor=np.full(3, 400.0)))
    assert "put the compass 1 cm farther" in " ".join(hints([near]))
