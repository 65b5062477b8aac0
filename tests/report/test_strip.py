"""Which parts of a recording a fit rests on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from report_analyses import flown

from magcomp.align import readings
from magcomp.model import Series
from magcomp.report.strip import PARTS, strip


def test_a_flight_is_used_while_it_is_armed() -> None:
    recording = flown().recording
    made = strip(recording, readings(recording, 1).time)
    assert len(made.time) == len(made.load) == PARTS
    assert made.load.max() == 1.0
    assert (
        not (made.used & made.disarmed)[5:-5].any() or made.seconds(made.used & made.disarmed) < 2.0
    )
    assert made.seconds(made.used) + made.seconds(~made.used) == recording.duration_s
    assert made.seconds(made.used) > 0.75 * recording.duration_s


def test_what_was_left_out_in_the_middle_is_told() -> None:
    recording = flown().recording
    time = readings(recording, 1).time
    made = strip(recording, time[(time < 100.0) | (time > 150.0)])
    hole = (made.time > 101.0) & (made.time < 149.0)
    assert not made.used[hole].any()
    assert made.used[(made.time > 60.0) & (made.time < 99.0)].all()


def test_slow_telemetry_is_one_stretch_and_no_comb() -> None:
    recording = flown().recording
    made = strip(recording, np.arange(50.0, 250.0, 2.0))
    assert made.used[(made.time > 50.0) & (made.time < 248.0)].all()


def test_without_load_arming_or_readings_it_is_empty() -> None:
    recording = replace(flown().recording, current=None, throttle=None, armed=None)
    made = strip(recording, np.empty(0))
    assert not made.load.any()
    assert not made.used.any()
    assert not made.disarmed.any()


def test_disarmed_is_what_the_vehicle_said_last() -> None:
    armed = Series(np.array([0.0, 100.0, 200.0]), np.array([0.0, 1.0, 0.0]))
    made = strip(replace(flown().recording, armed=armed), np.empty(0))
    assert made.disarmed[made.time < 99.0].all()
    assert not made.disarmed[(made.time > 101.0) & (made.time < 199.0)].any()
    assert made.disarmed[made.time > 201.0].all()
