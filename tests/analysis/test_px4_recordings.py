"""What is found in recordings of the real PX4 firmware, through its own formula and dead zones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import px4_truth
import pytest
from truth import FIXTURES

from magcomp.analysis import Options, analyse, parameter_set
from magcomp.analysis.emit import what_applies
from magcomp.errors import MissingDataError
from magcomp.judge import heading_errors
from magcomp.judge.judge import DEFAULT_SEED
from magcomp.model import CURRENT, THROTTLE
from magcomp.sources import read

FIXTURE = FIXTURES / "px4_flight.ulg.gz"
DEVICES = {1: 197644, 2: 197388, 4: 197902}


def test_a_log_of_the_firmware_is_read_by_the_slots_of_its_devices() -> None:
    found = read(FIXTURE)
    assert {c.slot: c.device_id for c in found.vehicle.compasses} == DEVICES
    assert found.raw_compasses == set(DEVICES)
    assert found.current is not None
    assert found.throttle is not None
    assert found.armed is not None
    assert 4.65e8 < found.position.value[0, 0] * 1e7 < 4.85e8


def test_a_wrong_compensation_in_force_is_replaced_by_the_right_one() -> None:
    """Of the external compass, which is turned, and in another slot than its instance."""
    compass = 4
    recording = read(FIXTURE)
    truth = px4_truth.of_document(FIXTURES / "px4_flight.json")
    sensor = next(s for s in truth.sensors if s.device == DEVICES[compass])
    analysis = analyse(recording, Options(compass=compass, regressor=CURRENT))
    emitted = parameter_set(analysis).values
    stored = recording.parameters.latest
    before = px4_truth.heading_error_deg(truth, sensor, stored, {})
    after = px4_truth.heading_error_deg(truth, sensor, stored, emitted)
    assert emitted["CAL_MAG_COMP_TYP"] == 2.0
    assert before > 30.0
    assert after < 1.0
    assert analysis.compasses[0].verdict.heading_error[-1].p95 > after

    result = analysis.compasses[0]
    applied = what_applies(recording, CURRENT)
    assert applied is not None
    firmware = applied(result.fit)
    in_force = px4_truth.through_dead_zones(px4_truth.AT_START, {**stored, **emitted}, compass - 1)
    assert np.allclose(firmware.offset, -1000.0 * sensor.rotation @ in_force["OFF"], atol=1e-3)
    # The bound is that of what the firmware will do, not of the fit that it cannot take over.
    rng, zeros = np.random.default_rng(DEFAULT_SEED), np.zeros(6)
    told = [row.p95 for row in result.verdict.heading_error]
    of_fit = heading_errors(result.fit, firmware, zeros, rng)
    of_firmware = heading_errors(result.fit, firmware, zeros, rng, applied=firmware)
    assert told == pytest.approx([row.p95 for row in of_firmware], rel=1e-9)
    assert told != pytest.approx([row.p95 for row in of_fit], rel=1e-3)


def analysed(path: Path) -> dict[int, float]:
    """Heading error by device with all that is written, at any grade."""
    recording = read(path)
    analysis = analyse(recording)
    truth = px4_truth.of_document(path.with_suffix(".json"))
    stored = recording.parameters.latest
    emitted = parameter_set(analysis, include_rejected=True).values
    wanted = THROTTLE if "thrust" in path.stem else CURRENT
    assert all(result.fit.regressor == wanted for result in analysis.compasses)
    return {
        sensor.device: px4_truth.heading_error_deg(truth, sensor, stored, emitted)
        for sensor in truth.sensors
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "flight.ulg",
        "flight.tlog",
        "flight_default_rates.ulg",
        "flight_thrust.ulg",
        "flight_wrong_comp_swapped_slots.ulg",
        "rig_levels.ulg",
    ],
)
def test_every_compass_of_a_recording_is_put_right(name: str) -> None:
    path = px4_truth.RECORDINGS / name
    if not path.exists():
        pytest.skip("the shared recordings are not here")
    assert all(error < 1.0 for error in analysed(path).values())


@pytest.mark.skipif(not px4_truth.RECORDINGS.exists(), reason="no shared recordings here")
def test_telemetry_without_a_compass_names_the_log_that_has_one() -> None:
    with pytest.raises(
        MissingDataError, match=r"give the vehicle's own log of the same flight \(\.ulg\)"
    ):
        analyse(read(px4_truth.RECORDINGS / "flight_default_rates.tlog"))
