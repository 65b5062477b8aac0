"""In the air, held or tied down: told from motors, attitude and force, or by the user."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from magcomp.live.situation import (
    BRIEF_S,
    STILL_S,
    G,
    Look,
    Manoeuvre,
    Situation,
    SituationWatch,
)
from magcomp.sources import read

LOGS = Path(__file__).parents[2] / "sitl_fixtures"
LEVEL = (0.0, 0.0, 0.0)


def at_rest(attitude):
    """What the accelerometer of a vehicle feels that something holds."""
    roll, pitch, _ = attitude
    return (
        G * math.sin(pitch),
        -G * math.cos(pitch) * math.sin(roll),
        -G * math.cos(pitch) * math.cos(roll),
    )


def free(_):
    """What the accelerometer of a multirotor feels that gathers speed."""
    return (0.0, 0.0, -G)


def watched(attitudes, feels=at_rest, heights=None, watch=None, start=0.0, armed=True):
    """A watch after looks five times a second."""
    watch = watch or SituationWatch()
    for index, attitude in enumerate(attitudes):
        height = None if heights is None else heights[index]
        watch.update(Look(start + 0.2 * index, armed, attitude, height, feels(attitude)))
    return watch


def tilted(degrees, seconds, yaw=0.0):
    return [(math.radians(degrees), 0.0, yaw)] * round(5 * seconds)


def turned(seconds, roll=0.0):
    """Turns about the upright axis."""
    return [(roll, 0.0, math.remainder(0.2 * k * 0.3, math.tau)) for k in range(round(5 * seconds))]


def test_a_disarmed_vehicle_is_on_the_ground_however_it_is_turned():
    assert watched(tilted(90, 5), armed=False).situation is Situation.GROUND


def test_a_tilted_vehicle_that_feels_nothing_across_its_axis_flies():
    assert watched([*turned(3), *tilted(12, 3)], free).situation is Situation.FLYING


def test_once_flying_it_flies_whatever_comes_until_it_is_disarmed():
    watch = watched([*turned(3), *tilted(12, 3)], free)
    watched([*tilted(20, 30), *tilted(80, 3)], watch=watch, start=6.0)
    assert watch.situation is Situation.FLYING


@pytest.mark.parametrize("drift", [8.0, -8.0])
def test_height_and_speed_that_drift_on_a_stand_make_no_flight_of_it(drift):
    attitudes = [*turned(10), *tilted(20, 20), *tilted(70, 5), *turned(20, roll=0.7)]
    heights = np.linspace(0.0, drift, len(attitudes)).tolist()
    watch = SituationWatch()
    for index, attitude in enumerate(attitudes):
        look = Look(0.2 * index, True, attitude, heights[index], at_rest(attitude))
        assert watch.update(look) is not Situation.FLYING
    assert watch.situation is Situation.HELD


def test_a_knock_against_a_stand_makes_no_flight_of_it():
    watch = watched([*turned(3), *tilted(12, 20)])
    watched(tilted(12, 2), free, watch=watch, start=23.0)
    watched(tilted(12, 30), watch=watch, start=25.0)
    assert watch.situation is not Situation.FLYING


def test_a_vehicle_tipped_over_is_held_and_stays_so():
    watch = watched([*turned(2), *tilted(100, 1), *tilted(5, 20)])
    assert watch.situation is Situation.HELD
    watched(tilted(5, 2), watch=watch, start=30.0, armed=False)
    assert watch.situation is Situation.HELD
    watched(tilted(12, 60), free, watch=watch, start=33.0)
    assert watch.situation is Situation.HELD


def test_a_steady_wind_holds_a_hover_tilted_and_nobody_is_told_a_throttle():
    attitudes = [(math.radians(10 + math.sin(k)), 0.0, 0.0) for k in range(200)]
    heights = [min(0.1 * k, 10.0) for k in range(200)]
    assert watched(attitudes, heights=heights).situation is Situation.UNSURE


def test_a_vehicle_that_does_not_move_at_all_for_long_is_tied_down():
    assert watched(tilted(1, STILL_S + 2)).situation is Situation.STILL
    assert watched(tilted(1, STILL_S - 2)).situation is Situation.UNSURE


def test_a_low_hover_is_not_taken_for_tied_down():
    wobbling = [(math.radians(0.5 * math.sin(k)), 0.0, 0.0) for k in range(100)]
    assert watched(wobbling).situation is Situation.UNSURE


def test_without_accelerometer_nothing_is_taken_for_a_flight():
    watch = SituationWatch()
    for index, attitude in enumerate([*turned(5), *tilted(20, 20)]):
        watch.update(Look(0.2 * index, True, attitude, 50.0))
    assert watch.situation is Situation.UNSURE


def test_yaw_that_wraps_is_no_turn():
    near = [(0.0, 0.0, yaw) for yaw in (math.pi - 0.05, -math.pi + 0.05)] * 30
    assert watched(near).situation is Situation.STILL


@pytest.mark.parametrize(("extra", "left"), [(-5.0, "ground"), (5.0, "unsure")])
def test_motors_on_for_a_moment_were_a_trial(extra, left):
    seconds = BRIEF_S + extra
    watch = watched(turned(seconds))
    watched(turned(1), watch=watch, start=seconds, armed=False)
    assert watch.situation == left


@pytest.mark.parametrize(
    ("said", "situation"),
    [
        (Manoeuvre.STAND, Situation.HELD),
        (Manoeuvre.FLIGHT, Situation.FLYING),
        (Manoeuvre.SWEEP, Situation.STILL),
    ],
)
def test_what_the_user_says_goes_before_what_is_found(said, situation):
    watch = SituationWatch(said)
    assert watched(turned(1), watch=watch, armed=False).situation is Situation.GROUND
    assert watched(tilted(12, 5), free, watch=watch, start=1.0).situation is situation
    watch.manoeuvre = None
    assert watch.situation is Situation.FLYING


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("flight", Situation.FLYING),
        ("mission_compensated", Situation.FLYING),
        ("sweep_current", Situation.STILL),
        ("turntable_paper", Situation.HELD),
    ],
)
def test_recordings_are_told_apart_within_half_a_minute(name, expected):
    log = read(LOGS / f"{name}.tlog")
    watch, begun = SituationWatch(), None
    for time in np.arange(log.attitude.time[0], log.duration_s, 0.2):
        row = {
            key: series.value[max(np.searchsorted(series.time, time, side="right") - 1, 0)]
            for key, series in vars(log).items()
            if key in ("attitude", "accel", "armed")
        }
        armed = bool(row["armed"])
        begun = time if armed and begun is None else begun
        found = watch.update(Look(time, armed, tuple(row["attitude"]), None, tuple(row["accel"])))
        if begun is not None and time > begun + 30.0:
            assert found is expected
