"""What a recording holds, which of it is chosen, and what its firmware can multiply."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import Flown, Swept

from magcomp.analysis import Options, analyse, parameter_set
from magcomp.analysis.choose import with_attitude, with_battery
from magcomp.analysis.contents import contents
from magcomp.analysis.vehicle_words import in_words_of
from magcomp.errors import MissingDataError
from magcomp.model import ParameterChange, ParameterHistory, Recording, Series


def of_kind(recording: Recording, kind: str) -> Recording:
    return replace(recording, vehicle=replace(recording.vehicle, kind=kind))


@pytest.fixture(scope="module")
def flown() -> Recording:
    return Flown(seed=2, compasses=(1, 2)).recording()


@pytest.fixture(scope="module")
def swept() -> Recording:
    return Swept(seed=2).recording()


# ---------------------------------------------------------------- contents


def test_rates_and_ranges_are_those_of_the_series(flown: Recording) -> None:
    found = contents(flown)
    field = flown.field[1]
    assert [compass.number for compass in found.compasses] == [1, 2]
    assert found.compasses[0].rate_hz == pytest.approx(1 / np.median(np.diff(field.time)))
    battery = next(each for each in found.quantities if each.name == "battery 0")
    assert (battery.count, battery.unit) == (len(flown.current), "A")
    assert battery.high == flown.current.value.max()
    assert found.can_be_fitted


def test_repeats_of_a_reading_do_not_count_as_readings(flown: Recording) -> None:
    field = flown.field[1]
    twice = Series(np.repeat(field.time, 2), np.repeat(field.value, 2, axis=0))
    found = contents(replace(flown, field={1: twice})).compasses[0]
    assert (found.rows, found.readings) == (2 * len(field), contents(flown).compasses[0].readings)


@pytest.mark.parametrize(
    ("lacks", "what"),
    [
        ({"field": {}}, "compass"),
        ({"field": {1: Series(np.arange(9.0), np.arange(27.0).reshape(9, 3))}}, "60 new readings"),
        ({"attitude": None}, "attitude"),
        ({"current": None, "throttle": None}, "throttle"),
        ({"current": Series(np.arange(9.0), np.ones(9)), "throttle": None}, "changes"),
    ],
)
def test_what_prevents_a_fit_is_named_and_does_prevent_it(flown: Recording, lacks, what) -> None:
    recording = replace(flown, **lacks)
    found = contents(recording)
    assert not found.can_be_fitted
    assert what in found.missing[0].what
    assert found.missing[0].how
    with pytest.raises(MissingDataError):
        analyse(recording)


def test_a_throttle_that_the_firmware_does_not_multiply_is_none(flown: Recording) -> None:
    plane = of_kind(replace(flown, current=None, throttle=flown.current), "plane")
    found = contents(plane)
    (missing,) = (each for each in found.missing if each.prevents)
    assert missing.what.startswith("a current, which is all that ArduPilot multiplies in a plane")
    assert "BATT_MONITOR" in missing.how
    with pytest.raises(MissingDataError, match="all that ArduPilot multiplies in a plane"):
        analyse(plane)


def test_what_only_weakens_a_fit_does_not_prevent_it(swept: Recording) -> None:
    recording = replace(swept, position=None, parameters=ParameterHistory())
    found = contents(recording)
    assert {each.what for each in found.missing} == {"the parameters", "a position"}
    assert found.can_be_fitted
    assert analyse(recording).compasses


def test_a_compass_that_cannot_be_fitted_says_why(flown: Recording) -> None:
    nan = ParameterChange(0.0, "COMPASS_MOT_X", float("nan"))
    changes = (*flown.parameters.changes, nan)
    found = contents(replace(flown, parameters=ParameterHistory(changes)))
    assert "COMPASS_MOT_X" in found.compasses[0].left_out
    assert not found.compasses[1].left_out


# ---------------------------------------------------------------- choices


def test_another_battery_is_put_in_front_and_the_first_one_stays(flown: Recording) -> None:
    second = Series(flown.current.time, 0.5 * flown.current.value)
    both = replace(flown, other_currents={1: second})
    chosen = with_battery(both, 1)
    assert chosen.current is second
    assert (chosen.battery, dict(chosen.other_currents)) == (1, {0: flown.current})
    back = with_battery(chosen, 0)
    assert (back.current, dict(back.other_currents)) == (flown.current, {1: second})
    with pytest.raises(MissingDataError, match=r"battery 2; instead it holds that of 0, 1"):
        with_battery(both, 2)


def test_another_attitude_is_put_in_front_and_the_first_one_stays(flown: Recording) -> None:
    other = Series(flown.attitude.time, flown.attitude.value + 0.1)
    both = replace(flown, attitude_source="ATT", other_attitudes={"XKF1": other})
    chosen = with_attitude(both, "xkf1")
    assert (chosen.attitude, chosen.attitude_source) == (other, "XKF1")
    assert with_attitude(chosen, "ATT").attitude is flown.attitude
    with pytest.raises(MissingDataError, match="instead it holds that of ATT, XKF1"):
        with_attitude(both, "AHR2")


# ---------------------------------------------------------------- what the firmware multiplies


def test_a_battery_that_the_firmware_does_not_multiply_is_only_looked_at(swept: Recording) -> None:
    both = replace(swept, other_currents={1: swept.current})
    found = analyse(with_battery(both, 1))
    assert "battery 1" in found.only_to_look_at
    assert not parameter_set(found, include_rejected=True).values
    assert not analyse(swept).only_to_look_at
    assert parameter_set(analyse(swept), include_rejected=True).values


def test_a_second_battery_that_feeds_the_motors_is_named(swept: Recording) -> None:
    feeding = Series(swept.current.time, 0.8 * swept.current.value + 1.0)
    camera = Series(swept.current.time, np.full(len(swept.current), 2.0))
    notes = analyse(replace(swept, other_currents={1: feeding, 2: camera})).notes
    assert any("current of battery 1 rises" in note for note in notes)


def test_the_speed_controllers_current_is_fitted_to_be_looked_at(swept: Recording) -> None:
    escs = Series(swept.current.time, 0.9 * swept.current.value)
    found = analyse(replace(swept, esc_currents={0: escs}), Options(regressor="esc"))
    by_battery = analyse(swept).compasses[0].fit.interference
    np.testing.assert_allclose(found.compasses[0].fit.interference, by_battery / 0.9, rtol=0.02)
    assert "speed controllers" in found.compasses[0].fit.origin
    assert "speed controllers" in found.only_to_look_at
    assert not parameter_set(found, include_rejected=True).values
    with pytest.raises(MissingDataError, match="current of speed controllers"):
        analyse(swept, Options(regressor="esc"))


def test_a_planes_throttle_is_not_what_its_firmware_multiplies(swept: Recording) -> None:
    throttle = Series(swept.current.time, swept.current.value / 100.0)
    plane = of_kind(replace(swept, throttle=throttle), "plane")
    assert {each.fit.regressor for each in analyse(plane).compasses} == {"current"}
    without = replace(plane, current=None)
    with pytest.raises(MissingDataError, match=r"must hold a current.*in a plane"):
        analyse(without)
    found = analyse(without, Options(regressor="throttle"))
    assert "cannot be written" in found.only_to_look_at
    assert not parameter_set(found, include_rejected=True).values


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("copter", "fly climbs and descents so"),
        ("plane", "fly climbs and descents so"),
        ("rover", "drive slowly and fast, uphill and downhill so"),
        ("boat", "drive slowly and fast so"),
        ("sub", "dive up and down, slowly and fast so"),
    ],
)
def test_advice_is_in_the_words_of_the_vehicle(kind: str, said: str) -> None:
    assert in_words_of(kind, "fly climbs and descents so") == said


def test_words_that_only_begin_alike_stay() -> None:
    assert in_words_of("rover", "a flywheel; fly again") == "a flywheel; drive again"
