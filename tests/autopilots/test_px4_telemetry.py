"""PX4's telemetry: the sensors' own whole mGauss, and which calibration slot is whose."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from test_px4 import held

from magcomp.autopilots.px4 import Px4
from magcomp.autopilots.px4_correction import stored
from magcomp.autopilots.px4_rotation import sensor_to_body
from magcomp.model import ParameterHistory, ReadReport, Recording, Series, Vehicle

PX4 = Px4()

SLOTS = {
    **held(1, OFF=(0.05, -0.08, 0.12)),
    **held(2, OFF=(-0.1, 0.06, 0.03), SCALE=(0.95, 1.04, 1.0), CAL_MAG1_ROT=10.0),
    **held(4, OFF=(0.15, 0.02, -0.07), ODIAG=(0.01, 0.05, -0.03)),
}


def sensed(number: int, count: int = 400) -> Series:
    """What the sensor of a compass says while it is turned about, whole mGauss."""
    directions = np.random.default_rng(number).normal(size=(count, 3))
    body = 480.0 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    calibration = stored(SLOTS, number)
    in_sensor = body @ sensor_to_body(SLOTS, number)
    raw = np.linalg.solve(calibration.soft_iron, in_sensor.T).T + 1000.0 * calibration.offset
    return Series(np.arange(count) / 10, np.trunc(raw))


def corrected(number: int, field: Series) -> np.ndarray:
    return PX4.in_force(SLOTS, number).correction.apply(field.value, np.zeros(len(field)))


@pytest.mark.parametrize("order", list(itertools.permutations((1, 2, 4))))
def test_each_message_is_taken_for_the_slot_whose_calibration_fits(order) -> None:
    told = {message: sensed(number) for message, number in enumerate(order, start=1)}
    found, raw = PX4.from_telemetry(told, SLOTS)
    assert sorted(found) == [1, 2, 4]
    assert raw == {1, 2, 4}
    for number, field in found.items():
        cut = Series(field.time, field.value + 0.5 * np.sign(field.value))
        strength = np.linalg.norm(corrected(number, cut), axis=1)
        assert strength == pytest.approx(480.0, abs=1.5)
        assert np.mean(strength) == pytest.approx(480.0, abs=0.1)


def test_whole_numbers_are_mended_before_a_turn_hides_them() -> None:
    told = {1: Series(np.zeros(1), np.array([[100.0, -50.0, 30.0]]))}
    (whole, turned) = (
        PX4.from_telemetry(told, held(1, CAL_MAG0_ROT=float(rot)))[0][1].value[0] for rot in (2, 1)
    )
    assert whole.tolist() == [50.0, 100.0, 30.0]
    assert turned == pytest.approx([151.0 / 2**0.5, 50.0 / 2**0.5, 30.5])


def test_too_few_readings_are_taken_in_the_order_of_the_slots() -> None:
    told = {1: sensed(2, 20), 2: sensed(1, 20)}
    found, _ = PX4.from_telemetry(told, SLOTS)
    assert sorted(found) == [1, 2]


def test_a_message_more_than_there_are_slots_is_left_out() -> None:
    told = {n: sensed(1) for n in (1, 2, 3)}
    found, _ = PX4.from_telemetry(told, held(3))
    assert list(found) == [3]


def test_without_parameters_no_message_can_be_understood() -> None:
    assert PX4.from_telemetry({1: sensed(1)}, {}) == ({}, frozenset())


@pytest.mark.parametrize(
    ("source", "compasses", "told"), [("tlog", 2, True), ("tlog", 1, False), ("ulog", 2, False)]
)
def test_a_user_is_told_where_the_order_is_a_guess(source, compasses, told) -> None:
    fields = {n: sensed(n) for n in range(1, compasses + 1)}
    recording = Recording("f", Vehicle("px4", "copter", 1, 1), 0.0, 1.0, fields,
                          ParameterHistory(), ReadReport(1, 1, 1), format=source)  # fmt: skip
    notes = PX4.reading_notes(recording)
    assert bool(notes) is told
    assert all("CAL_MAG0_ID, CAL_MAG1_ID" in note and ".ulg" in note for note in notes)
