"""A fit motor by motor from the recording to the parameters, and COMPASS_PMOT undone."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from unequal import VECTORS, Unequal

from magcomp.analysis.analyse import Options, analyse, check
from magcomp.analysis.by_evidence import is_better
from magcomp.analysis.compare import Judged
from magcomp.autopilots import ardupilot
from magcomp.errors import MissingDataError
from magcomp.model import MOTORS, Grade, HeadingError, ParameterHistory
from magcomp.report.as_json import analysis_object

BY_MOTOR = Options(regressor=MOTORS)
BUILT_IN = {"COMPASS_PMOT_EN": 0.0}
LAW = Unequal(seed=1, seconds=70.0, exponent=1.5, per_motor=BUILT_IN)


@cache
def built_in():
    return analyse(LAW.recording(), BY_MOTOR)


@cache
def plain():
    return analyse(Unequal(seed=1, seconds=70.0).recording(), BY_MOTOR)


def test_where_the_firmware_corrects_motor_by_motor_its_law_is_written():
    (result,) = built_in().compasses
    written = result.parameters
    assert result.as_written.regressor == MOTORS
    assert result.as_written.exponent == pytest.approx(1.5, abs=0.02)
    assert written["COMPASS_PMOT_EXP"] == pytest.approx(1.5, abs=0.02)
    assert written["COMPASS_PMOT_EN"] == 1.0
    assert not any(name.startswith("COMPASS_MOT") for name in written)
    assert result.as_written.left_deg < 0.5
    assert result.verdict.grade is Grade.GOOD


def test_what_is_written_motor_by_motor_leaves_half_a_degree():
    written = built_in().compasses[0].parameters
    time = np.arange(5.0, 65.0, 0.5)
    drive = LAW.duty_at(time) * LAW.volts_at(time)[:, None]
    vectors = np.array(
        [[written[f"COMPASS_PMOT{m}_{axis}"] for axis in "XYZ"] for m in (1, 2, 3, 4)]
    )
    added = drive ** written["COMPASS_PMOT_EXP"] @ vectors
    offset = ardupilot.calibration(written, 1).offset - LAW.exact.offset
    left = added + LAW.added_at(time) + LAW.exact.soft_iron @ offset
    # 200 mGauss of horizontal field: half a degree is 1.9 mGauss.
    assert np.quantile(np.linalg.norm(left[:, :2], axis=1), 0.95) < 1.9


def test_elsewhere_the_best_single_current_is_written_with_what_it_costs():
    (result,) = plain().compasses
    assert result.as_written.regressor == "current"
    assert result.as_written.left_deg > 3.0
    assert result.parameters.get("COMPASS_MOTCT", 2.0) == 2.0
    assert not any(name.startswith("COMPASS_PMOT") for name in result.parameters)
    assert result.verdict.grade is not Grade.GOOD
    assert any("multiplies one current for all motors" in why for why in result.verdict.reasons)
    assert all(row.p95 >= result.as_written.left_deg for row in result.verdict.heading_error)


def test_the_single_current_is_the_mean_of_the_motors():
    written = plain().compasses[0].insisted
    found = -np.array([written[f"COMPASS_MOT_{axis}"] for axis in "XYZ"])
    assert np.linalg.norm(found - VECTORS.mean(axis=0)) < 0.3


def test_a_fit_by_current_says_that_the_motors_differ():
    found = analyse(Unequal(seed=1, seconds=70.0).recording(), Options(regressor="current"))
    assert any("motor by motor leaves" in note for note in found.notes)
    assert any("--regressor motors" in note for note in found.notes)


def test_a_correction_motor_by_motor_in_force_is_undone():
    vectors = {
        f"COMPASS_PMOT{m}_{axis}": -0.1 * value
        for m, vector in enumerate(VECTORS, start=1)
        for axis, value in zip("XYZ", vector.tolist(), strict=True)
    }
    on = {"COMPASS_PMOT_EN": 1.0, "COMPASS_PMOT_EXP": 1.3, **vectors}
    corrected = replace(LAW, per_motor=on)
    recording = corrected.recording()
    found = analyse(recording, Options(regressor="current")).compasses[0]
    bare = analyse(LAW.recording(), Options(regressor="current")).compasses[0]
    apart = found.fit.interference - bare.fit.interference
    assert np.linalg.norm(apart) < 0.1 * np.linalg.norm(bare.fit.interference)
    assert found.insisted["COMPASS_PMOT_EN"] == 0.0
    assert check(recording)[1].grade is not Grade.GOOD


def test_a_correction_motor_by_motor_in_force_needs_the_outputs():
    vectors = {f"COMPASS_PMOT{m}_{axis}": 0.1 for m in (1, 2, 3, 4) for axis in "XYZ"}
    on = {"COMPASS_PMOT_EN": 1.0, "COMPASS_PMOT_EXP": 1.0, **vectors}
    recording = replace(replace(LAW, per_motor=on).recording(), voltage=None)
    with pytest.raises(MissingDataError, match="SERVO_OUTPUT_RAW"):
        analyse(recording)


@pytest.mark.parametrize("lost", ["current", "outputs"])
def test_a_log_without_currents_or_outputs_says_so(lost):
    recording = replace(LAW.recording(), **{lost: None})
    with pytest.raises(MissingDataError, match="must hold"):
        analyse(recording, BY_MOTOR)


def test_json_tells_the_motors_the_forms_and_what_is_written():
    (compass,) = analysis_object(built_in())["compasses"]
    assert [each["motor"] for each in compass["motors"]] == [1, 2, 3, 4]
    assert [form["form"] for form in compass["forms"] if form["best"]] == ["motors"]
    assert compass["as_written"]["regressor"] == "motors"
    assert compass["regressor"] == "motors"
    assert compass["unit"] == "A"


def test_left_to_itself_it_corrects_motor_by_motor_where_the_firmware_can_and_the_data_say_so():
    (result,) = analyse(LAW.recording()).compasses
    assert result.fit.regressor == MOTORS
    assert result.parameters["COMPASS_PMOT_EN"] == 1.0
    assert any("motor by motor is the better choice" in why for why in result.verdict.reasons)


@pytest.mark.parametrize("flown", [replace(LAW, vectors=VECTORS[[0, 0, 0, 0]]), LAW])
def test_otherwise_one_current_stands(flown):
    """Where the motors are alike, or the firmware has no law for each."""
    recording = flown.recording()
    if flown is LAW:
        kept = (c for c in recording.parameters.changes if c.name != "COMPASS_PMOT_EN")
        recording = replace(recording, parameters=ParameterHistory(tuple(kept)))
    (result,) = analyse(recording).compasses
    assert result.fit.regressor == "current"
    assert not any(name.startswith("COMPASS_PMOT") for name in result.insisted if "EN" not in name)


def table(*bounds):
    return tuple(HeadingError(10.0 * row, 9.0, p95, p95) for row, p95 in enumerate(bounds))


@pytest.mark.parametrize(
    ("by_motor", "grade", "better"),
    [
        ((0.5, 0.5, 0.5), Grade.GOOD, True),
        ((2.5, 0.5, 0.5), Grade.GOOD, False),
        ((0.5, 0.5, 9.0), Grade.GOOD, True),
        ((0.5, 0.5, 0.5), Grade.REJECTED, False),
    ],
)
def test_every_row_that_was_flown_and_the_verdict_have_a_say(by_motor, grade, better):
    """One current leaves 1° by its table, and 2° that the motors differ by: 2.2° in all."""
    fit = replace(plain().compasses[0].fit, u_high=15.0)
    verdict = plain().compasses[0].verdict
    now = Judged(None, fit, replace(verdict, grade=Grade.MARGINAL, heading_error=table(1, 1, 1)))
    new = Judged(None, fit, replace(verdict, grade=grade, heading_error=table(*by_motor)))
    assert is_better(new, now, 2.0) is better


def test_a_law_that_follows_worse_than_one_current_is_not_written():
    """Currents far steeper than the law's exponent goes, of motors that hardly differ."""
    hardly = VECTORS.mean(axis=0) + 0.02 * VECTORS
    steep = replace(LAW, vectors=hardly, exponent=6.0)
    (result,) = analyse(steep.recording(), BY_MOTOR).compasses
    assert result.as_written.regressor == "current"
    assert any("one current follows them better" in why for why in result.verdict.reasons)
    assert not any(name.startswith("COMPASS_PMOT") for name in result.insisted if "EN" not in name)
