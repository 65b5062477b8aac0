"""What every firmware must answer, and what ArduPilot answers."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magcomp import autopilots
from magcomp.autopilots import Autopilot, Kind, Leeway
from magcomp.autopilots.ardupilot import ArduPilot, vector_parameters
from magcomp.autopilots.ardupilot_names import ACTING, acting_on
from magcomp.errors import MissingDataError, ParameterFileError
from magcomp.model import (
    CURRENT,
    DRIVE,
    THROTTLE,
    Compass,
    Correction,
    ParameterChange,
    ParameterHistory,
    Vehicle,
    symmetric,
)

ARDUPILOT: Autopilot = autopilots.named("ardupilot")
PX4: Autopilot = autopilots.named("px4")

vectors = st.tuples(*[st.floats(-1000.0, 1000.0)] * 3).map(np.array)
fields = st.lists(vectors, min_size=1, max_size=4).map(np.array)
# Diagonally dominant, so positive definite.
soft_irons = st.tuples(*[st.floats(0.8, 1.2)] * 3, *[st.floats(-0.2, 0.2)] * 3).map(
    lambda six: symmetric(np.array(six))
)
corrections = st.builds(Correction, offset=vectors, soft_iron=soft_irons, motor=vectors)
numbers = st.sampled_from([1, 2, 3])
quantities = st.sampled_from([CURRENT, THROTTLE])


def history(
    values: dict[str, float], *, whole: bool = False, time: float = 5.0
) -> ParameterHistory:
    changes = tuple(ParameterChange(time, name, value) for name, value in values.items())
    return ParameterHistory(changes, whole)


def held(**changed: float) -> dict[str, float]:
    """Every parameter of a calibrated vehicle with three compasses."""
    values = dict.fromkeys(ACTING, 0.0)
    for number in (1, 2, 3):
        values |= vector_parameters("OFS", number, (30.0, -20.0, 10.0))
        values |= vector_parameters("DIA", number, (1.0, 1.0, 1.0))
        values[f"COMPASS_SCALE{'' if number == 1 else number}"] = 1.0
    return {**values, **changed}


# --- one correction, both ways ---------------------------------------------------------------


@given(corrections, fields, st.floats(0.0, 100.0))
def test_undoing_a_correction_is_the_inverse_of_applying_it(correction, raw, u):
    quantity = np.full(len(raw), u)
    back = correction.undo(correction.apply(raw, quantity), quantity)
    assert np.allclose(back, raw, atol=1e-6)


@given(corrections, numbers, quantities, fields, st.floats(0.0, 50.0))
def test_what_is_written_for_a_correction_is_what_comes_into_force(
    correction, compass, regressor, raw, u
):
    values = held()
    values |= ARDUPILOT.switch_parameters(regressor, [compass], values)
    values |= ARDUPILOT.correction_parameters(
        correction,
        compass,
        values,
        regressor=regressor,
        soft_iron_fitted=True,
        leeway=Leeway(correction, np.eye(12)),
    )
    in_force = ARDUPILOT.in_force(values, compass)
    assert in_force.regressor == regressor
    quantity = np.full(len(raw), u)
    wanted = correction.apply(raw, quantity)
    # float32 keeps seven digits, and 50 times 1000 mGauss are the most here.
    assert np.allclose(in_force.correction.apply(raw, quantity), wanted, atol=0.05)
    assert np.allclose(in_force.correction.undo(wanted, quantity), raw, atol=0.1)


# --- names -------------------------------------------------------------------------------------


@pytest.mark.parametrize("autopilot", autopilots.ALL, ids=lambda a: a.key)
def test_every_name_that_is_read_can_be_taken_apart(autopilot):
    for name in (*autopilot.relevant_names(), autopilot.switch, *autopilot.device_id_names):
        found = autopilot.parse(name)
        assert found is not None, name
        # PX4 puts the axis before the kind: CAL_MAG0_XCOMP is the X of CAL_MAG0_COMP.
        assert set(found.vector.split("_")[:-1]) <= set(name.split("_"))
        assert found.axis in name
        assert name.startswith(autopilot.compass_prefix)
        assert autopilots.parse(name) == found


@pytest.mark.parametrize("autopilot", autopilots.ALL, ids=lambda a: a.key)
def test_what_an_autopilot_is_stands_once(autopilot):
    vehicle = Vehicle(autopilot.key, "copter", 1, 1)
    assert autopilots.of(vehicle) is autopilot
    assert autopilots.title(autopilot.key) == autopilot.title
    assert autopilot.parse(autopilot.switch).kind is Kind.SWITCH
    assert set(autopilot.choices(autopilot.switch)) > {0}
    assert all(autopilot.parse(n).kind is Kind.DEVICE for n in autopilot.device_id_names)
    assert pickle.loads(pickle.dumps(autopilot)).key == autopilot.key  # noqa: S301


@pytest.mark.parametrize(
    ("name", "kind", "compass", "vector", "axis"),
    [
        ("COMPASS_MOT_X", Kind.MOTOR, 1, "COMPASS_MOT", "X"),
        ("COMPASS_DIA3_Z", Kind.DIAGONAL, 3, "COMPASS_DIA3", "Z"),
        ("COMPASS_SCALE2", Kind.SCALE, 2, "COMPASS_SCALE2", ""),
        ("COMPASS_PMOT3_Y", Kind.PER_MOTOR, 1, "COMPASS_PMOT3", "Y"),
        ("COMPASS_EXTERNAL", Kind.SETTING, 1, "COMPASS_EXTERNAL", ""),
        ("CAL_MAG2_YODIAG", Kind.OFF_DIAGONAL, 3, "CAL_MAG2_ODIAG", "Y"),
        ("CAL_MAG0_XCOMP", Kind.MOTOR, 1, "CAL_MAG0_COMP", "X"),
    ],
)
def test_a_name_says_what_it_is(name, kind, compass, vector, axis):
    assert autopilots.parse(name) == autopilots.ParameterName(kind, compass, vector, axis)


@pytest.mark.parametrize("name", ["COMPASS_MOT4_X", "COMPASS_OFS_W", "WPNAV_SPEED", "CAL_MAG4_ID"])
def test_a_name_of_something_else_says_nothing(name):
    assert autopilots.parse(name) is None


def test_an_autopilot_nobody_knows_is_refused_with_those_that_are():
    with pytest.raises(MissingDataError, match="must be one of ardupilot, px4; instead received"):
        autopilots.named("inav")
    assert autopilots.title("inav") == "inav"


# --- compasses -----------------------------------------------------------------------------------


def test_a_compass_has_a_slot_an_id_and_what_its_settings_say():
    found = ARDUPILOT.compasses(
        {
            "COMPASS_DEV_ID": 0.0,
            "COMPASS_DEV_ID2": 11.0,
            "COMPASS_DEV_ID3": 22.0,
            "COMPASS_EXTERN2": 1.0,
            "COMPASS_ORIENT2": 6.0,
            "COMPASS_USE3": 0.0,
            "COMPASS_EXTERN3": 0.0,
        }
    )
    assert found == (Compass(2, 11, True, 6, None), Compass(3, 22, False, None, False))
    assert Vehicle("ardupilot", "copter", 1, 1, "", found).device_ids == (11, 22)


@given(st.dictionaries(st.sampled_from(ARDUPILOT.relevant_names()), st.floats()))
def test_no_values_make_compasses_that_cannot_be(values):
    found = ARDUPILOT.compasses(values)
    assert [c.slot for c in found] == sorted({c.slot for c in found})
    assert all(compass.device_id for compass in found)


# --- what is in force ----------------------------------------------------------------------------


def without(*names: str, whole: bool = False) -> ParameterHistory:
    return history({n: v for n, v in held().items() if n not in names}, whole=whole)


def unseen(parameters: ParameterHistory, compass: int) -> tuple[str, ...]:
    return ARDUPILOT.in_force_at(parameters, compass, 10.0).unseen


def test_a_log_that_holds_all_parameters_has_seen_them_all():
    assert all(unseen(without(), compass) == () for compass in (1, 2, 3))


def test_a_log_without_parameters_has_seen_none_of_them():
    assert set(unseen(history({}), 2)) == {*acting_on(2), "COMPASS_MOTCT"}


@pytest.mark.parametrize("name", [n for n in acting_on(2) if not n.startswith("COMPASS_SCALE")])
def test_a_parameter_that_is_missing_among_its_kind_is_unseen(name):
    assert unseen(without(name), 2) == (name,)
    assert unseen(without(name, whole=True), 2) == (name,)
    assert unseen(without(name), 1) == ()


@pytest.mark.parametrize("kinds", [("DIA", "ODI", "SCALE"), ("SCALE",)])
@pytest.mark.parametrize("whole", [False, True])
def test_what_a_firmware_does_not_have_at_all_is_not_unseen(kinds, whole):
    lacking = [n for n in held() if any(n.startswith(f"COMPASS_{kind}") for kind in kinds)]
    assert unseen(without(*lacking, whole=whole), 1) == ()


@pytest.mark.parametrize("kind", ["MOT", "OFS", "DIA", "ODI"])
def test_a_kind_that_the_firmware_must_have_is_unseen_even_in_a_whole_list(kind):
    lacking = [n for n in held() if n.startswith((f"COMPASS_{kind}_", f"COMPASS_{kind}2_"))]
    lacking += [n for n in held() if n.startswith(f"COMPASS_{kind}3_")]
    assert set(unseen(without(*lacking, whole=True), 2)) == {
        n for n in acting_on(2) if f"_{kind}" in n
    }


def test_a_log_of_a_few_parameters_does_not_show_a_firmware_without_the_others():
    few = history(dict(vector_parameters("OFS", 1, (30.0, -20.0, 10.0))))
    assert "COMPASS_DIA_X" in unseen(few, 1)
    assert "COMPASS_MOTCT" in unseen(few, 1)
    assert "COMPASS_OFS_X" not in unseen(few, 1)


# --- values that are none ------------------------------------------------------------------------


@given(numbers, st.sampled_from([math.nan, math.inf]), st.sampled_from(["MOT", "OFS", "DIA"]))
def test_a_value_that_is_none_leaves_out_its_own_compass_alone(compass, value, kind):
    number = "" if compass == 1 else str(compass)
    bad = f"COMPASS_{kind}{number}_Y"
    parameters = history(held(**{bad: value}))
    assert set(ARDUPILOT.left_out(parameters)) == {compass}
    for other in {1, 2, 3} - {compass}:
        assert ARDUPILOT.in_force_at(parameters, other, -math.inf).unseen == ()
    with pytest.raises(ParameterFileError) as refused:
        ARDUPILOT.in_force_at(parameters, compass, -math.inf)
    for said in (str(refused.value), str(ARDUPILOT.left_out(parameters)[compass])):
        assert bad in said
        assert f"set it to {1 if kind == 'DIA' else 0} on the vehicle and record again" in said
        assert "-inf" not in said


def test_a_soft_iron_that_is_told_in_part_is_whole_with_the_firmwares_defaults():
    values = {"COMPASS_DIA_X": 1.0, "COMPASS_DIA_Z": 1.25}
    found = ARDUPILOT.in_force(values, 1).correction.soft_iron
    np.testing.assert_array_equal(found, np.diag([1.0, 1.0, 1.25]))


@pytest.mark.parametrize("value", [0.0, 1e-9, 1e30])
def test_a_compass_whose_soft_iron_cannot_be_undone_is_left_out_and_no_other(value):
    changes = (
        ParameterChange(0.0, "COMPASS_DIA2_X", 1.0),
        ParameterChange(5.0, "COMPASS_DIA2_Y", value),
        ParameterChange(9.0, "COMPASS_DIA2_Y", 1.0),
    )
    found = ARDUPILOT.left_out(ParameterHistory(changes))
    assert set(found) == {2}
    assert "COMPASS_DIA2 and COMPASS_ODI2 must be a soft iron" in str(found[2])
    assert f"COMPASS_DIA2_Y {value:g}" in str(found[2])


def test_a_compass_corrected_motor_by_motor_is_undone_by_its_own_law():
    vectors = {f"COMPASS_PMOT{m}_{axis}": float(m) for m in (1, 2, 3, 4) for axis in "XYZ"}
    on = {"COMPASS_PMOT_EN": 1.0, "COMPASS_PMOT_EXP": 1.5, **vectors}
    parameters = history(held(**on))
    assert ARDUPILOT.left_out(parameters) == {}
    found = ARDUPILOT.in_force_at(parameters, 1, 0.0)
    assert found.regressor == DRIVE
    assert found.correction.motor.tolist() == [[1.0, 2.0, 3.0, 4.0]] * 3
    drive = np.full((1, 4), 4.0)
    assert found.correction.added(found.multiplied(drive)).tolist() == [[80.0, 80.0, 80.0]]
    assert ARDUPILOT.in_force_at(parameters, 2, 0.0).regressor != DRIVE


def test_a_law_motor_by_motor_needs_its_parameters_and_is_of_compass_1():
    part = ARDUPILOT.in_force_at(history(held(COMPASS_PMOT_EN=1.0, COMPASS_PMOT_EXP=1.0)), 1, 0.0)
    assert "COMPASS_PMOT4_Z" in part.unseen
    assert ARDUPILOT.motor_law(1, held(COMPASS_PMOT_EN=0.0)).numbers == (1, 2, 3, 4)
    assert ARDUPILOT.motor_law(2, held(COMPASS_PMOT_EN=0.0)) is None
    assert ARDUPILOT.motor_law(1, {}) is None
    assert PX4.motor_law(1, {}) is None


def test_a_correction_by_one_quantity_switches_the_one_motor_by_motor_off():
    on = held(COMPASS_PMOT_EN=1.0)
    assert ARDUPILOT.switch_parameters("current", [1], on)["COMPASS_PMOT_EN"] == 0.0
    assert "COMPASS_PMOT_EN" not in ARDUPILOT.switch_parameters("current", [2], on)


def test_motors_are_counted_by_their_functions_whatever_outputs_they_are_on():
    functions = {"SERVO1_FUNCTION": 34.0, "SERVO2_FUNCTION": 0.0, "SERVO3_FUNCTION": 33.0}
    found = ARDUPILOT.motor_outputs(history({**functions, "SERVO9_FUNCTION": 82.0}), 16)
    assert found.channels == (2, 0, 8)
    assert found.numbers == (1, 2, 9)


# --- settings --------------------------------------------------------------------------------


def test_a_vehicle_set_up_well_is_warned_of_nothing():
    assert ARDUPILOT.warnings(held(COMPASS_USE=1.0, COMPASS_LEARN=0.0)) == ()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"COMPASS_PMOT_EN": 1.0}, "COMPASS_PMOT_EN is on"),
        ({"COMPASS_LEARN": 3.0}, "COMPASS_LEARN is 3: the offsets may move in flight"),
        ({"COMPASS_USE2": 0.0}, "compass 2 is not used for the heading (COMPASS_USE2 is 0)"),
        ({"COMPASS_SCALE3": 1.7}, "COMPASS_SCALE3 1.7 is out of limits"),
        (
            {"COMPASS_ORIENT2": 6.0, "COMPASS_EXTERN2": 0.0},
            "COMPASS_ORIENT2 is 6 but compass 2 is internal (COMPASS_EXTERN2 is 0)",
        ),
        (
            vector_parameters("OFS", 1, (-1900.0, 0.0, 0.0)),
            "COMPASS_OFS_X -1900 is beyond COMPASS_OFFS_MAX 1800",
        ),
    ],
)
def test_each_setting_in_the_way_is_named_once(values, said):
    warnings = ARDUPILOT.warnings(held(**values))
    assert len(warnings) == 1
    assert said in warnings[0]


@given(vectors, st.floats(10.0, 2000.0))
def test_the_limit_of_the_offsets_is_one_of_their_length(offset, limit):
    values = held(COMPASS_OFFS_MAX=limit, **vector_parameters("OFS", 1, offset))
    stored = np.array([values[f"COMPASS_OFS_{axis}"] for axis in "XYZ"])
    told = [w for w in ARDUPILOT.warnings(values) if "refuse to arm" in w and "OFS2" not in w]
    told = [warning for warning in told if "OFS3" not in warning]
    assert bool(told) == (float(np.linalg.norm(stored)) > limit)


def test_an_offset_too_long_though_no_part_of_it_is_is_told_with_its_length():
    values = held(**vector_parameters("OFS", 2, (1200.0, 1200.0, 1200.0)))
    (warning,) = ARDUPILOT.warnings(values)
    assert "the length of COMPASS_OFS2, 2078 mGauss, is beyond COMPASS_OFFS_MAX 1800" in warning


# --- the switch ----------------------------------------------------------------------------------


def test_the_switch_wakes_no_vector_that_was_not_fitted():
    values = held(COMPASS_MOT3_X=7.0)
    made = ARDUPILOT.switch_parameters(CURRENT, [1], values)
    assert made == {"COMPASS_MOTCT": 2.0, **vector_parameters("MOT", 3, (0, 0, 0))}
    assert ArduPilot().neutral_parameters(2, CURRENT, values) == vector_parameters(
        "MOT", 2, (0, 0, 0)
    )


def test_a_vector_in_force_for_the_same_quantity_stays():
    values = held(COMPASS_MOTCT=1.0, COMPASS_MOT3_X=7.0)
    assert ARDUPILOT.switch_parameters(THROTTLE, [1], values) == {"COMPASS_MOTCT": 1.0}
    assert ARDUPILOT.neutral_parameters(3, THROTTLE, values) == {}
    assert ARDUPILOT.neutral_parameters(3, CURRENT, values)["COMPASS_MOT3_X"] == 0.0
