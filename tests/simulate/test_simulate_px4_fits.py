"""What magcomp makes of a simulated PX4 is held against its truth and the firmware's dead zones."""

from __future__ import annotations

import math

import px4_truth
import pytest

from magcomp.analysis import Options, analyse, parameter_set
from magcomp.mavlink.records import record as stamped
from magcomp.model import Grade
from magcomp.simulate import LocalConnection, Vehicle, record, scenario
from magcomp.simulate.ground import PX4_RATES, Asker
from magcomp.simulate.px4.sensors import DEVICE_IDS
from magcomp.sources import read
from magcomp.writing.plan import plan
from magcomp.writing.writer import read_current, write

UNIX_S = 1_750_000_000.0


def flown(vehicle, path):
    """A recording of a whole programme, who it is asked for as well."""
    vehicle.receive(Asker().command(512, 148), 0.0)
    frames = record(vehicle, rates=PX4_RATES)
    path.write_bytes(b"".join(stamped(round((UNIX_S + f.time) * 1e6), f.data) for f in frames))
    return read(path)


def left_deg(vehicle, tmp_path, stored, written):
    """The largest heading error that is left, of the worst compass."""
    vehicle.write_truth(tmp_path / "truth.json")
    truth = px4_truth.of_document(tmp_path / "truth.json")
    return max(
        px4_truth.heading_error_deg(truth, sensor, stored, written) for sensor in truth.sensors
    )


def test_a_sweep_gives_the_compensation(tmp_path):
    vehicle = Vehicle(scenario("sweep", 3), autopilot="px4")
    recording = flown(vehicle, tmp_path / "sweep.tlog")
    assert [each.device_id for each in recording.vehicle.compasses] == list(DEVICE_IDS)
    analysis = analyse(recording, Options())
    assert analysis.grade is not Grade.REJECTED
    written, held = parameter_set(analysis).values, dict(vehicle.parameters)
    assert written["CAL_MAG_COMP_TYP"] == 2.0
    assert left_deg(vehicle, tmp_path, held, {}) > 5.0
    assert left_deg(vehicle, tmp_path, held, written) < 0.4


@pytest.mark.slow
@pytest.mark.parametrize("compensation", ["off", "wrong"])
def test_what_a_flight_promises_is_measured_in_the_next_one(tmp_path, compensation):
    """Record, fit, write and read back, fly again: offsets that PX4 moved by itself included."""
    vehicle = Vehicle(scenario("flight", 3, compensation=compensation), autopilot="px4")
    recording = flown(vehicle, tmp_path / "first.tlog")
    analysis = analyse(recording, Options())
    assert analysis.grade is Grade.GOOD
    wanted, held = parameter_set(analysis), dict(vehicle.parameters)
    promised = max(
        math.degrees(row.p95)
        for result in analysis.compasses
        for row in result.verdict.heading_error
    )
    link = LocalConnection(vehicle, vehicle.time)
    todo = plan(
        read_current(link, recording.vehicle, wanted, clock=link.clock), wanted, recording.vehicle
    )
    assert write(todo, link, backup=tmp_path / "b.param", clock=link.clock).good
    assert left_deg(vehicle, tmp_path, held, wanted.values) < promised
