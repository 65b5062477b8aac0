"""A simulated recording looks like one of real firmware and is the same every time."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.errors import OutputError
from magcomp.simulate import Truth, Vehicle, record, scenario, write_tlog
from magcomp.simulate.ground import DEFAULT_RATES
from magcomp.simulate.outputs import motor_outputs
from magcomp.simulate.truth import write_truth
from magcomp.sources import read

FIXTURES = Path(__file__).parents[2] / "sitl_fixtures"


def messages(path):
    """Every message with its time stamp, read by pymavlink."""
    log = mavutil.mavlink_connection(str(path))
    found = []
    while (message := log.recv_msg()) is not None:
        found.append(message)
    log.close()
    return found


@pytest.fixture(scope="module")
def simulated(tmp_path_factory) -> tuple[list, Truth]:
    path = tmp_path_factory.mktemp("simulated") / "flight.tlog"
    truth = write_tlog(path, program="flight", seed=11)
    return messages(path), truth


@pytest.fixture(scope="module")
def real() -> list:
    return messages(FIXTURES / "flight.tlog")


def test_the_same_seed_gives_the_same_bytes(tmp_path):
    for name in ("first", "second"):
        write_tlog(tmp_path / name, program="sweep", seed=5)
    assert (tmp_path / "first").read_bytes() == (tmp_path / "second").read_bytes()


def test_another_seed_gives_another_vehicle(tmp_path):
    one = write_tlog(tmp_path / "one", program="sweep", seed=5)
    other = write_tlog(tmp_path / "other", program="sweep", seed=6)
    assert one.as_json() != other.as_json()
    assert (tmp_path / "one").read_bytes() != (tmp_path / "other").read_bytes()


def test_it_says_all_that_real_firmware_says_and_nothing_else(simulated, real):
    kinds = {m.get_type() for m in simulated[0]}
    real_kinds = {m.get_type() for m in real}
    # The real log also has the estimator's origin, which nothing here reads.
    assert real_kinds - kinds == {"GPS_GLOBAL_ORIGIN", "HOME_POSITION"}
    assert kinds <= real_kinds


@pytest.mark.parametrize("number", DEFAULT_RATES)
def test_each_message_comes_at_the_real_recordings_rate(simulated, real, number):
    kind = mavlink.mavlink_map[number].msgname

    def rate(log):
        stamps = [m._timestamp for m in log if m.get_type() == kind]
        return (len(stamps) - 1) / (stamps[-1] - stamps[0])

    assert rate(simulated[0]) == pytest.approx(rate(real), rel=0.02)


def test_one_moments_messages_come_in_the_real_order(simulated, real):
    def orders(log):
        kinds = [mavlink.mavlink_map[number].msgname for number in DEFAULT_RATES]
        pairs = Counter()
        for before, after in itertools.pairwise(log):
            same = abs(after._timestamp - before._timestamp) < 1e-3
            if same and before.get_type() in kinds and after.get_type() in kinds:
                pairs[before.get_type(), after.get_type()] += 1
        return {pair for pair, count in pairs.items() if count > 20}

    assert orders(simulated[0]) == orders(real)


def test_sequence_numbers_have_no_gap(simulated):
    numbers = np.array([m.get_seq() for m in simulated[0]])
    assert set(np.diff(numbers) % 256) == {1}


def test_fields_are_whole_milligauss_near_the_real_ones(simulated, real):
    for log in (simulated[0], real):
        field = [(m.xmag, m.ymag, m.zmag) for m in log if m.get_type() == "RAW_IMU"]
        assert 150 < np.median(np.linalg.norm(field, axis=1)) < 700


def test_gravity_and_rates_have_the_real_units(simulated, real):
    for log in (simulated[0], real):
        imu = [m for m in log if m.get_type() == "RAW_IMU"]
        assert np.median([m.zacc for m in imu]) == pytest.approx(-1000, abs=60)
        gyro = np.array([m.zgyro for m in imu])
        yaw = np.unwrap([m.yaw for m in log if m.get_type() == "ATTITUDE"])
        assert np.std(gyro) / 1000 == pytest.approx(np.std(np.diff(yaw)) * 10, rel=0.35)


def test_streamed_faster_than_it_is_read_the_field_repeats():
    vehicle = Vehicle(scenario("turntable_paper", 2))
    rates = {mavlink.MAVLINK_MSG_ID_RAW_IMU: 50.0}
    codec = mavlink.MAVLink(None)
    heard = [codec.decode(bytearray(f.data)) for f in record(vehicle, seconds=40.0, rates=rates)]
    imu = [m for m in heard if m.get_type() == "RAW_IMU"]
    field = np.array([(m.xmag, m.ymag, m.zmag) for m in imu])
    new = np.flatnonzero(np.any(np.diff(field[600:1600], axis=0) != 0, axis=1))
    assert set(np.diff(new).tolist()) <= {5, 10, 15}
    assert len(new) == pytest.approx(200, rel=0.05)


def test_without_a_battery_monitor_there_is_no_current(tmp_path):
    write_tlog(tmp_path / "x.tlog", program="sweep", seed=2, parameters={"BATT_MONITOR": 0})
    log = messages(tmp_path / "x.tlog")
    assert "BATTERY_STATUS" not in {m.get_type() for m in log}
    assert {m.current_battery for m in log if m.get_type() == "SYS_STATUS"} == {-1}


def test_the_truth_file_has_the_fixtures_form(simulated, tmp_path):
    write_truth(tmp_path / "truth.json", simulated[1].as_json())
    written = json.loads((tmp_path / "truth.json").read_text())
    # Beside a .tlog: the simulated vehicle is an ArduCopter, and PX4's truth has another form.
    ours = [path for path in FIXTURES.glob("*.json") if path.with_suffix(".tlog").exists()]
    assert ours
    for path in ours:
        given = json.loads(path.read_text())
        missing = given.keys() - written.keys()
        assert missing <= {"start_mot", "start_ofs"}, path
        for key in given.keys() & written.keys():
            assert type(written[key]) is type(given[key]), key
    assert [sorted(c) for c in written["compass"]] == [["dia", "odi", "ofs"]] * 3


def test_a_truth_file_that_cannot_be_written_is_one_sentence(simulated, tmp_path):
    with pytest.raises(OutputError, match=r"nowhere.*must be writable"):
        write_truth(tmp_path / "nowhere" / "truth.json", simulated[1].as_json())


def test_the_simulation_parameters_tell_the_truth(simulated):
    log, truth = simulated
    values = {m.param_id: m.param_value for m in log if m.get_type() == "PARAM_VALUE"}
    told = [values[f"SIM_MAG_MOT_{axis}"] for axis in "XYZ"]
    np.testing.assert_allclose(told, truth.interference, rtol=1e-6)
    for number, compass in enumerate(truth.compasses, start=1):
        told = [values[f"SIM_MAG{number}_OFS_{axis}"] for axis in "XYZ"]
        np.testing.assert_allclose(told, compass.offset, rtol=1e-6)


def test_calibrated_vehicles_boot_with_the_true_calibration(simulated):
    log, truth = simulated
    values = {m.param_id: m.param_value for m in log if m.get_type() == "PARAM_VALUE"}
    assert truth.calibrated
    for suffix, compass in zip(("", "2", "3"), truth.compasses, strict=True):
        for kind, exact in (
            ("OFS", compass.offset),
            ("DIA", compass.diagonal),
            ("ODI", compass.off_diagonal),
        ):
            told = [values[f"COMPASS_{kind}{suffix}_{axis}"] for axis in "XYZ"]
            np.testing.assert_allclose(told, exact, rtol=1e-6)
    assert values["COMPASS_MOTCT"] == 0


@pytest.mark.parametrize("recording", ["turntable_five_levels", "sweep_current"])
def test_the_thrust_curve_is_the_real_firmwares(recording):
    truth = json.loads((FIXTURES / f"{recording}.json").read_text())
    curve = {
        "MOT_PWM_MIN": 1000.0,
        "MOT_PWM_MAX": 2000.0,
        "MOT_THST_EXPO": 0.65,
        "MOT_SPIN_MIN": 0.15,
        "MOT_SPIN_MAX": 0.95,
        "MOT_SPIN_ARM": 0.1,
        "MOT_BAT_VOLT_MAX": 12.8,
        "MOT_BAT_VOLT_MIN": 9.6,
    }
    throttle, outputs = 0, {}
    for message in messages(FIXTURES / f"{recording}.tlog"):
        if message.get_type() == "VFR_HUD":
            throttle = message.throttle
        if message.get_type() == "SERVO_OUTPUT_RAW" and throttle:
            outputs.setdefault(throttle, []).append(message.servo1_raw)
    held = {percent: np.median(seen) for percent, seen in outputs.items() if len(seen) > 70}
    assert len(held) >= 4
    for percent, output in held.items():
        # VFR_HUD cuts the throttle to whole per cent: the output lies between two.
        low, high = motor_outputs(
            np.array([percent, percent + 1]) / 100.0,
            armed=True,
            voltage=24.0,
            altitude_m=truth["home"][2],
            parameters=curve,
        )
        assert low - 1.0 <= output <= high + 1.0


def test_the_log_reader_finds_everything_a_fit_needs(tmp_path):
    truth = write_tlog(tmp_path / "flight.tlog", program="sweep", seed=11)
    recording = read(tmp_path / "flight.tlog")
    assert recording.vehicle.device_ids == (97539, 131874, 263178)
    assert (recording.vehicle.kind, recording.vehicle.firmware) == ("copter", "4.6.3")
    assert recording.start_unix_s == 1_750_000_000.0
    assert (recording.report.bad_checksum, recording.report.skipped) == (0, 0)
    assert recording.field.keys() == {1, 2, 3}
    for series in (
        recording.attitude,
        recording.gyro,
        recording.accel,
        recording.throttle,
        recording.current,
        recording.voltage,
        recording.outputs,
        recording.armed,
    ):
        assert series is not None
        assert len(series) > 60
    np.testing.assert_allclose(recording.position.value[0], truth.home, atol=1e-6)
