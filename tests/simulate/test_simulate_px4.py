"""The simulated PX4 says what real PX4 says on a link, at the same rates, and means the same."""

from __future__ import annotations

import gzip
import struct
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from px4_truth import RECORDINGS
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.autopilots.px4_correction import correct, stored
from magcomp.autopilots.px4_rotation import sensor_to_body
from magcomp.mavlink.header import payload
from magcomp.mavlink.messages import WANTED
from magcomp.mavlink.parameters import decode_param_value
from magcomp.mavlink.parameters import encoding as encoding_of
from magcomp.mavlink.records import record as record_of
from magcomp.mavlink.splitter import Splitter
from magcomp.simulate import Vehicle, record, scenario
from magcomp.simulate.ground import PX4_RATES, Asker
from magcomp.simulate.px4.streams import DEFAULT_RATES, ON_REQUEST
from magcomp.sources import read
from magcomp.sources.truth import read_truth

FIXTURES = Path(__file__).parents[2] / "sitl_fixtures"
ASKED_AT_S = 20.0
HOW = encoding_of("px4")

LEFT_OUT = {
    # Of another message set than magcomp's, or of parts of a vehicle that is not simulated.
    "OPEN_DRONE_ID_LOCATION",
    "OPEN_DRONE_ID_SYSTEM",
    "POSITION_TARGET_LOCAL_NED",
    "POSITION_TARGET_GLOBAL_INT",
    "HOME_POSITION",
    "VIBRATION",
    "MISSION_CURRENT",
    "GPS_GLOBAL_ORIGIN",
}


class Heard:
    """What a vehicle said: (seconds, message) by name."""

    def __init__(self, frames):
        codec = mavlink.MAVLink(None)
        self.by_name = defaultdict(list)
        for time, data in frames:
            try:
                message = codec.decode(bytearray(data))
            except mavlink.MAVError:
                continue  # a message that this dialect does not have
            if message.get_srcSystem() == 1 and not message.get_type().startswith("UNKNOWN"):
                self.by_name[message.get_type()].append((time, message))

    def rate(self, name):
        times = [time for time, _ in self.by_name[name]]
        return (len(times) - 1) / (times[-1] - times[0])

    def column(self, name, *fields):
        return np.array([[getattr(m, field) for field in fields] for _, m in self.by_name[name]])

    @property
    def parameters(self):
        told = [payload(bytes(m.get_msgbuf())) for _, m in self.by_name["PARAM_VALUE"]]
        return [decode_param_value(each, HOW) for each in told]


def real_frames(data):
    splitter, place, begin = Splitter(), 0, None
    while place + 8 < len(data):
        (stamp,) = struct.unpack(">Q", data[place : place + 8])
        length = 12 + data[place + 9] + 13 * (data[place + 10] & 1)
        (frame,) = splitter.push(data[place + 8 : place + 8 + length])
        begin = stamp if begin is None else begin
        yield (stamp - begin) * 1e-6, frame
        place += 8 + length


@pytest.fixture(scope="module")
def real():
    frames = list(real_frames(gzip.decompress((FIXTURES / "px4_link.tlog.gz").read_bytes())))
    return Heard(f for f in frames if f[0] < ASKED_AT_S), Heard(
        f for f in frames if f[0] >= ASKED_AT_S
    )


@pytest.fixture(scope="module")
def simulated():
    """Unasked for ten seconds, and asked as the real one was."""
    plain = Vehicle(scenario("parked", 1), autopilot="px4")
    plain.receive(Asker().parameter_list(), 0.0)
    asked = Vehicle(scenario("parked", 1), autopilot="px4")
    return Heard(plain.advance(10.0)), Heard(record(asked, seconds=10.0, rates=PX4_RATES))


def test_unasked_it_sends_what_a_telemetry_radio_gets_and_no_compass(real, simulated):
    said, says = set(real[0].by_name), set(simulated[0].by_name)
    assert said - says - LEFT_OUT == {"COMMAND_ACK", "AUTOPILOT_VERSION", "STATUSTEXT"}
    assert says <= said
    assert not {mavlink.mavlink_map[number].msgname for number in ON_REQUEST} & says


@pytest.mark.parametrize("number", [n for n, hertz in DEFAULT_RATES.items() if hertz > 0.1])
def test_unasked_messages_come_as_often_as_real_ones(real, simulated, number):
    name = mavlink.mavlink_map[number].msgname
    assert simulated[0].rate(name) == pytest.approx(real[0].rate(name), rel=0.1)


@pytest.mark.parametrize("number", PX4_RATES)
def test_asked_for_they_come_as_often_as_real_ones(real, simulated, number):
    name = mavlink.mavlink_map[number].msgname
    # The firmware's loop makes every interval a little longer than was asked for.
    assert simulated[1].rate(name) == pytest.approx(real[1].rate(name), rel=0.12)


def test_it_has_the_real_parameters_with_their_types_and_indices(real, simulated):
    def listed(heard):
        return [(p.name, p.type, p.index, p.count) for p in heard.parameters]

    assert listed(simulated[0]) == listed(real[0])
    assert listed(real[0])[0] == ("_HASH_CHECK", 5, 65535, 865)


def test_who_it_is_reads_as_of_the_real_one(real):
    vehicle = Vehicle(scenario("parked", 1), autopilot="px4")
    vehicle.receive(Asker().command(mavlink.MAV_CMD_REQUEST_MESSAGE, 148), 1.0)
    heard = Heard(vehicle.advance(2.0))
    said = [(name, heard.by_name[name][0][1]) for name in ("AUTOPILOT_VERSION", "COMMAND_ACK")]
    (_, version), (_, answer) = said
    (_, real_version), _ = (real[0].by_name[name][0] for name in ("AUTOPILOT_VERSION", "HEARTBEAT"))
    assert version.capabilities == real_version.capabilities
    assert version.flight_sw_version == real_version.flight_sw_version
    assert (answer.command, answer.result) == (512, 0)
    (_, beat), real_beat = heard.by_name["HEARTBEAT"][0], real[0].by_name["HEARTBEAT"][-1][1]
    for field in ("type", "autopilot", "base_mode", "system_status"):
        known = {"base_mode": 81}.get(field, getattr(real_beat, field))
        assert getattr(beat, field) == known


def at_rest(heard):
    """The first compass by both of its messages, body axes, mGauss: corrected here, and there."""
    values = {p.name: p.value for p in heard.parameters}
    raw = heard.column("SCALED_IMU", "xmag", "ymag", "zmag")
    said = 1000.0 * heard.column("HIGHRES_IMU", "xmag", "ymag", "zmag")
    raw = raw + 0.5 * np.sign(raw)  # whole numbers, cut towards zero
    turned = correct(raw / 1000.0, np.zeros(len(raw)), stored(values, 1))
    here = 1000.0 * turned @ sensor_to_body(values, 1).T
    return here.mean(axis=0), said[5:].mean(axis=0), raw.std(axis=0)


def test_scaled_imu_is_the_sensor_and_highres_imu_the_corrected_compass(real, simulated):
    still = Heard([])
    for name, said in real[1].by_name.items():
        still.by_name[name] = [each for each in said if each[0] < ASKED_AT_S + 1.0]
    still.by_name["PARAM_VALUE"] = real[0].by_name["PARAM_VALUE"]
    for heard in (still, simulated[1]):
        here, there, noise = at_rest(heard)
        assert here == pytest.approx(there, abs=4.0)
        assert np.all((noise > 1.5) & (noise < 6.0))


def test_only_the_first_imu_speaks_and_a_new_reading_comes_with_nearly_every_message(
    real, simulated
):
    for heard in (real[1], simulated[1]):
        for name in ("SCALED_IMU2", "SCALED_IMU3"):
            assert not heard.column(name, "xacc", "yacc", "zacc", "xgyro").any()
        assert (np.diff(heard.column("SCALED_IMU", "xmag", "ymag", "zmag"), axis=0) != 0).any(
            axis=1
        ).mean() > 0.9
        corrected = np.diff(heard.column("HIGHRES_IMU", "xmag"), axis=0)
        assert 0.2 < (corrected == 0.0).mean() < 0.6


def test_the_third_compass_is_turned_as_in_the_recording(simulated):
    values = {p.name: p.value for p in simulated[1].parameters}
    assert values["CAL_MAG2_ROT"] == 10.0
    assert sensor_to_body(values, 3) @ np.array([1.0, 2.0, 3.0]) == pytest.approx([2.0, 1.0, -3.0])


def test_asked_for_the_truth_it_says_how_it_really_stands_and_no_fit_sees_it(tmp_path):
    rates = {mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION: 20.0}
    vehicle = Vehicle(scenario("flight", 3), autopilot="px4", start_unix_s=1.7e9)
    path = tmp_path / "px4.tlog"
    frames = record(vehicle, seconds=30.0, rates=rates)
    path.write_bytes(b"".join(record_of(int((1.7e9 + f.time) * 1e6), f.data) for f in frames))
    truth, recording = read_truth(path), read(path)
    for axis in range(2):
        believed = recording.attitude.value[:, axis]
        said = np.interp(truth.attitude.time, recording.attitude.time, believed)
        error = said - truth.attitude.value[:, axis]
        assert np.degrees(np.median(np.abs(error))) < 0.5 < np.degrees(np.ptp(said))
    here = recording.position.value.mean(axis=0)[:2]
    assert truth.position.value.mean(axis=0) == pytest.approx(here, abs=1e-3)
    assert mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION not in WANTED


IN_THE_AIR = (60.0, 120.0)
NOT_SIMULATED = {
    # The recordings' battery is fed over MAVLink (their README); its voltage and charge stand.
    *(("BATTERY_STATUS", each) for each in ("id", "temperature", "voltages", "time_remaining")),
    *(("BATTERY_STATUS", each) for each in ("current_consumed", "battery_remaining")),
    *(("SYS_STATUS", each) for each in ("voltage_battery", "battery_remaining")),
    # Which parts a vehicle has, and how well its receiver and its estimator say that they do.
    *(("SYS_STATUS", f"onboard_control_sensors_{each}") for each in ("present", "health")),
    ("SYS_STATUS", "onboard_control_sensors_health_extended"),
    ("ESTIMATOR_STATUS", "flags"),
    *(("GPS_RAW_INT", each) for each in ("h_acc", "v_acc", "vel_acc")),
}


def in_the_air(frames):
    return Heard(f for f in frames if IN_THE_AIR[0] <= f[0] < IN_THE_AIR[1])


@pytest.fixture(scope="module", params=["flight", "flight_default_rates"])
def flights(request):
    """A real one as its link told it, whole, and a simulated one asked for the same rates."""
    path = RECORDINGS / f"{request.param}.tlog"
    if not path.exists():
        pytest.skip("the shared recordings are not there")
    rates = PX4_RATES if request.param == "flight" else {}
    flown = record(
        Vehicle(scenario("flight", 1), autopilot="px4"), seconds=IN_THE_AIR[1], rates=rates
    )
    return in_the_air(real_frames(path.read_bytes())), in_the_air(flown)


def test_in_the_air_the_same_messages_come_as_often(flights):
    real, simulated = flights
    assert set(real.by_name) - set(simulated.by_name) <= LEFT_OUT
    assert set(simulated.by_name) <= set(real.by_name)
    often = [name for name, said in simulated.by_name.items() if len(said) > 20]
    assert len(often) > 10
    for name in often:
        assert simulated.rate(name) == pytest.approx(real.rate(name), rel=0.1), name


def test_in_the_air_what_never_changes_is_the_same(flights):
    """Modes, masks, units, unused outputs and what stands where a value is not known."""

    def lasting(heard, name, field):
        values = {str(getattr(message, field)) for _, message in heard.by_name[name]}
        return values.pop() if len(values) == 1 else None

    real, simulated = flights
    for name in set(real.by_name) - LEFT_OUT:
        for field in real.by_name[name][0][1].fieldnames:
            expected = lasting(real, name, field)
            if expected is not None and (name, field) not in NOT_SIMULATED:
                assert lasting(simulated, name, field) == expected, (name, field)
