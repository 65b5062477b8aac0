"""One model for the whole recording: what bends, steps or moves is found and named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import EXACT, Flown, problem_of

from magcomp.fit import fit
from magcomp.judge import Thresholds, whole
from magcomp.judge.constancy import Departure, departures_of
from magcomp.judge.judge import judge
from magcomp.model import Grade, ParameterChange, ParameterHistory, Recording, Series

FLOWN = Flown(seed=3, seconds=240.0, tilt=0.25)
HALF_S = 120.0


def changed(recording: Recording, added: np.ndarray) -> Recording:
    field = recording.field[1]
    return replace(recording, field={1: Series(field.time, field.value + added)})


def found(recording: Recording) -> dict[str, Departure]:
    problem = problem_of(recording)
    fitted = fit(problem, "flight")
    return {d.kind: d for d in departures_of(problem, fitted, fitted.lags)}


def amperes(recording: Recording) -> np.ndarray:
    measured = recording.field[1].time - FLOWN.current_lag
    return np.interp(measured, recording.current.time, recording.current.value)


@pytest.fixture(scope="module")
def sound() -> Recording:
    return FLOWN.recording()


@pytest.mark.parametrize("seed", range(4))
def test_a_sound_flight_departs_nowhere(seed):
    departures = found(replace(FLOWN, seed=seed).recording())
    assert {kind for kind, d in departures.items() if d.is_plain and d.degrees > 1.0} == set()


def test_a_payload_that_comes_half_way_is_a_step_of_its_size(sound):
    late = sound.field[1].time > HALF_S
    magnet = np.array([12.0, -9.0, 5.0])
    step = found(changed(sound, np.multiply.outer(late, EXACT.soft_iron @ magnet)))["step"]
    assert step.is_plain
    assert step.mgauss == pytest.approx(np.linalg.norm(magnet), rel=0.15)
    assert step.at_s == pytest.approx(HALF_S, abs=12.0)


def test_a_wire_that_moves_changes_what_the_motors_add(sound):
    late = sound.field[1].time > HALF_S
    half = -0.5 * np.multiply.outer(late * amperes(sound), -EXACT.vector)
    departure = found(changed(sound, half))["motors"]
    assert departure.is_plain
    assert departure.degrees > 5.0


def test_interference_that_grows_with_the_square_is_a_curve(sound):
    u = amperes(sound)
    top = np.quantile(u, 0.98)
    bend = np.array([30.0, 0.0, 0.0])
    curve = found(changed(sound, np.multiply.outer((u / top) ** 2, bend)))["curve"]
    assert curve.is_plain
    # What a line through what was flown leaves where it leaves most, from rest to the top.
    share, grid = u / top, np.linspace(0.0, 1.0, 101)
    left = grid**2 - np.polyval(np.polyfit(share, share**2, 1), grid)
    assert curve.mgauss == pytest.approx(30.0 * np.abs(left).max(), rel=0.3)


def test_a_step_keeps_a_fit_from_being_good_and_is_named(sound):
    late = sound.field[1].time > HALF_S
    problem = problem_of(changed(sound, np.multiply.outer(late, [15.0, 10.0, 0.0])))
    verdict = judge(problem, fit(problem, "flight"))[1]
    assert verdict.grade is not Grade.GOOD
    assert "payload" in verdict.reasons[0]


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [("COMPASS_DIA_X", 1.06, True), ("COMPASS_OFS_X", 60.0, True), ("COMPASS_OFS_X", 6.0, False)],
)
def test_two_aircraft_in_one_log_are_told_by_the_calibration_that_changes(sound, name, value, told):
    history = sound.parameters
    later = ParameterChange(HALF_S, name, history.last(name, 0.0) + value)
    late = sound.field[1].time > HALF_S
    another = replace(
        changed(sound, np.multiply.outer(late, [35.0, 20.0, 0.0])),
        parameters=ParameterHistory((*history.changes, later), history.whole),
    )
    problem = problem_of(another)
    reason = judge(problem, fit(problem, "flight"))[1].reasons[0]
    assert ("another aircraft" in reason) is told
    assert " changed by " in reason


def test_a_complaint_about_a_sensor_rejects(sound):
    problem = problem_of(sound)
    verdict = judge(problem, fit(problem, "flight"), complaints=("compass 1 is frozen",))[1]
    assert verdict.grade is Grade.REJECTED
    assert verdict.reasons[0] == "compass 1 is frozen"


# --- a small step beside a small bound -------------------------------------------------------


def grades(recording: Recording, monkeypatch, departure: Departure, bound: float) -> list[Grade]:
    problem = problem_of(recording)
    fitted = fit(problem, "flight")
    monkeypatch.setattr(whole, "departures_of", lambda *_: (departure,))
    return [finding.grade for finding in whole.on_constancy(problem, fitted, Thresholds(), bound)]


@pytest.mark.parametrize(
    ("kind", "degrees", "bound", "found"),
    [
        ("step", 1.3, 1.5, []),
        ("step", 1.4, 1.5, [Grade.MARGINAL]),
        ("motors", 1.45, 0.5, []),
        ("place", 1.55, 0.5, [Grade.MARGINAL]),
        ("step", 1.1, 1.9, [Grade.MARGINAL]),
        ("step", 1.1, 3.0, [Grade.MARGINAL]),
        ("step", 0.9, 3.0, []),
        ("curve", 1.1, 0.5, [Grade.MARGINAL]),
        ("step", 6.5, 0.5, [Grade.REJECTED]),
    ],
)
def test_a_step_passes_where_bound_and_step_together_are_good(
    sound, monkeypatch, kind, degrees, bound, found
):
    departure = Departure(kind, degrees, 0.1, 5.0, 60.0, 100.0)
    assert grades(sound, monkeypatch, departure, bound) == found
