"""PX4's correction, forward and backward, what is in force of its parameters, and what is written.

Held against the firmware's own formula and dead zones as px4_truth writes them down.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import px4_truth
import pytest
from effort import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from leeways import leeway_around

from magcomp import autopilots
from magcomp.autopilots import Leeway
from magcomp.autopilots.px4 import Px4
from magcomp.autopilots.px4_correction import (
    Calibration,
    Compensation,
    body_correction,
    correct,
    sensor_calibration,
    stored,
)
from magcomp.autopilots.px4_names import vector_names
from magcomp.autopilots.px4_rotation import sensor_to_body
from magcomp.autopilots.px4_taking_over import unsettled
from magcomp.autopilots.rotations import ROTATIONS
from magcomp.errors import MissingDataError, ParameterFileError
from magcomp.model import (
    CURRENT,
    THROTTLE,
    Compass,
    Correction,
    ParameterChange,
    ParameterHistory,
    ReadReport,
    Recording,
    Series,
    Vehicle,
    pack,
    symmetric,
)
from magcomp.simulate import scenario
from magcomp.simulate.px4.compasses import Compasses
from magcomp.simulate.px4.parameters import Parameters, initial_values
from magcomp.simulate.px4.sensors import DEVICE_IDS

PX4 = Px4()

gauss = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)
comps = st.tuples(*[st.floats(-5.0, 5.0)] * 3).map(np.array)
scales = st.tuples(*[st.floats(0.8, 1.2)] * 3).map(np.array)
off_diagonals = st.tuples(*[st.floats(-0.2, 0.2)] * 3).map(np.array)
switches = st.sampled_from([c for c in Compensation if c is not Compensation.OFF])
calibrations = st.builds(Calibration, gauss, scales, off_diagonals, comps, switches)
rotations = st.sampled_from(sorted(ROTATIONS))
fields = st.lists(gauss, min_size=1, max_size=4).map(np.array)
numbers = st.sampled_from([1, 2, 3, 4])
quantities = st.sampled_from([CURRENT, THROTTLE])
soft_irons = st.tuples(scales, off_diagonals).map(lambda two: symmetric(np.concatenate(two)))
corrections = st.builds(
    Correction,
    offset=gauss.map(lambda v: 400.0 * v),
    soft_iron=soft_irons,
    motor=comps,
)


def held(number: int = 1, **changed: tuple[float, float, float] | float) -> dict[str, float]:
    """What a vehicle holds of one calibrated compass."""
    values = {
        "CAL_MAG_COMP_TYP": 0.0,
        f"CAL_MAG{number - 1}_ID": 100.0 + number,
        f"CAL_MAG{number - 1}_ROT": -1.0,
        f"CAL_MAG{number - 1}_PRIO": 50.0,
    }
    usual = {
        "OFF": (0.05, -0.08, 0.12),
        "SCALE": (1.03, 0.97, 1.05),
        "ODIAG": (0.02, -0.015, 0.012),
        "COMP": (0.0, 0.0, 0.0),
    }
    for kind, vector in usual.items():
        values |= dict(zip(vector_names(kind, number), changed.pop(kind, vector), strict=True))
    return {**values, **changed}


def history(*steps: tuple[float, dict[str, float]], whole: bool = True) -> ParameterHistory:
    changes = (ParameterChange(t, name, v) for t, values in steps for name, v in values.items())
    return ParameterHistory(tuple(changes), whole)


# --- the correction, both ways -------------------------------------------------------------------


@given(calibrations, rotations, fields, st.floats(0.0, 1.0))
def test_what_the_firmware_corrects_is_what_a_sensor_said_by_its_order(
    calibration, rotation, body, share
):
    turn = sensor_to_body({"CAL_MAG0_ROT": float(rotation)}, 1)
    shape = px4_truth.matrix(calibration.scale, calibration.off_diagonal)
    sensor = px4_truth.Sensor(1, calibration.offset, shape, calibration.motor, turn)
    power, u = share, np.full(len(body), share)
    if calibration.compensation is not Compensation.THRUST:
        power, u = 0.1 * share, 100.0 * u
    said = sensor.reading(body, power)
    theirs = correct(said, np.full(len(body), power), calibration)
    assert np.allclose(theirs @ turn.T, body, atol=1e-9)
    ours, turned = body_correction(calibration, turn), 1000.0 * said @ turn.T
    assert np.allclose(ours.apply(turned, u), 1000.0 * body, atol=1e-6)
    assert np.allclose(ours.undo(1000.0 * body, u), turned, atol=1e-6)


@given(calibrations, rotations)
def test_a_calibration_comes_back_from_magcomps_own_form(calibration, rotation):
    turn = sensor_to_body({"CAL_MAG0_ROT": float(rotation)}, 1)
    back = sensor_calibration(body_correction(calibration, turn), turn, calibration.compensation)
    for name in ("offset", "scale", "off_diagonal", "motor"):
        assert np.allclose(getattr(back, name), getattr(calibration, name), atol=1e-9)


@pytest.mark.parametrize("number", sorted(ROTATIONS))
def test_every_rotation_is_one(number: int) -> None:
    turn = sensor_to_body({"CAL_MAG0_ROT": float(number)}, 1)
    assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)


def test_rotations_turn_as_the_firmware_was_seen_to() -> None:
    turned = sensor_to_body({"CAL_MAG2_ROT": 10.0}, 3)
    assert np.allclose(turned, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-12)
    by_angles = {"CAL_MAG2_ROT": 100.0, "CAL_MAG2_ROLL": 180.0, "CAL_MAG2_YAW": 90.0}
    assert np.allclose(sensor_to_body(by_angles, 3), turned, atol=1e-12)


def test_a_board_turns_its_own_compasses_and_its_level_turns_all() -> None:
    board = {"SENS_BOARD_ROT": 2.0, "CAL_MAG0_ROT": -1.0, "CAL_MAG1_ROT": 0.0}
    assert np.allclose(sensor_to_body(board, 1) @ [1, 0, 0], [0, 1, 0], atol=1e-12)
    assert np.allclose(sensor_to_body(board, 2), np.eye(3))
    level = {**board, "SENS_BOARD_Z_OFF": 90.0}
    assert np.allclose(sensor_to_body(level, 1) @ [1, 0, 0], [-1, 0, 0], atol=1e-12)
    assert np.allclose(sensor_to_body(level, 2) @ [1, 0, 0], [0, 1, 0], atol=1e-12)


# --- what is written is what comes into force ----------------------------------------------------


def in_the_firmware(
    before: dict[str, float], written: dict[str, float], number: int, *, restarted: bool
) -> Calibration:
    start = px4_truth.AT_START
    running = px4_truth.through_dead_zones(start, before, number - 1)
    now = px4_truth.through_dead_zones(
        start if restarted else running, {**before, **written}, number - 1
    )
    switch = Compensation(int({**before, **written}["CAL_MAG_COMP_TYP"]))
    return Calibration(now["OFF"], now["SCALE"], now["ODIAG"], now["COMP"], switch)


def written_for(
    correction: Correction,
    number: int,
    values: dict[str, float],
    *,
    regressor: str = CURRENT,
    soft_iron_fitted: bool = False,
) -> dict[str, float]:
    return PX4.correction_parameters(
        correction,
        number,
        values,
        regressor=regressor,
        soft_iron_fitted=soft_iron_fitted,
        leeway=leeway_around(correction),
    )


@given(corrections, numbers, quantities, rotations, st.booleans(), st.sampled_from([0, 1]))
@settings(max_examples=examples(20))
def test_what_is_written_is_what_the_firmware_applies(
    correction, number, regressor, rotation, restarted, battery
):
    before = held(number, **{f"CAL_MAG{number - 1}_ROT": float(rotation)})
    written = PX4.switch_parameters(regressor, [number], before, battery=battery)
    written |= written_for(correction, number, before, regressor=regressor, soft_iron_fitted=True)
    firmware = in_the_firmware(before, written, number, restarted=restarted)
    applied = body_correction(firmware, sensor_to_body(before, number))
    # What the firmware would not notice is moved by less than its dead zones.
    assert np.allclose(applied.soft_iron, correction.soft_iron, atol=0.011)
    assert np.abs(applied.offset - correction.offset).max() < 15.0
    # The motor vector makes up for that, and for nothing where all of it is noticed.
    missed = (
        np.abs(applied.offset - correction.offset).max()
        + 600.0 * np.abs(applied.soft_iron - correction.soft_iron).max()
    )
    assert np.allclose(applied.vector, correction.vector, atol=2e-5 + 0.2 * missed)


def costs(missed: np.ndarray, leeway: Leeway) -> np.ndarray:
    """Mean square of the heading that misses of the offset turn, the motor vector at its best."""
    values, axes = np.linalg.eigh(leeway.turning)
    root = axes * np.sqrt(np.maximum(values, 0.0))
    free, turned = root[:3].T, missed @ root[3:6]
    best = np.linalg.lstsq(free, -turned.T, rcond=None)[0]
    return np.sum((free @ best + turned.T) ** 2, axis=0)


FAR, NEAR = (0.05, -0.08, 0.12), (0.004, 0.003, 0.003)
"""Offsets in force: the dead zone around the second meets that around a start's nothing."""


@pytest.mark.parametrize("restarted", [False, True])
@pytest.mark.parametrize(
    ("present", "wanted"),
    [
        (FAR, (0.05, -0.08, 0.1247)),
        (FAR, (0.05, -0.0785, 0.1245)),
        (FAR, (0.0548, -0.079, 0.1205)),
        (FAR, (0.052, -0.081, 0.121)),
        (NEAR, (0.0045, -0.001, 0.0045)),
        (NEAR, (-0.001, 0.0045, 0.0005)),
        (NEAR, (0.004, 0.003, 0.0077)),
        ((0.0023, -0.005, -0.0069), (0.0023, -0.0014, -0.0046)),
        ((-0.0022, -0.0047, -0.0053), (-0.0006, -0.0021, -0.0053)),
    ],
)
def test_an_offset_that_would_not_be_noticed_is_missed_as_cheaply_as_can_be(
    present, wanted, restarted
):
    """No offset in force whether restarted or not turns the heading less, COMP at its best."""
    before = held(1, CAL_MAG0_ROT=10.0, OFF=present)
    turn = sensor_to_body(before, 1)
    soft_iron = PX4.in_force(before, 1).correction.soft_iron
    fitted = Correction(-1000.0 * turn @ np.array(wanted), soft_iron, np.ones(3))
    leeway = leeway_around(fitted)
    written = written_for(fitted, 1, before) | {"CAL_MAG_COMP_TYP": 2.0}
    firmware = in_the_firmware(before, written, 1, restarted=restarted)
    off = pack(body_correction(firmware, turn)) - pack(fitted)
    paid = float(off @ leeway.turning @ off)

    away = np.random.default_rng(1).standard_normal((20_000, 3))
    away *= 0.0052 / np.linalg.norm(away, axis=1, keepdims=True)
    tried = np.concatenate([[present], np.array(present) + away, away])
    is_noticed = np.linalg.norm(tried - present, axis=1) > 0.005
    is_noticed &= np.linalg.norm(tried, axis=1) > 0.005
    is_noticed[0] = True
    missed = -1000.0 * (tried[is_noticed] - wanted) @ turn.T
    assert paid <= costs(missed, leeway).min() * 1.01 + 1e-9


def test_a_fit_is_not_aimed_at_where_it_would_not_be_noticed():
    """The offset in force stays, and COMP is the likeliest one beside it."""
    before = held(1)
    right = PX4.in_force(before, 1).correction
    fitted = Correction(right.offset + np.array([1.0, 2.0, 0.5]), right.soft_iron, np.ones(3))
    likely = Correction(right.offset, right.soft_iron, np.array([1.1, 1.2, 1.0]))
    written = PX4.correction_parameters(
        fitted,
        1,
        before,
        regressor=CURRENT,
        soft_iron_fitted=False,
        leeway=leeway_around(likely),
    )
    firmware = in_the_firmware(before, written | {"CAL_MAG_COMP_TYP": 2.0}, 1, restarted=False)
    applied = body_correction(firmware, np.eye(3))
    assert np.allclose(applied.offset, right.offset, atol=1e-4)
    assert np.allclose(applied.vector, likely.vector, atol=1e-4)


def test_a_compass_whose_calibration_is_right_keeps_it_to_the_last_bit():
    before = held(1)
    exact = PX4.in_force(before, 1).correction
    turned = np.array([1.0, -0.5, 2.0])
    fitted = Correction(exact.offset + 0.4 * turned, exact.soft_iron, np.array([2.0, -1, 3]))
    written = written_for(fitted, 1, before)
    assert [written[name] for name in vector_names("OFF", 1)] == pytest.approx([0.05, -0.08, 0.12])
    assert not set(written) & {*vector_names("SCALE", 1), *vector_names("ODIAG", 1)}


def test_an_offset_that_swallowed_the_hover_is_put_back_with_the_motor_vector():
    swallowed = held(1, OFF=(0.09, -0.1, 0.16))
    right = PX4.in_force(held(1), 1).correction
    fitted = Correction(right.offset, right.soft_iron, np.array([2.0, -1.0, 3.0]))
    written = written_for(fitted, 1, swallowed)
    assert [written[name] for name in vector_names("OFF", 1)] == pytest.approx([0.05, -0.08, 0.12])


def test_the_unit_is_that_of_the_switch():
    before = held(1, SCALE=(1.0, 1.0, 1.0), ODIAG=(0.0, 0.0, 0.0))
    present = PX4.in_force(before, 1).correction
    moved = Correction(present.offset, present.soft_iron, np.array([50.0, 20.0, -10.0]))
    by = {
        kind: [written_for(moved, 1, before, regressor=kind)[n] for n in vector_names("COMP", 1)]
        for kind in (CURRENT, THROTTLE)
    }
    assert by[CURRENT] == pytest.approx([50.0, 20.0, -10.0])  # mGauss per A, gauss per kA
    assert by[THROTTLE] == pytest.approx([0.05, 0.02, -0.01])


# --- the switch ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("regressor", "battery", "value"), [(THROTTLE, 0, 1), (CURRENT, 0, 2), (CURRENT, 1, 3)]
)
def test_the_switch_names_the_quantity_and_its_battery(regressor, battery, value):
    made = PX4.switch_parameters(regressor, [1], held(1), battery=battery)
    assert made == {"CAL_MAG_COMP_TYP": value}


def test_the_switch_wakes_no_vector_that_was_not_fitted():
    values = {**held(1), **held(2, COMP=(7.0, 0.0, 0.0))}
    made = PX4.switch_parameters(CURRENT, [1], values)
    assert [made[name] for name in vector_names("COMP", 2)] == [0.0, 0.0, 0.0]
    assert not set(made) & set(vector_names("COMP", 1))


def test_a_vector_in_force_for_the_same_quantity_stays():
    values = {**held(1), **held(2, COMP=(7.0, 0.0, 0.0)), "CAL_MAG_COMP_TYP": 2.0}
    assert PX4.switch_parameters(CURRENT, [1], values) == {"CAL_MAG_COMP_TYP": 2.0}
    assert PX4.neutral_parameters(2, THROTTLE, values)["CAL_MAG1_XCOMP"] == 0.0


# --- what of the parameters is in force ----------------------------------------------------------

FLIGHT = Series(np.array([0.0, 10.0, 50.0]), np.array([0.0, 1.0, 0.0]))
"""Disarmed, armed from 10 s, disarmed from 50 s."""


def in_force(parameters: ParameterHistory, time: float) -> Correction:
    return PX4.in_force_over(parameters, 1, [time], armed=FLIGHT)[0].correction


@pytest.mark.parametrize(
    ("changed", "is_in_force"),
    [
        ({"OFF": (0.003, 0.002, 0.001)}, False),
        ({"OFF": (0.004, 0.003, 0.002)}, True),
        ({"SCALE": (1.005, 1.005, 0.995)}, False),
        ({"SCALE": (1.02, 1.0, 1.0)}, True),
        ({"ODIAG": (0.005, 0.005, -0.005)}, False),
        ({"ODIAG": (0.009, 0.009, 0.0)}, True),
    ],
)
def test_what_differs_too_little_from_the_start_is_never_in_force(changed, is_in_force):
    plain = {"OFF": (0.0,) * 3, "SCALE": (1.0,) * 3, "ODIAG": (0.0,) * 3}
    found = PX4.in_force(held(1, **{**plain, **changed}), 1).correction
    same = np.array_equal(found.offset, np.zeros(3)) and np.array_equal(found.soft_iron, np.eye(3))
    assert same is not is_in_force


def test_the_zone_was_wider_to_1_13():
    values = held(1, OFF=(0.0, 0.0, 0.008))
    assert PX4.in_force(values, 1).correction.offset[2] == pytest.approx(-8.0)
    old = {**values, "CAL_MAG_ROT_AUTO": 1.0}
    assert PX4.in_force(old, 1).correction.offset[2] == 0.0


def test_a_small_step_is_not_taken_over_but_two_are():
    parameters = history(
        (0.0, held(1)), (3.0, {"CAL_MAG0_XOFF": 0.053}), (6.0, {"CAL_MAG0_XOFF": 0.057})
    )
    assert [in_force(parameters, t).offset[0] for t in (1.0, 4.0, 7.0)] == pytest.approx(
        [-50.0, -50.0, -57.0]
    )
    assert PX4.changes(parameters, armed=FLIGHT) == (6.0,)


def test_a_value_set_in_flight_acts_after_the_next_change_while_disarmed():
    parameters = history(
        (0.0, {**held(1, CAL_MAG_COMP_TYP=2.0), "MPC_XY_CRUISE": 4.0}),
        (20.0, {"CAL_MAG0_XCOMP": 3.0}),
        (60.0, {"MPC_XY_CRUISE": 5.0}),
    )
    assert [in_force(parameters, t).motor.any() for t in (30.0, 55.0, 61.0)] == [False, False, True]
    assert PX4.changes(parameters, armed=FLIGHT) == (60.0,)


def test_the_switch_acts_in_flight():
    parameters = history((0.0, held(1, COMP=(3.0, 0.0, 0.0))), (20.0, {"CAL_MAG_COMP_TYP": 2.0}))
    assert [in_force(parameters, t).motor.any() for t in (15.0, 21.0)] == [False, True]


@pytest.mark.parametrize("value", [4.0, -1.0, 2.5, 1077936128.0])
def test_a_switch_that_the_firmware_does_not_know_is_off_and_told(value):
    values = held(1, CAL_MAG_COMP_TYP=value, COMP=(3.0, 0.0, 0.0))
    assert PX4.regressor(values) is None
    assert not PX4.in_force(values, 1).correction.vector.any()
    assert "which the vehicle takes for 0, off" in PX4.warnings(values)[0]


@given(st.lists(st.tuples(st.integers(0, 140), st.floats(-0.2, 0.2)), max_size=6))
def test_what_is_in_force_holds_between_its_changes(sets):
    parameters = history((0.0, held(1)), *((t / 2, {"CAL_MAG0_YOFF": v}) for t, v in sorted(sets)))
    changes = (-math.inf, *PX4.changes(parameters, armed=FLIGHT), 100.0)
    for begin, end in itertools.pairwise(changes):
        middle = 0.5 * (max(begin, -1.0) + end)
        assert np.array_equal(
            in_force(parameters, begin).offset, in_force(parameters, middle).offset
        )


# --- what cannot be fitted -----------------------------------------------------------------------


def recording(firmware: str, parameters: ParameterHistory) -> Recording:
    return Recording("f.ulg", Vehicle("px4", "copter", 1, 1, firmware), math.nan, 1.0, {},
                     parameters, ReadReport(1, 1, 1))  # fmt: skip


@pytest.mark.parametrize("firmware", ["1.11.3", "1.6.0", "0.9.1"])
def test_firmware_before_1_12_is_refused_with_its_version(firmware: str) -> None:
    with pytest.raises(MissingDataError, match=f"1.12 or newer; instead it is of {firmware}"):
        PX4.require_fittable(recording(firmware, history((0.0, held(1)))))


@pytest.mark.parametrize("firmware", ["1.12.0", "1.15.2", "2.0.0", ""])
def test_newer_firmware_is_taken(firmware: str) -> None:
    PX4.require_fittable(recording(firmware, history((0.0, held(1)))))


def test_a_recording_without_parameters_is_refused_with_what_to_give() -> None:
    with pytest.raises(MissingDataError, match=r"holds no parameters: give the \.ulg"):
        PX4.require_fittable(recording("", ParameterHistory()))


@given(
    numbers,
    st.sampled_from([math.nan, math.inf, 3e38, -1e9]),
    st.sampled_from(["COMP", "OFF", "SCALE"]),
)
def test_a_value_that_is_none_leaves_out_its_own_compass_alone(number, value, kind):
    bad = vector_names(kind, number)[1]
    values = {**held(1), **held(2), **held(3), **held(4), bad: value}
    found = PX4.left_out(history((0.0, values)))
    assert set(found) == {number}
    assert isinstance(found[number], ParameterFileError)
    assert bad in str(found[number])


def test_a_compass_without_a_slot_and_one_turned_inside_out_are_left_out():
    values = {**held(1), **held(2, ODIAG=(1.5, 0.0, 0.0)), **held(3, SCALE=(1e-30, 1.0, 1.0))}
    found = PX4.left_out(history((0.0, values)))
    assert set(found) == {2, 3, 4}
    assert "CAL_MAG3_ID is 0" in str(found[4])
    assert all(f"CAL_MAG{n - 1}" in str(found[n]) for n in (2, 3))


def test_what_a_log_does_not_tell_is_named():
    values = held(1)
    del values["CAL_MAG0_ZOFF"]
    force = PX4.in_force_at(history((0.0, values)), 1, 0.0)
    assert force.unseen == ("CAL_MAG0_ZOFF",)


# --- settings ------------------------------------------------------------------------------------


def test_a_compass_has_a_slot_an_id_and_what_its_settings_say():
    values = {**held(1, CAL_MAG0_PRIO=0.0), **held(3, CAL_MAG2_ROT=6.0), "CAL_MAG2_ID": -5.0}
    assert PX4.compasses(values) == (
        Compass(1, 101, False, None, False),
        Compass(3, 2**32 - 5, True, 6, True),
    )
    assert PX4.warnings(values) == ("compass 1 is not used for the heading (CAL_MAG0_PRIO is 0)",)


def test_whole_numbers_are_written_as_such():
    assert [autopilots.integer_type(name) for name in ("CAL_MAG_COMP_TYP", "CAL_MAG3_ID")] == [6, 6]
    assert all(autopilots.integer_type(n) is None for n in ("CAL_MAG0_XCOMP", "CAL_MAG0_YAW"))


def test_a_write_says_whether_a_restart_is_needed():
    by_current = {**held(1), "CAL_MAG_COMP_TYP": 2.0}
    assert PX4.write_warnings({"CAL_MAG0_XCOMP": 1.0}, by_current) == ()
    assert PX4.write_warnings({"CAL_MAG0_XOFF": 0.06}, by_current) == ()
    halves = {"CAL_MAG0_XOFF": 0.06, "CAL_MAG0_YOFF": -0.083}
    (warning,) = PX4.write_warnings(halves, by_current)
    assert "restart the vehicle after writing" in warning
    assert "CAL_MAG0_OFF" in warning


def test_a_write_says_what_will_never_be_in_force():
    small = {f"CAL_MAG0_{axis}OFF": 0.002 for axis in "XYZ"}
    (warning,) = PX4.write_warnings(small, {**held(1), "CAL_MAG_COMP_TYP": 2.0})
    assert "CAL_MAG0_OFF is never in force" in warning


@pytest.mark.parametrize("seed", range(40))
def test_what_is_not_told_of_comes_into_force_in_whatever_order_it_is_written(seed):
    """On a simulated PX4, which looks at its parameters in the midst of it."""
    luck = np.random.default_rng(seed)
    truth = scenario("parked", 1).truth
    parameters = Parameters(initial_values(truth))
    compasses = Compasses(truth, np.zeros(3), parameters, luck)
    before, now = dict(parameters.values), 10.0
    asked = {}
    for kind, span in (("OFF", 0.008), ("SCALE", 0.015), ("ODIAG", 0.015)):
        for axis in luck.permutation(list("XYZ"))[: luck.integers(4)]:
            name = f"CAL_MAG0_{axis}{kind}"
            asked[name] = float(np.float32(before[name] + luck.uniform(-span, span)))
    doubtful = dict(unsettled(asked, before, 1))
    for name in luck.permutation(list(asked)):
        parameters.set(name, asked[name], now)
        now += luck.uniform(0.0, 1.2)
        compasses.look(now, armed=False)
    compasses.look(now + 2.0, armed=False)
    for restarted in (False, True):
        if restarted:
            compasses.restart()
        force, wanted = compasses.in_force(DEVICE_IDS[0]), stored(parameters.values, 1)
        for kind, attribute in (("OFF", "offset"), ("SCALE", "scale"), ("ODIAG", "off_diagonal")):
            same = np.array_equal(getattr(force, attribute), getattr(wanted, attribute))
            told = doubtful.get(f"CAL_MAG0_{kind}")
            assert same or told == "never" or (told == "late" and not restarted)


def test_many_changes_take_no_longer_than_one_look_at_each():
    sets = ((0.01 * n, {"CAL_MAG0_XOFF": 0.05 + 0.01 * (n % 3)}) for n in range(1, 4000))
    parameters = history((0.0, held(1)), *sets)
    times = [0.01 * n + 0.005 for n in range(4000)]
    looks = 0

    class Counted(ParameterHistory):
        def of(self, name):
            nonlocal looks
            looks += 1
            return super().of(name)

    counted = Counted(parameters.changes, whole=True)
    found = PX4.in_force_over(counted, 1, times, armed=FLIGHT)
    assert len(found) == 4000
    assert looks < 100
