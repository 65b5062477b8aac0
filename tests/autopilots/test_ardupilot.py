"""ArduPilot's correction: forward, backward, the names it goes by and when it is in force."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magcomp.autopilots import ardupilot
from magcomp.errors import ParameterFileError
from magcomp.model import Correction, ParameterChange, ParameterHistory

vectors = st.tuples(*[st.floats(-1000.0, 1000.0)] * 3).map(np.array)
fields = st.lists(vectors, min_size=1, max_size=4).map(np.array)
diagonals = st.tuples(*[st.floats(0.7, 1.3)] * 3).map(np.array)
off_diagonals = st.tuples(*[st.floats(-0.2, 0.2)] * 3).map(np.array)
scales = st.floats(0.0, 3.0)
compasses = st.sampled_from([1, 2, 3])


@st.composite
def parameters(draw: st.DrawFn, compass: int = 1) -> dict[str, float]:
    """Any calibration an autopilot may hold for one compass."""
    return {
        ardupilot.COMPENSATION_SWITCH: draw(st.sampled_from([0.0, 1.0, 2.0])),
        f"COMPASS_SCALE{ardupilot.suffix(compass)}": draw(scales),
        **ardupilot.vector_parameters("OFS", compass, draw(vectors)),
        **ardupilot.vector_parameters("MOT", compass, draw(vectors)),
        **ardupilot.vector_parameters("DIA", compass, draw(diagonals)),
        **ardupilot.vector_parameters("ODI", compass, draw(off_diagonals)),
    }


@given(parameters(), fields, st.floats(0.0, 200.0))
def test_undoing_a_correction_gives_back_what_the_sensor_said(values, raw, u):
    calibration = ardupilot.calibration(values, 1)
    amperes = np.full(len(raw), u)
    corrected = ardupilot.correct(raw, amperes, calibration)
    assert np.allclose(
        ardupilot.in_force(calibration).correction.undo(corrected, amperes), raw, atol=1e-6
    )


@given(parameters(), fields, st.floats(0.0, 200.0))
def test_correcting_what_was_undone_gives_back_what_was_reported(values, corrected, u):
    calibration = ardupilot.calibration(values, 1)
    amperes = np.full(len(corrected), u)
    raw = ardupilot.in_force(calibration).correction.undo(corrected, amperes)
    assert np.allclose(ardupilot.correct(raw, amperes, calibration), corrected, atol=1e-6)


def test_the_order_is_offset_scale_soft_iron_motor():
    calibration = ardupilot.calibration(
        {
            "COMPASS_MOTCT": 2.0,
            "COMPASS_SCALE": 1.25,
            "COMPASS_OFS_X": 10.0,
            "COMPASS_DIA_X": 1.0,
            "COMPASS_DIA_Y": 2.0,
            "COMPASS_DIA_Z": 1.0,
            "COMPASS_ODI_X": 0.5,
            "COMPASS_MOT_Z": -3.0,
        },
        1,
    )
    corrected = ardupilot.correct([90.0, 40.0, 0.0], 5.0, calibration)
    assert np.allclose(corrected, [1.25 * (100 + 0.5 * 40), 1.25 * (0.5 * 100 + 80), -15.0])


def test_off_diagonals_stand_for_xy_xz_and_yz():
    matrix = ardupilot.soft_iron_matrix([1.0, 2.0, 3.0], [0.1, 0.2, 0.3])
    assert np.array_equal(matrix, [[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 3.0]])


def test_a_diagonal_of_zeros_means_no_soft_iron_correction_at_all():
    assert np.array_equal(ardupilot.soft_iron_matrix([0, 0, 0], [0.1, 0.2, 0.3]), np.eye(3))
    assert not ardupilot.calibration({"COMPASS_ODI_X": 0.1}, 1).has_soft_iron
    assert ardupilot.calibration({"COMPASS_DIA_X": 1.1, "COMPASS_DIA_Y": 1.0}, 1).has_soft_iron


def test_compass_1_has_no_number_in_its_names():
    assert ardupilot.vector_names("MOT", 1) == ("COMPASS_MOT_X", "COMPASS_MOT_Y", "COMPASS_MOT_Z")
    assert ardupilot.vector_names("OFS", 2) == (
        "COMPASS_OFS2_X",
        "COMPASS_OFS2_Y",
        "COMPASS_OFS2_Z",
    )
    assert ardupilot.vector_names("DIA", 3)[2] == "COMPASS_DIA3_Z"


@given(compasses, vectors, diagonals, off_diagonals, vectors, st.floats(0.7, 1.4))
def test_parameters_made_of_a_correction_make_the_autopilot_apply_it(
    compass, offset, diagonal, off_diagonal, motor, scale
):
    wanted = Correction(offset, ardupilot.soft_iron_matrix(diagonal, off_diagonal), motor)
    values = ardupilot.correction_parameters(wanted, compass, scale)
    values |= {"COMPASS_MOTCT": 2.0, f"COMPASS_SCALE{ardupilot.suffix(compass)}": scale}
    raw, u = np.array([[300.0, -100.0, 250.0], [-200.0, 400.0, 10.0]]), np.array([0.0, 30.0])
    applied = ardupilot.correct(raw, u, ardupilot.calibration(values, compass))
    assert np.allclose(applied, wanted.apply(raw, u), atol=0.01)


@given(compasses, vectors)
def test_every_emitted_value_is_exactly_a_float32(compass, vector):
    for value in ardupilot.vector_parameters("MOT", compass, vector).values():
        assert value == float(np.float32(value))


@pytest.mark.parametrize(
    ("scale", "used"),
    [(1.0, 1.0), (1.5, 1.5), (1 / 1.5, 1 / 1.5), (1.51, 1.0), (0.66, 1.0), (0.0, 1.0), (-1.2, 1.0)],
)
def test_a_scale_out_of_limits_is_not_used(scale, used):
    assert ardupilot.calibration({"COMPASS_SCALE": scale}, 1).scale == used


def test_the_stored_motor_vector_is_idle_while_the_switch_is_off():
    stored = dict(zip(ardupilot.vector_names("MOT", 2), (1.0, 2.0, 3.0), strict=True))
    off = ardupilot.calibration(stored | {"COMPASS_MOTCT": 0.0}, 2)
    assert np.array_equal(off.motor, np.zeros(3))
    for switch, kind in ((1.0, "THROTTLE"), (2.0, "CURRENT")):
        on = ardupilot.calibration(stored | {"COMPASS_MOTCT": switch}, 2)
        assert np.array_equal(on.motor, [1.0, 2.0, 3.0])
        assert on.compensation is ardupilot.MotorCompensation[kind]


def test_a_switch_value_no_firmware_knows_is_off():
    assert ardupilot.calibration({"COMPASS_MOTCT": 3.0}, 1).compensation == 0


def history(*changes: tuple[float, str, float]) -> ParameterHistory:
    return ParameterHistory(tuple(ParameterChange(*change) for change in changes))


def test_a_parameter_that_changes_half_way_holds_from_its_report():
    said = history(
        (5.0, "COMPASS_OFS_X", 10.0), (60.0, "COMPASS_OFS_X", 40.0), (5.0, "COMPASS_MOTCT", 0.0)
    )
    at = {t: ardupilot.calibration_at(said, 1, t).offset[0] for t in (0.0, 5.0, 59.9, 60.0, 1e6)}
    assert at == {0.0: 10.0, 5.0: 10.0, 59.9: 10.0, 60.0: 40.0, 1e6: 40.0}


def test_only_changes_that_act_on_a_compass_count_as_changes():
    said = history(
        (5.0, "COMPASS_OFS_X", 10.0),
        (30.0, "COMPASS_OFS_X", 10.0),
        (60.0, "COMPASS_OFS2_X", 1.0),
        (70.0, "COMPASS_OFS2_X", 2.0),
        (80.0, "SIM_MAG1_OFS_X", 2.0),
        (90.0, "SIM_MAG1_OFS_X", 3.0),
        (95.0, "ATC_RAT_YAW_P", 3.0),
        (96.0, "ATC_RAT_YAW_P", 4.0),
    )
    assert ardupilot.calibration_changes(said) == (70.0,)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    ("name", "compass"), [("COMPASS_MOT_X", 1), ("COMPASS_DIA2_Y", 2), ("COMPASS_SCALE3", 3)]
)
def test_a_compass_parameter_that_is_no_number_is_refused_by_name_and_time(name, compass, value):
    said = history((12.0, name, value))
    with pytest.raises(ParameterFileError, match=f"{name} must be a finite number") as caught:
        ardupilot.calibration_at(said, compass, 20.0)
    assert "20.0 s" in str(caught.value)


def test_a_parameter_of_something_else_may_be_anything():
    said = history((12.0, "SIM_MAG_RND", math.nan), (13.0, "COMPASS_OFS_X", 4.0))
    assert ardupilot.calibration_at(said, 1, 20.0).offset[0] == 4.0


@given(parameters(), parameters())
def test_calibrations_are_the_same_only_where_they_correct_alike(one, other):
    first, second = (ardupilot.calibration(values, 1) for values in (one, other))
    raw, u = np.array([[300.0, -100.0, 250.0], [-210.0, 45.0, 10.0]]), np.array([3.0, 30.0])
    assert first.same_as(first)
    if first.same_as(second):
        alike = ardupilot.correct(raw, u, first), ardupilot.correct(raw, u, second)
        assert np.array_equal(*alike)
