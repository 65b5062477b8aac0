"""Sensors that fail are named from their readings alone; sound ones are left in peace."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import truth
from synthetic import Flown

from magcomp.align.health import compass_complaints, current_complaints, vehicle_complaints
from magcomp.model import ParameterChange, ParameterHistory, Recording, Series
from magcomp.sources import read

FIXTURES = (
    "flight",
    "flight_low_rate",
    "flight_uncalibrated",
    "flight_wrong_mot",
    "turntable_paper",
    "turntable_five_levels",
    "sweep_current",
)


@pytest.fixture(scope="module")
def sound() -> Recording:
    recording = Flown(seed=2, seconds=120.0).recording()
    current = recording.current
    assert current is not None
    return replace(recording, throttle=Series(current.time, current.value / 60.0))


def with_field(
    recording: Recording, value: np.ndarray, keep: np.ndarray | None = None
) -> Recording:
    time = recording.field[1].time
    rows = np.ones(len(time), bool) if keep is None else keep
    return replace(recording, field={1: Series(time[rows], value[rows])})


def with_current(recording: Recording, change) -> Recording:
    current = recording.current
    return replace(recording, current=Series(current.time, change(current.time, current.value)))


def test_a_sound_vehicle_gives_no_complaint(sound):
    assert compass_complaints(sound, 1) == ()
    assert current_complaints(sound) == ()


@pytest.mark.parametrize("name", FIXTURES)
def test_recordings_of_the_real_firmware_give_no_complaint(name):
    recording = read(truth.FIXTURES / f"{name}.tlog")
    assert [compass_complaints(recording, n) for n in recording.field] == [()] * 3
    assert current_complaints(recording) == ()


def test_a_frozen_compass_is_named_with_its_time(sound):
    field = sound.field[1]
    value = np.where((field.time > 60.0)[:, None], field.value[600], field.value)
    (complaint,) = compass_complaints(with_field(sound, value), 1)
    assert "frozen from 6" in complaint


def test_attitudes_that_tell_each_others_time_are_no_reason_to_fail(sound):
    # As a fuzzed log had it: every attitude twice at one time, and a pause of the compass.
    attitude = sound.attitude
    twice = Series(np.repeat(attitude.time, 3), np.repeat(attitude.value, 3, axis=0))
    field = sound.field[1]
    keep = (field.time < 20.0) | (field.time > 40.0)
    paused = replace(with_field(sound, field.value, keep), attitude=twice)
    assert all("drops out" not in each for each in compass_complaints(paused, 1))


def test_a_compass_that_drops_out_is_named(sound):
    field = sound.field[1]
    keep = field.time % 15.0 > 4.0
    (complaint,) = compass_complaints(with_field(sound, field.value, keep), 1)
    assert "drops out" in complaint


def test_dropouts_of_a_few_readings_show_on_a_slow_link_too(sound):
    """At 1.7 readings a second four seconds are hardly more than six readings."""
    field = sound.field[1]
    slow = np.arange(len(field)) % 6 == 0
    assert compass_complaints(with_field(sound, field.value, slow), 1) == ()
    (complaint,) = compass_complaints(
        with_field(sound, field.value, slow & (field.time % 15.0 > 4.0)), 1
    )
    assert "drops out" in complaint


def test_a_compass_that_is_told_more_often_later_on_did_not_drop_out_before(sound):
    field = sound.field[1]
    number = np.arange(len(field))
    told = (number % 20 == 0) | (field.time > 0.6 * field.time[-1])
    assert compass_complaints(with_field(sound, field.value, told), 1) == ()


def test_strong_soft_iron_on_a_slow_link_is_no_glitch(sound):
    """Each reading of a turn then differs much from the one before."""
    field = sound.field[1]
    slow = np.arange(len(field)) % 6 == 0
    turned = np.cumsum(np.where(field.time % 15.0 < 5.0, 0.1, 0.0))
    axes = np.stack([np.cos(turned), np.sin(turned), np.full(len(turned), 0.3)], axis=1)
    noise = np.random.default_rng(3).normal(size=axes.shape)
    stretched = 480.0 * axes * np.array([1.5, 0.7, 0.7]) + noise
    assert compass_complaints(with_field(sound, stretched, slow), 1) == ()


def test_a_gap_of_the_whole_link_is_not_the_compass(sound):
    field, attitude = sound.field[1], sound.attitude
    heard = attitude.time % 15.0 > 4.0
    gappy = replace(sound, attitude=Series(attitude.time[heard], attitude.value[heard]))
    assert compass_complaints(with_field(gappy, field.value, field.time % 15.0 > 4.0), 1) == ()


def test_a_compass_that_glitches_is_named(sound):
    rng = np.random.default_rng(1)
    value = sound.field[1].value.copy()
    value[rng.random(len(value)) < 0.08] *= 3.0
    (complaint,) = compass_complaints(with_field(sound, value), 1)
    assert "glitches" in complaint


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda time, value: 0.0 * value, "reads 0 A"),
        (lambda time, value: np.where(time > 40.0, 25.0, value), "stuck"),
        (lambda time, value: np.minimum(value, np.quantile(value, 0.6)), "saturates"),
    ],
    ids=["dead", "stuck", "saturated"],
)
def test_a_battery_monitor_that_fails_is_named(sound, change, word):
    (complaint,) = current_complaints(with_current(sound, change))
    assert word in complaint


def test_a_monitor_that_saturates_shows_in_a_hover_too(sound):
    """Where the throttle hardly changes it changes little at the top of the current as well."""
    saturated = with_current(sound, lambda _, value: np.minimum(value, np.quantile(value, 0.6)))
    throttle = sound.throttle
    narrow = Series(throttle.time, 0.45 + 0.1 * (throttle.value - throttle.value.mean()))
    (complaint,) = current_complaints(replace(saturated, throttle=narrow))
    assert "saturates" in complaint


def test_a_monitor_that_tells_coarse_steps_does_not_saturate(sound):
    coarse = with_current(sound, lambda _, value: 20.0 * np.rint(value / 20.0))
    top = coarse.current.value == coarse.current.value.max()
    assert np.mean(top) > 0.1
    assert current_complaints(coarse) == ()


def test_compasses_that_become_others_are_two_aircraft() -> None:
    ids = (ParameterChange(0.0, "COMPASS_DEV_ID", 97539.0),)
    other = (*ids, ParameterChange(30.0, "COMPASS_DEV_ID", 97540.0))
    flown = Flown(seconds=20.0).recording()
    assert vehicle_complaints(replace(flown, parameters=ParameterHistory(ids))) == ()
    (said,) = vehicle_complaints(replace(flown, parameters=ParameterHistory(other)))
    assert "two aircraft" in said
