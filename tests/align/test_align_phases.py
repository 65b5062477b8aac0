"""A quadplane's forward flight is told from its hover, and never mixed into one vector."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import INTERFERENCE
from unequal import Unequal

from magcomp.align.phases import on_lift_alone
from magcomp.analysis.analyse import Options, analyse, check
from magcomp.analysis.contents import contents
from magcomp.errors import MissingDataError
from magcomp.model import ParameterChange, ParameterHistory, Series
from magcomp.report import as_json, as_text
from magcomp.report.look import Look

FROM, UNTIL = 60.0, 100.0
PUSHED = np.array([-2.0, 1.5, 1.0])
"""What the pusher's current adds, mGauss per A, in the place of the lift motors'."""

FUNCTIONS = {
    **{f"SERVO{n}_FUNCTION": 0.0 for n in (1, 2, 4)},
    "SERVO3_FUNCTION": 70.0,
    **{f"SERVO{4 + n}_FUNCTION": 32.0 + n for n in (1, 2, 3, 4)},
}


def quadplane(*, forward=True, functions=FUNCTIONS):
    flown = Unequal(seed=1, vectors=np.tile(INTERFERENCE, (4, 1)))
    made = flown.recording()
    time, lift = made.outputs.time, made.outputs.value[:, :4]
    pushed = (time > FROM) & (time < UNTIL) & forward
    outputs = np.zeros((len(time), 16))
    outputs[:, 4:8] = np.where(pushed[:, None], 1000.0, lift)
    outputs[:, 2] = np.where(pushed, 1700.0, 1000.0)
    field = made.field[1]
    within = (field.time > FROM) & (field.time < UNTIL) & forward
    added = flown.current_at(field.time - flown.current_lag)[:, None] * (PUSHED - INTERFERENCE)
    changes = [ParameterChange(0.0, name, value) for name, value in functions.items()]
    rest = (c for c in made.parameters.changes if not c.name.startswith("SERVO"))
    return replace(
        made,
        vehicle=replace(made.vehicle, kind="plane"),
        outputs=Series(time, outputs),
        field={1: Series(field.time, field.value + within[:, None] * added)},
        parameters=ParameterHistory((*rest, *changes)),
    )


def test_readings_and_current_of_forward_flight_are_left_out_and_said_so():
    hover, told = on_lift_alone(quadplane())
    assert "holds for hovering" in told
    for series in (hover.field[1], hover.current):
        assert not np.any((series.time > FROM) & (series.time < UNTIL))
        assert np.any(series.time < FROM - 2.0)
        assert np.any(series.time > UNTIL + 2.0)


def test_a_firmware_that_says_when_it_flies_forward_is_believed():
    """Told rarely: from each time on it is as was said last."""
    told = Series(np.array([0.0, FROM, UNTIL]), np.array([0.0, 1.0, 0.0]))
    silent = replace(quadplane(functions={}), forward=told)
    copter = replace(silent, vehicle=replace(silent.vehicle, kind="copter"))
    hover, words = on_lift_alone(copter)
    assert words.startswith("the vehicle flies forward in 3")
    for series in (hover.field[1], hover.current):
        assert not np.any((series.time > FROM) & (series.time < UNTIL))
        assert np.any(series.time < FROM - 2.0)
        assert np.any(series.time > UNTIL + 2.0)
    never = replace(copter, forward=Series(told.time, np.zeros(3)))
    assert on_lift_alone(never) == (never, "")


def test_forward_flight_is_left_out_of_what_only_throttle_tells():
    told = Series(np.array([0.0, FROM, UNTIL]), np.array([0.0, 1.0, 0.0]))
    made = replace(quadplane(functions={}), forward=told)
    by_current, _ = on_lift_alone(made)
    hover, words = on_lift_alone(replace(made, current=None, throttle=made.current))
    assert words.startswith("the vehicle flies forward in 3")
    assert np.array_equal(hover.field[1].time, by_current.field[1].time)
    assert np.array_equal(hover.throttle.time, by_current.current.time)


def test_a_pusher_that_runs_in_what_is_said_to_be_a_hover_is_left_out_too():
    told = Series(np.array([0.0, 20.0, 40.0]), np.array([0.0, 1.0, 0.0]))
    hover, words = on_lift_alone(replace(quadplane(), forward=told))
    assert words.startswith("the vehicle flies forward")
    for begin, end in ((20.0, 40.0), (FROM, UNTIL)):
        assert not np.any((hover.field[1].time > begin) & (hover.field[1].time < end))


def test_a_check_says_that_forward_flight_is_left_out():
    recording = quadplane()
    verdicts = check(recording)
    text = as_text.check_text(recording, verdicts, "current", Look())
    assert "pusher drives the vehicle" in " ".join(text.split())
    (note,) = as_json.check_object(recording, verdicts, "current")["notes"]
    assert "holds for hovering" in note
    copter = replace(recording, vehicle=replace(recording.vehicle, kind="copter"))
    assert as_json.check_object(copter, verdicts, "current")["notes"] == []


def test_a_pusher_beside_running_lift_motors_is_left_out_too():
    recording = quadplane()
    value = recording.outputs.value.copy()
    value[:, 4:8] = np.maximum(value[:, 4:8], 1400.0)
    hover, told = on_lift_alone(replace(recording, outputs=Series(recording.outputs.time, value)))
    assert told
    assert not np.any((hover.field[1].time > FROM) & (hover.field[1].time < UNTIL))


@pytest.mark.parametrize(
    "recording",
    [
        quadplane(forward=False),
        replace(quadplane(), vehicle=Unequal(seed=1).recording().vehicle),
        quadplane(functions={}),
        replace(quadplane(), outputs=None),
    ],
    ids=["never forward", "a copter", "no lift motors named", "no outputs"],
)
def test_what_has_no_two_phases_stays_as_it_is(recording):
    assert on_lift_alone(recording) == (recording, "")


def test_the_hovers_vector_is_found_beside_forward_flight():
    found = analyse(quadplane(), Options(regressor="current"))
    (compass,) = found.compasses
    assert np.linalg.norm(compass.fit.interference - INTERFERENCE) < 0.15
    assert not any("drops out" in reason for reason in compass.verdict.reasons)
    assert any("a pusher drives the vehicle" in note for note in found.notes)


@pytest.mark.parametrize("look", [analyse, check])
def test_a_flight_without_a_hover_says_so(look):
    never = Series(np.array([0.0]), np.array([1.0]))
    recording = replace(quadplane(), forward=never)
    with pytest.raises(MissingDataError, match=r"must hold a hover; .* flies forward in 100 %"):
        look(recording)
    (missing,) = (each for each in contents(recording).missing if each.prevents)
    assert missing.what == "a hover"
