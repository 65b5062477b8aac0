"""What a PX4 log says becomes a Recording in the model's units, and damage ends in a sentence."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import px4_truth
import pytest
from effort import examples
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyulog import ULog
from ulog_writer import (
    ESC_REPORT_OF_FUNCTIONS,
    FORMS,
    MAGIC,
    START_US,
    SYNC,
    Writer,
    message,
    short_flight,
    slot,
)

from magcomp.errors import InputError, LogError
from magcomp.model import Recording
from magcomp.sources import read
from magcomp.sources.ulog import read_ulog

REAL = sorted((px4_truth.SHARED / "real").glob("*.ulg"))
RECORDINGS = sorted(px4_truth.RECORDINGS.glob("*.ulg"))


@pytest.fixture
def recorded(tmp_path: Path) -> Callable[[Writer | bytes], Recording]:
    def read_back(log: Writer | bytes) -> Recording:
        path = tmp_path / "log.ulg"
        path.write_bytes(log if isinstance(log, bytes) else log.binary())
        return read(path)

    return read_back


# --- whose log it is -----------------------------------------------------------------------------


def test_a_log_says_whose_it_is(recorded) -> None:
    found = recorded(short_flight())
    assert (found.format, found.vehicle.autopilot, found.vehicle.kind) == ("ulog", "px4", "copter")
    assert (found.vehicle.firmware, found.vehicle.system) == ("1.15.2", 3)
    assert [(c.slot, c.device_id, c.external) for c in found.vehicle.compasses] == [
        (1, 222, False),
        (2, 111, True),
    ]


def test_the_date_is_that_of_the_satellites_else_of_the_file(recorded) -> None:
    writer = short_flight()
    writer.said("[logger] /fs/microsd/log/2024-03-01/06_46_06.ulg\t")
    assert recorded(writer).start_unix_s == 1709275566.0
    writer.row("vehicle_gps_position", 4.0, 1_700_000_004_000_000, 473_977_420, 85_455_940,
               488_000, 3)  # fmt: skip
    found = recorded(writer)
    assert found.start_unix_s == pytest.approx(1_700_000_000.0, abs=1e-3)
    assert found.position.value[0] == pytest.approx([47.397742, 8.545594, 488.0])


# --- compasses -----------------------------------------------------------------------------------


def test_a_compass_is_that_of_the_slot_which_holds_its_device(recorded) -> None:
    found = recorded(short_flight())
    assert sorted(found.field) == [1, 2]
    assert found.raw_compasses == {1, 2}
    assert found.field[1].value[0] == pytest.approx([200.0, 100.0, 400.0], rel=1e-6)
    # Turned by roll 180° and then yaw 90°.
    assert found.field[2].value[0] == pytest.approx([100.0, 200.0, -400.0], rel=1e-6)


def test_a_device_without_a_slot_is_read_and_left_out_with_the_reason(recorded) -> None:
    writer = short_flight()
    writer.row("sensor_mag", 1.0, START_US, 999, 0.3, 0.2, 0.1, instance=2)
    found = recorded(writer)
    assert sorted(found.field) == [1, 2, 3]


def test_readings_of_a_compass_that_takes_over_go_to_its_own_slot(recorded) -> None:
    writer = Writer(parameters={"CAL_MAG_COMP_TYP": 0, **slot(0, 222), **slot(1, 111)})
    for n in range(20):
        writer.row("vehicle_magnetometer", n / 5, START_US + n * 200_000, 222 if n < 12 else 111,
                   0.2, 0.1, 0.3)  # fmt: skip
    found = recorded(writer)
    assert [len(found.field[n]) for n in (1, 2)] == [12, 8]
    assert not found.raw_compasses


@pytest.mark.parametrize(
    ("told", "switch", "raw"),
    [(0.0, 0, False), (0.004, 0, True), (0.0, 2, True)],
    ids=["undone", "by another offset", "with compensation"],
)
def test_the_corrected_field_is_taken_where_the_log_shows_that_it_can_be_undone(
    recorded, told: float, switch: int, raw: bool
) -> None:
    """PX4 logs the sensors' own field once a second, and one corrected field twice."""
    offset = (0.05, -0.08, 0.12)
    writer = Writer(
        parameters={
            "CAL_MAG_COMP_TYP": switch,
            **slot(0, 222, OFF=offset, COMP=(1.0, 0.0, 0.0)),
        }
    )
    shift = np.array([told, 0.0, 0.0])
    noise = np.random.default_rng(1).normal(scale=0.002, size=(120, 3))
    for n in range(120):
        time, stamp = n / 2, START_US + n * 500_000
        field = np.array([0.2 + 0.1 * np.sin(n / 9), 0.1, 0.4])
        writer.row("vehicle_magnetometer", time, stamp, 222, *(field + shift))
        if n % 2 == 0:
            writer.row("sensor_mag", time, stamp, 222, *(field + offset + noise[n]))
    found = recorded(writer)
    assert found.raw_compasses == ({1} if raw else set())
    assert len(found.field[1]) == (60 if raw else 120)


def test_an_old_log_has_its_compass_among_the_combined_sensors(recorded) -> None:
    writer = Writer(release=0x010600FF, parameters={"CAL_MAG0_ID": 5})
    for n in range(5):
        writer.row("sensor_combined", n / 10, 0.0, 0.0, 0.0, 0.2, 0.1, 0.3)
    found = recorded(writer)
    assert found.vehicle.firmware == "1.6.0"
    assert found.field[2].value[0] == pytest.approx([200.0, 100.0, 300.0], rel=1e-6)


def test_a_reading_has_the_time_of_its_measurement(recorded) -> None:
    writer = short_flight(1)
    writer.row("sensor_mag", 1.5, START_US + 1_250_000, 222, 0.5, 0.5, 0.5, instance=1)
    assert recorded(writer).field[1].time[-1] == pytest.approx(1.25)


# --- control quantities --------------------------------------------------------------------------


@pytest.mark.parametrize("absent", [-1.0, 0.0])
def test_a_battery_without_a_current_sensor_has_no_current(recorded, absent: float) -> None:
    writer = Writer()
    for n in range(20):
        writer.row("battery_status", n / 5, 12.0, absent)
    found = recorded(writer)
    assert found.current is None
    assert found.voltage is not None


def test_the_speed_controllers_currents_are_summed(recorded) -> None:
    writer = short_flight(1)
    for n in range(5):
        writer.row("esc_status", n / 10, 0, 3.0 + n, 0, 4.0)
    found = recorded(writer)
    assert found.esc_current.value.tolist() == [7.0, 8.0, 9.0, 10.0, 11.0]
    assert found.attitude_source == "vehicle_attitude"


@pytest.mark.parametrize(("is_vtol", "forward"), [(True, [0.0, 1.0, 1.0, 1.0]), (False, None)])
def test_a_vtol_says_when_it_flies_on_its_wings(recorded, is_vtol, forward) -> None:
    form = "uint64_t timestamp;uint8_t vehicle_type;bool is_vtol;bool in_transition_mode;"
    writer = Writer(forms={**FORMS, "vehicle_status": form})
    for n, (kind, transition) in enumerate([(1, False), (1, True), (2, False), (2, True)]):
        writer.row("vehicle_status", n, kind, is_vtol, transition)
    found = recorded(writer).forward
    assert (None if found is None else found.value.tolist()) == forward


def test_a_speed_controller_that_says_which_motor_it_drives_is_that_motors(recorded) -> None:
    writer = short_flight(1)
    writer.forms = {**writer.forms, "esc_report": ESC_REPORT_OF_FUNCTIONS}
    for n in range(5):
        writer.row("esc_status", n / 10, 0, 3.0 + n, 104, 0, 4.0, 101)
    found = recorded(writer).esc_currents
    assert {motor: each.value[0] for motor, each in found.items()} == {0: 4.0, 3: 3.0}


def batteries(switch: int) -> Writer:
    writer = Writer(parameters={"CAL_MAG_COMP_TYP": switch})
    for n in range(20):
        writer.row("battery_status", n / 5, 12.0, 10.0 + n, instance=0)
        writer.row("battery_status", n / 5, 24.0, 50.0 + n, instance=1)
    return writer


@pytest.mark.parametrize(("switch", "battery", "first"), [(0, 0, 10.0), (2, 0, 10.0), (3, 1, 50.0)])
def test_the_battery_is_the_one_the_vehicle_multiplies(recorded, switch, battery, first) -> None:
    found = recorded(batteries(switch))
    assert found.battery == battery
    assert found.current.value[0] == first
    assert list(found.other_currents) == [1 - battery]


def test_a_first_battery_without_a_sensor_leaves_the_second(recorded) -> None:
    writer = Writer(parameters={"CAL_MAG_COMP_TYP": 0})
    for n in range(20):
        writer.row("battery_status", n / 5, 12.0, -1.0, instance=0)
        writer.row("battery_status", n / 5, 24.0, 50.0 + n, instance=1)
    found = recorded(writer)
    assert (found.battery, found.other_currents) == (1, {})
    assert found.voltage.value[0] == 24.0


@pytest.mark.parametrize(
    ("release", "first"), [(0x010D00FF, 0.7), (0x010F02FF, 0.5), (0x00000000, 0.7)]
)
def test_the_throttle_is_what_this_firmware_multiplies(recorded, release: int, first) -> None:
    writer = Writer(release=release)
    for n in range(20):
        writer.row("vehicle_status", n / 10, 2 if n < 10 else 1, 1)
        writer.row("vehicle_thrust_setpoint", n / 10, 0.3, 0.0, -0.4)
        writer.row("actuator_controls_0", n / 10, 0.0, 0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 0.0)
    found = recorded(writer)
    assert found.throttle.value[0] == pytest.approx(first, rel=1e-6)
    assert found.throttle.value[-1] == 0.0


def test_the_outputs_are_those_of_the_instance_that_moves(recorded) -> None:
    writer = Writer()
    for n in range(10):
        still, moving = [1500.0] * 16, [1100.0 + 10 * n] * 4 + [0.0] * 12
        writer.row("actuator_outputs", n / 10, 16, *still, instance=0)
        writer.row("actuator_outputs", n / 10, 16, *moving, instance=1)
    found = recorded(writer)
    assert found.outputs.value[3, :5].tolist() == [1130.0, 1130.0, 1130.0, 1130.0, 0.0]


def test_motors_that_are_not_there_are_not_driven(recorded) -> None:
    writer = Writer()
    writer.row("actuator_motors", 0.0, 0.25, 0.5, *[float("nan")] * 10)
    found = recorded(writer)
    assert found.outputs.value[0, :3].tolist() == [1250.0, 1500.0, 0.0]


# --- parameters ----------------------------------------------------------------------------------


def test_parameters_have_their_first_value_and_each_later_one(recorded) -> None:
    writer = short_flight(2)
    writer.set("CAL_MAG0_XCOMP", 3.5)
    writer.row("battery_status", 2.5, 12.0, 1.0)
    parameters = recorded(writer).parameters
    assert parameters.whole
    assert parameters.at("CAL_MAG0_XCOMP", 0.0, 9.0) == 0.0
    assert parameters.last("CAL_MAG0_XCOMP", 9.0) == 3.5
    assert parameters.last("CAL_MAG1_ROT", 9.0) == 10.0


# --- what is in the file -------------------------------------------------------------------------


def test_what_is_appended_after_a_crash_is_read(recorded) -> None:
    writer = short_flight(2)
    whole = writer.binary()
    broken = message("D", b"\x00\x00" + bytes(20))[:9]
    later = Writer()
    later.row("battery_status", 9.0, 12.0, 77.0)
    writer.appended_at = len(whole) + len(broken)
    found = recorded(writer.binary() + broken + b"".join(later._rows))
    assert found.current.value[0] == 5.0
    assert found.current.value[-1] == 77.0


def test_dropouts_and_sync_marks_are_stepped_over(recorded) -> None:
    writer = short_flight(1)
    writer.raw(message("O", struct.pack("<H", 400)))
    writer.raw(message("S", SYNC))
    writer.row("battery_status", 3.0, 12.0, 44.0)
    assert recorded(writer).current.value[-1] == 44.0


def test_rows_of_another_day_and_out_of_order_do_not_spoil_the_time(recorded) -> None:
    writer = short_flight(2)
    writer.row("battery_status", 9e8, 12.0, 1.0)
    writer.row("battery_status", 1.05, 12.0, 33.0)
    found = recorded(writer)
    assert found.duration_s < 3.0
    assert (np.diff(found.current.time) >= 0).all()
    assert 33.0 in found.current.value


def test_what_was_said_before_the_log_does_not_move_its_beginning(recorded) -> None:
    writer = short_flight(2)
    writer.row("vehicle_gps_position", -4.0, 0, 473_977_420, 85_455_940, 488_000, 3)
    found = recorded(writer)
    assert found.duration_s == pytest.approx(1.9)
    assert found.field[1].time[0] == 0.0


def test_a_log_that_does_not_say_when_it_began_begins_with_its_messages(recorded) -> None:
    began = len(MAGIC)
    data = short_flight(2).binary()
    found = recorded(data[:began] + bytes(8) + data[began + 8 :])
    assert found.duration_s == pytest.approx(1.9)


@pytest.mark.parametrize("path", [*RECORDINGS, *REAL], ids=lambda path: path.stem)
def test_every_wanted_field_is_what_the_reference_reads(path: Path) -> None:
    found, reference = read(path), ULog(str(path))
    numbers = {compass.device_id: compass.slot for compass in found.vehicle.compasses}
    for topic in reference.data_list:
        raw = topic.name == "sensor_mag"
        if topic.name not in ("sensor_mag", "vehicle_magnetometer"):
            continue
        fields = "xyz" if raw else [f"magnetometer_ga[{axis}]" for axis in range(3)]
        for device in np.unique(topic.data.get("device_id", [])).tolist():
            number = numbers.get(device)
            if number is None or raw is not (number in found.raw_compasses):
                continue
            rows = topic.data["device_id"] == device
            strength = np.sqrt(sum(topic.data[each][rows].astype(float) ** 2 for each in fields))
            series = found.field[number]
            stamps = topic.data["timestamp_sample"][rows].astype(np.int64)
            ours = np.rint(series.time * 1e6).astype(np.int64)
            # Of a damaged log this finds what the reference finds, and sometimes more.
            place = np.searchsorted(ours, stamps - stamps[-1] + ours[-1])
            assert np.array_equal(ours[place] - ours[-1], stamps - stamps[-1])
            assert np.allclose(np.linalg.norm(series.value[place], axis=1), 1000 * strength)
            assert reference.file_corruption or len(series) == len(stamps)
    for name, value in reference.initial_parameters.items():
        assert found.parameters.of(name)[0].value == value


# --- damage --------------------------------------------------------------------------------------

WHOLE = short_flight(2).binary()


def survives(path: Path, data: bytes) -> None:
    """A recording, or one sentence of ours that names the file."""
    path.write_bytes(data)
    said = f"{path} in one line"
    try:
        read_ulog(path)
    except InputError as error:
        said = str(error)
    assert str(path) in said
    assert "\n" not in said


changes = st.lists(
    st.one_of(
        st.tuples(st.just("set"), st.integers(0, len(WHOLE) - 1), st.integers(0, 255)),
        st.tuples(st.just("cut"), st.integers(0, len(WHOLE)), st.just(0)),
        st.tuples(st.just("drop"), st.integers(0, len(WHOLE)), st.integers(1, 80)),
        st.tuples(st.just("twice"), st.integers(0, len(WHOLE)), st.integers(1, 400)),
    ),
    min_size=1,
    max_size=12,
)


LIES = [
    ("uint64_t", "float[2]"),
    ("uint64_t", "float"),
    ("uint32_t device_id", "float device_id"),
    ("float x", "char[4] x"),
    ("float ", "double "),
    ("float", "nothing"),
    ("timestamp;", "timestimp;"),
    ("uint64_t timestamp_sample", "double timestamp"),
    ("float[4] q", "float[65000] q"),
    ("float[4] q", "vehicle_attitude[4] q"),
]


@given(
    lies=st.lists(st.sampled_from(LIES), min_size=1, max_size=3),
    release=st.sampled_from([b"uint32_t ver_sw_release", b"char[4] ver_sw_release", b"\xff"]),
    date=st.sampled_from(["2024-03-01/06_46_06", "2024-99-01/06_46_06", "0000-03-01/99_99_99"]),
    kind=st.sampled_from([2, float("nan"), float("inf"), -1.5]),
)
@settings(max_examples=examples(40), suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_log_that_lies_about_what_it_holds_raises_what_is_ours(
    tmp_path: Path, lies, release, date, kind
) -> None:
    writer = short_flight(1)
    writer.said(f"[logger] /fs/microsd/log/{date}.ulg\t")
    writer.parameters["MAV_TYPE"] = kind
    forms = dict(FORMS)
    for true, lie in lies:
        forms = {name: form.replace(true, lie) for name, form in forms.items()}
    writer.forms = forms
    body = bytes([len(release)]) + release + struct.pack("<I", 0x010F02FF)
    survives(tmp_path / "lies.ulg", writer.binary() + message("I", body))


def changed(data: bytes, edits: list[tuple[str, int, int]]) -> bytes:
    for kind, at, how in edits:
        match kind:
            case "set":
                data = data[:at] + bytes([how]) + data[at + 1 :]
            case "cut":
                data = data[:at]
            case "drop":
                data = data[:at] + data[at + how :]
            case _:
                data = data[: at + how] + data[at:]
    return data


@settings(max_examples=examples(60), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(edits=changes)
def test_no_damage_raises_what_is_not_ours(tmp_path: Path, capsys, edits) -> None:
    survives(tmp_path / "bad.ulg", changed(WHOLE, edits))
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    "forms",
    [
        {"esc_status": "uint64_t timestamp;float[2000000000] x;"},
        {"esc_status": "uint64_t timestamp;esc_status[9] x;"},
        {"esc_status": "a[900] x;", "a": "b[900] x;", "b": "c[900] x;", "c": "float x;"},
        {"esc_status": "n0 x;", **{f"n{n}": f"n{n + 1} x;" for n in range(3000)}},
        {"esc_status": "uint64_t timestamp;float[60000] x;"},
    ],
    ids=["long", "inside itself", "one in the other", "deep", "long for a message"],
)
def test_a_topic_longer_than_any_message_is_left_out_before_it_fills_the_memory(
    recorded, forms: dict[str, str]
) -> None:
    writer = short_flight(1)
    writer.forms = {**FORMS, **forms}
    for number in range(900, 1900):
        row = message("D", struct.pack("<H", number) + bytes(40))
        begin = message("A", struct.pack("<BH", 0, number) + b"esc_status")
        writer._rows[:0] = [begin, row]
    assert len(recorded(writer).field[1]) == 10


@pytest.mark.parametrize("filling", [b"\0", b"\xff", b"F\x01\0", SYNC])
def test_a_megabyte_of_nonsense_ends_soon(tmp_path: Path, filling: bytes) -> None:
    data = WHOLE[:400] + filling * (1_000_000 // len(filling))
    survives(tmp_path / "nonsense.ulg", data)


def test_a_log_that_ends_after_its_header_is_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "short.ulg"
    path.write_bytes(Writer().binary())
    with pytest.raises(LogError, match="without one of those needed"):
        read_ulog(path)
