"""Reading a telemetry log: the quantities, their units, and who they belong to."""

from __future__ import annotations

import math
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from tlog_writer import (
    PX4,
    REAL,
    RECORDINGS,
    ROOT,
    START_US,
    Sender,
    flown_again,
    log,
    record,
    short_flight,
)

from magcomp.errors import ChooseVehicleError, MissingDataError
from magcomp.model import Recording, Series
from magcomp.sources import read
from magcomp.sources.assemble import recording_from_bytes
from magcomp.sources.tlog import read_tlog
from magcomp.sources.truth import read_truth
from magcomp.sources.vehicles import Choice

FLIGHT = ROOT / "sitl_fixtures" / "flight.tlog"


def recording_of(*frames: bytes) -> Recording:
    return recording_from_bytes(log([*frames, Sender().heartbeat()]), "test.tlog")


def values(series: Series | None) -> list[float]:
    assert series is not None
    return np.asarray(series.value).tolist()


# Quantities and units


def test_a_log_becomes_one_recording() -> None:
    recording = recording_from_bytes(log(short_flight(Sender())), "test.tlog")
    assert set(recording.field) == {1, 2}
    assert len(recording.field[1]) == len(recording.field[2]) == 40
    assert values(recording.attitude)[1] == pytest.approx([0.01, 0.2, 0.3])
    assert values(recording.armed) == [0, 1, 1, 1, 1]
    assert recording.parameters.last("COMPASS_OFS_X", 0.0) == 12.5
    assert recording.report.others == ()


def test_the_first_imu_is_converted_to_the_models_units() -> None:
    recording = recording_of(Sender().raw_imu(5_000_000, mag=(100, -200, 300)))
    assert values(recording.field[1]) == [[100, -200, 300]]
    assert values(recording.gyro)[0] == pytest.approx([0.5, -0.25, 0.125])
    assert values(recording.accel)[0] == pytest.approx([0.0980665, -0.196133, -9.80665])


def test_scaled_imu_stands_in_for_raw_imu() -> None:
    sender = Sender()
    alone = recording_of(sender.scaled_imu(5000, 1, mag=(1, 2, 3)))
    assert values(alone.field[1]) == [[1, 2, 3]]
    both = recording_of(sender.scaled_imu(5000, 1, mag=(1, 2, 3)), sender.raw_imu(1, (4, 5, 6)))
    assert values(both.field[1]) == [[4, 5, 6]]


def test_a_field_of_zeros_is_no_reading_and_a_compass_without_readings_is_absent() -> None:
    sender = Sender()
    recording = recording_of(
        sender.raw_imu(1, (0, 0, 0)),
        sender.raw_imu(2, (0, 0, 5)),
        sender.scaled_imu(1, 2, (0, 0, 0)),
        sender.scaled_imu(1, 3, (1, 0, 0)),
    )
    assert set(recording.field) == {1, 3}
    assert values(recording.field[1]) == [[0, 0, 5]]


def test_throttle_is_a_share_of_one() -> None:
    sender = Sender()
    recording = recording_of(sender.throttle(0), sender.throttle(37), sender.throttle(100))
    assert values(recording.throttle) == pytest.approx([0, 0.37, 1])


def test_an_absent_current_is_left_out() -> None:
    sender = Sender()
    recording = recording_of(*(sender.system_status(i) for i in (-1, 1234, -1, 0)))
    assert values(recording.current) == pytest.approx([12.34, 0.0])
    assert recording_of(sender.system_status(-1)).current is None


def test_current_and_voltage_come_from_the_message_that_came_more_often() -> None:
    sender = Sender()
    status = [sender.system_status(100, 11000), sender.system_status(200, 11100)]
    battery = [sender.battery(300, cells=(4000, 4100)), sender.battery(400, cells=(4000, 4200))]
    assert values(recording_of(*status, battery[0]).current) == pytest.approx([1, 2])
    equal = recording_of(*status, *battery)
    assert values(equal.current) == pytest.approx([3, 4])
    assert values(equal.voltage) == pytest.approx([8.1, 8.2])


def test_a_second_battery_is_not_the_first() -> None:
    sender = Sender()
    recording = recording_of(sender.battery(900, number=1), sender.battery(300), sender.battery(-1))
    assert values(recording.current) == pytest.approx([3])


def test_further_batteries_have_currents_of_their_own() -> None:
    sender = Sender()
    recording = recording_of(
        sender.battery(300),
        sender.battery(900, number=1),
        sender.battery(-1, number=1),
        sender.battery(1100, number=3),
        sender.battery(-1, number=4),
        sender.battery(700, number=1),
    )
    others = {number: values(series) for number, series in recording.other_currents.items()}
    assert others == {1: [9, 7], 3: [11]}
    assert values(recording.current) == [3]


def test_a_battery_alone_under_another_number_is_not_a_further_one() -> None:
    sender = Sender()
    recording = recording_of(sender.battery(900, number=255), sender.system_status(900))
    assert recording.other_currents == {}
    assert values(recording.current) == [9]


def test_a_recording_says_what_it_was_read_from() -> None:
    assert recording_of().format == "tlog"
    data = log([Sender().heartbeat()])
    assert recording_from_bytes(data, "udp:14550", live=True).format == "live"


def test_servo_outputs_have_sixteen_channels_of_the_main_port() -> None:
    sender = Sender()
    recording = recording_of(
        sender.servos(5_000_000, *range(1001, 1017)), sender.servos(5_100_000, 1500, port=1)
    )
    assert values(recording.outputs) == [list(range(1001, 1017))]


def test_outputs_that_px4_tells_unrounded_are_taken_where_they_come_more_often() -> None:
    sender = Sender()
    found = recording_of(
        sender.servos(5_000_000, 1500),
        sender.actuators(5_000_000, 1500.25, 1100.5, -1.0, float("nan")),
        sender.actuators(5_100_000, 1500.5, 1100.5),
        sender.actuators(5_200_000, -1.0, 0.0),
    ).outputs
    assert found is not None
    assert found.value[:, :4].tolist() == [[1500.25, 1100.5, 0.0, 0.0], [1500.5, 1100.5, 0.0, 0.0]]
    assert found.value.shape == (2, 16)
    assert np.diff(found.time).tolist() == pytest.approx([0.1])


def test_speed_controllers_have_the_currents_of_their_outputs() -> None:
    sender = Sender()
    found = recording_of(
        sender.controllers(100, 200, 300, 0),
        sender.controllers(150, 250, 350, 0),
        sender.controllers(0, 75, 0, 0, first=5),
    )
    assert {place: each.value.tolist() for place, each in found.esc_currents.items()} == {
        0: [1.0, 1.5],
        1: [2.0, 2.5],
        2: [3.0, 3.5],
        5: [0.75],
    }
    assert found.esc_current is not None
    assert found.esc_current.value.tolist() == [6.75, 8.25]


@pytest.mark.parametrize(
    ("states", "forward"),
    [
        ([3, 3, 1, 4, 2, 3], [0, 1, 1, 1, 1, 0]),
        ([0, 3, 4, 0, 3], [1, 1, 0]),
        ([0, 0], None),
        ([], None),
    ],
    ids=["there and back", "not told at first", "no VTOL", "silent"],
)
def test_a_vtol_is_on_its_way_from_the_last_time_it_hovered(states, forward) -> None:
    sender = Sender()
    found = recording_of(*map(sender.vtol, states)).forward
    assert (None if found is None else found.value.tolist()) == forward


def test_position_comes_from_the_estimate_or_else_from_the_gps() -> None:
    sender = Sender()
    gps = [
        sender.frame(dialect.MAVLink_gps_raw_int_message(1, fix, 10, 20, 3000, 0, 0, 0, 0, 9))
        for fix in (1, 3)
    ]
    assert values(recording_of(*gps).position) == [pytest.approx([1e-6, 2e-6, 3.0])]
    both = recording_of(*gps, sender.position(5000, 0, 0), sender.position(5100, 473977418, 7))
    assert values(both.position) == [pytest.approx([47.3977418, 7e-7, 488.0])]


def test_attitude_that_is_not_finite_is_left_out() -> None:
    sender = Sender()
    recording = recording_of(
        sender.attitude(5000, roll=math.nan),
        sender.attitude(5100),
        sender.attitude(5200, yaw=-math.inf),
    )
    assert len(values(recording.attitude)) == 1


def test_a_log_without_compass_or_attitude_is_still_a_recording() -> None:
    recording = recording_of()
    assert recording.field == {}
    assert recording.attitude is recording.throttle is recording.current is None
    assert recording.vehicle.kind == "copter"


# Parameters


def test_parameters_that_change_half_way_are_kept_with_their_times() -> None:
    sender = Sender()
    frames = [sender.heartbeat(), sender.parameter("COMPASS_MOTCT", 0)]
    frames += [sender.attitude(5000 + 100 * n) for n in range(50)]
    frames += [sender.parameter("COMPASS_MOTCT", 2)]
    frames += [sender.attitude(10_000 + 100 * n) for n in range(50)]
    recording = recording_from_bytes(log(frames, lambda n: n * 100_000), "test.tlog")
    before, after = recording.parameters.of("COMPASS_MOTCT")
    assert (before.value, after.value) == (0, 2)
    assert after.time == pytest.approx(5.1, abs=0.1)
    assert recording.parameters.at("COMPASS_MOTCT", 5.3, 9.0) == 2


def test_a_parameter_that_is_not_a_number_is_kept_for_those_who_refuse_it_by_name() -> None:
    recording = recording_of(Sender().parameter("COMPASS_OFS_X", math.nan))
    assert math.isnan(recording.parameters.last("COMPASS_OFS_X", 0.0))


def test_a_name_of_sixteen_letters_is_whole() -> None:
    recording = recording_of(Sender().parameter("ABCDEFGHIJKLMNOP", 1))
    assert recording.parameters.names == {"ABCDEFGHIJKLMNOP"}


@pytest.mark.parametrize(
    ("kind", "code", "value"),
    [
        (1, "<Bxxx", 200),
        (2, "<bxxx", -5),
        (3, "<Hxx", 60000),
        (4, "<hxx", -300),
        (5, "<I", 4_000_000_000),
        (6, "<i", 396_825),
        (9, "<f", 0.5),
    ],
)
def test_integers_of_px4_are_bytes_in_the_place_of_a_float(
    kind: int, code: str, value: float
) -> None:
    sender = Sender()
    as_float = struct.unpack("<f", struct.pack(code, value))[0]
    frames = [sender.heartbeat(autopilot=PX4), sender.parameter("CAL_MAG0_ID", as_float, kind)]
    recording = recording_from_bytes(log(frames), "test.tlog")
    assert recording.vehicle.autopilot == "px4"
    assert recording.parameters.last("CAL_MAG0_ID", 0.0) == value


def test_an_autopilot_that_says_how_its_parameters_travel_is_believed() -> None:
    sender = Sender()
    version = dialect.MAVLink_autopilot_version_message(
        dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST,
        *(0x010F_02FF, 0, 0, 0, bytes(8), bytes(8), bytes(8), 0, 0, 0),
    )
    frames = [
        sender.heartbeat(autopilot=PX4),
        sender.parameter("CAL_MAG0_ID", 197_388, 6),
        sender.frame(version),
    ]
    recording = recording_from_bytes(log(frames), "test.tlog")
    assert recording.parameters.last("CAL_MAG0_ID", 0.0) == 197_388
    assert recording.vehicle.device_ids == (197_388,)
    assert recording.vehicle.capabilities == 1 << 17


def test_a_px4_vehicle_comes_out_with_all_its_log_says() -> None:
    sender = Sender()
    frames = [sender.heartbeat(autopilot=PX4), sender.scaled_imu(5000, 1, mag=(1, 2, 3))]
    for number, device in enumerate((197_388, 197_644)):
        (as_float,) = struct.unpack("<f", struct.pack("<i", device))
        frames.append(sender.parameter(f"CAL_MAG{number}_ID", as_float, 6))
    recording = recording_from_bytes(log(frames), "test.tlog")
    assert (recording.vehicle.autopilot, recording.vehicle.kind) == ("px4", "copter")
    assert recording.vehicle.device_ids == (197_388, 197_644)
    assert values(recording.field[1]) == [[1, 2, 3]]


def test_integers_of_ardupilot_are_floats() -> None:
    recording = recording_of(Sender().parameter("COMPASS_DEV_ID", 97539, 6))
    assert recording.parameters.last("COMPASS_DEV_ID", 0.0) == 97539


# The truth stays apart


def test_the_parameters_of_the_simulation_are_not_in_the_recording() -> None:
    assert not any(name.startswith("SIM_") for name in read_tlog(FLIGHT).parameters.names)
    assert "SIM_MAG1_OFS_X" in read_truth(FLIGHT).parameters


def test_the_truth_has_the_recordings_time_axis() -> None:
    recording, truth = read_tlog(FLIGHT), read_truth(FLIGHT)
    assert recording.attitude is not None
    believed = np.interp(
        truth.attitude.time, recording.attitude.time, recording.attitude.value[:, 0]
    )
    error = believed - truth.attitude.value[:, 0]
    assert np.degrees(np.median(np.abs(error))) < 0.2
    assert truth.position.value.mean(axis=0) == pytest.approx([47.398, 8.546], abs=0.01)


def test_a_real_log_has_no_truth(tmp_path: Path) -> None:
    path = tmp_path / "real.tlog"
    path.write_bytes(log(short_flight(Sender())))
    with pytest.raises(MissingDataError, match="SIMSTATE"):
        read_truth(path)


# Who made it


def test_the_vehicle_of_a_recording_of_the_firmware() -> None:
    vehicle = read_tlog(FLIGHT).vehicle
    assert (vehicle.autopilot, vehicle.kind) == ("ardupilot", "copter")
    assert (vehicle.system, vehicle.component) == (1, 1)
    assert vehicle.firmware == "4.6.3"
    assert vehicle.device_ids == (97539, 131874, 263178)


@pytest.mark.parametrize(
    ("line", "version"),
    [
        ("ArduCopter V4.6.3 (92b0cd78)", "4.6.3"),
        ("APM:Copter V3.4-dev (bdddfae5)", "3.4-dev"),
        ("ArduCopter V3.0.1", "3.0.1"),
        ("PreArm: Need 3D Fix", ""),
    ],
)
def test_the_firmware_says_its_version_when_it_starts(line: str, version: str) -> None:
    assert recording_of(Sender().text(line)).vehicle.firmware == version


def test_the_version_message_is_believed_before_the_banner() -> None:
    sender = Sender()
    version = dialect.MAVLink_autopilot_version_message(
        0, 0x0406_03FF, 0, 0, 0, bytes(8), bytes(8), bytes(8), 0, 0, 0
    )
    recording = recording_of(sender.frame(version), sender.text("ArduCopter V4.5.0 (abc)"))
    assert recording.vehicle.firmware == "4.6.3"


def test_the_flight_controllers_number_is_taken_from_what_it_says_of_itself() -> None:
    sender = Sender()
    banner = sender.text("CubeOrange 00510027 33355115 31373937")
    number = "270051001551353337393731"
    assert recording_of(banner).vehicle.uid == number
    assert recording_of(sender.text("fmuv5 00000000 00000000 00000000")).vehicle.uid == ""
    told = [0x0A, 0x0B, *[0] * 16]
    for uid2, expected in ((told, "0a0b"), ([0] * 18, number)):
        version = dialect.MAVLink_autopilot_version_message(
            0, 0, 0, 0, 140 << 16, bytes(8), bytes(8), bytes(8), 0, 0, 0, uid2
        )
        vehicle = recording_of(sender.frame(version), banner).vehicle
        assert (vehicle.uid, vehicle.board) == (expected, "board 140")


@pytest.mark.parametrize(
    ("mav_type", "kind"),
    [
        (2, "copter"),
        (13, "copter"),
        (29, "copter"),
        (1, "plane"),
        (20, "plane"),
        (10, "rover"),
        (11, "boat"),
        (12, "sub"),
        (7, "unknown"),
    ],
)
def test_the_kind_of_vehicle_is_known_from_its_heartbeat(mav_type: int, kind: str) -> None:
    recording = recording_from_bytes(log([Sender().heartbeat(mav_type)]), "test.tlog")
    assert recording.vehicle.kind == kind


def test_ground_stations_gimbals_and_radios_are_not_the_vehicle() -> None:
    station = Sender(255, 190).heartbeat(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID)
    gimbal = Sender(1, 154).heartbeat(dialect.MAV_TYPE_GIMBAL)
    stranger = Sender(51, 68).attitude(9_000_000, roll=3.0)
    frames = [station, gimbal, stranger, *short_flight(Sender())]
    recording = recording_from_bytes(log(frames), "test.tlog")
    assert (recording.vehicle.system, recording.vehicle.component) == (1, 1)
    assert recording.report.others == ((1, 154), (51, 68), (255, 190))
    assert max(values(recording.attitude))[0] < 3.0


def test_two_vehicles_must_be_chosen_from() -> None:
    frames = [
        f
        for pair in zip(short_flight(Sender(1)), short_flight(Sender(7)), strict=True)
        for f in pair
    ]
    data = log(frames)
    with pytest.raises(ChooseVehicleError, match=r"--system 1 or --system 7"):
        recording_from_bytes(data, "test.tlog")
    one = recording_from_bytes(data, "test.tlog", Choice(7))
    assert one.vehicle.system == 7
    assert len(values(one.attitude)) == 40
    with pytest.raises(ChooseVehicleError, match="instead received 3"):
        recording_from_bytes(data, "test.tlog", Choice(3))


# The report


def test_the_report_says_what_became_of_every_byte() -> None:
    frames = short_flight(Sender())
    noise = b"noise"
    other = Sender(255, 190).heartbeat(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID)
    data = noise + log([*frames, other]) + record(START_US, frames[0])[:-1]
    report = recording_from_bytes(data, "test.tlog").report
    assert report.size == len(data)
    assert report.frames == len(frames) + 1
    assert report.used == len(frames)
    assert report.skipped == len(noise) + 8 + len(frames[0]) - 1
    assert (report.bad_checksum, report.duplicates) == (0, 0)
    assert report.others == ((255, 190),)


# Whole logs


@pytest.mark.parametrize("path", [*RECORDINGS, *REAL], ids=lambda path: path.stem)
def test_recordings_and_real_logs_are_plausible(path: Path) -> None:
    recording = read(path)
    assert recording.report.bad_checksum == 0
    assert recording.report.skipped < 100
    assert recording.duration_s > 60
    for series in recording.field.values():
        strength = np.linalg.norm(series.value, axis=1)
        assert 100 < np.median(strength) < 1000
    assert recording.accel is not None
    assert np.median(np.linalg.norm(recording.accel.value, axis=1)) == pytest.approx(9.8, abs=0.8)
    assert recording.throttle is not None
    assert recording.throttle.value.max() <= 1


def test_memory_stays_below_four_times_the_log(tmp_path: Path) -> None:
    path = tmp_path / "long.tlog"
    path.write_bytes(flown_again(FLIGHT.read_bytes(), 6))
    read(FLIGHT)
    tracemalloc.start()
    try:
        read(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 4 * path.stat().st_size
    assert read(path).report.duplicates == 0
