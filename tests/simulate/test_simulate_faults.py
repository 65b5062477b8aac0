"""Every fault a real link has, on a switch, and the same each time for one seed."""

from __future__ import annotations

import itertools

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.errors import UsageError
from magcomp.mavlink.header import message_id
from magcomp.simulate import Faults, FaultyLink, Vehicle, scenario
from magcomp.simulate.ground import Asker

RAW_IMU = mavlink.MAVLINK_MSG_ID_RAW_IMU
PARAM_VALUE = mavlink.MAVLINK_MSG_ID_PARAM_VALUE


def linked(faults, seed=0):
    return FaultyLink(Vehicle(scenario("sweep", 1)), faults, seed)


def streamed(faults, seed=0, seconds=40.0):
    """Frames of a 50 Hz stream that reach the ground."""
    vehicle = Vehicle(scenario("sweep", 1))
    vehicle.receive(Asker().rate(RAW_IMU, 50.0), 0.0)
    link = FaultyLink(vehicle, faults, seed)
    frames = []
    for tick in range(int(seconds * 20)):
        frames += link.advance(tick / 20.0)
    return [f for f in frames if f.data[7:10] == RAW_IMU.to_bytes(3, "little")]


def set_motor(link, time, value):
    message = mavlink.MAVLink_param_set_message(1, 1, b"COMPASS_MOT_Y", value, 9)
    link.receive(Asker().pack(message), time)


def echoes(link, time):
    return [f for f in link.advance(time) if message_id(f.data) == PARAM_VALUE]


def test_a_link_without_faults_changes_nothing():
    plain = Vehicle(scenario("sweep", 1))
    plain.receive(Asker().parameter_list(), 0.0)
    link = linked(Faults())
    link.receive(Asker().parameter_list(), 0.0)
    assert link.advance(5.0) == plain.advance(5.0)


@pytest.mark.parametrize("loss", [0.1, 0.3])
def test_loss_takes_its_share_of_the_frames(loss):
    assert len(streamed(Faults(loss=loss))) == pytest.approx(2000 * (1 - loss), rel=0.06)


def test_loss_takes_frames_from_the_ground_too():
    vehicle = Vehicle(scenario("sweep", 1))
    link = FaultyLink(vehicle, Faults(loss=1.0))
    set_motor(link, 0.0, 2.0)
    link.advance(1.0)
    assert vehicle.parameters["COMPASS_MOT_Y"] == 0.0


def test_duplication_repeats_frames_byte_for_byte():
    frames = streamed(Faults(duplication=0.25))
    assert len(frames) == pytest.approx(2500, rel=0.05)
    assert len({f.data for f in frames}) == pytest.approx(2000, rel=0.02)


def test_reordering_brings_some_frames_after_their_followers():
    numbers = [f.data[4] for f in streamed(Faults(reordering=0.1))]
    backwards = sum((b - a) % 256 > 128 for a, b in itertools.pairwise(numbers))
    assert backwards == pytest.approx(200, rel=0.3)


def test_corruption_turns_one_bit_over():
    sound = {f.time: f.data for f in streamed(Faults())}
    spoiled = {f.time: f.data for f in streamed(Faults(corruption=0.3))}
    flipped = [
        sum((a ^ b).bit_count() for a, b in zip(sound[t], data, strict=True))
        for t, data in spoiled.items()
        if t in sound and data != sound[t] and data[4] == sound[t][4]
    ]
    assert len(flipped) > 300
    assert set(flipped) == {1}


def test_a_corrupted_set_is_not_obeyed():
    vehicle = Vehicle(scenario("sweep", 1))
    link = FaultyLink(vehicle, Faults(corruption=1.0))
    for k in range(50):
        set_motor(link, 0.1 * k, 2.0)
    link.advance(10.0)
    assert vehicle.parameters["COMPASS_MOT_Y"] == 0.0


def test_latency_delays_both_ways():
    link = linked(Faults(latency_s=0.2))
    set_motor(link, 1.0, 2.0)
    assert echoes(link, 1.39) == []
    [echo] = echoes(link, 1.45)
    assert echo.time == pytest.approx(1.4, abs=0.011)


def test_at_the_chosen_message_the_link_dies_and_stays_dead():
    vehicle = Vehicle(scenario("sweep", 1))
    link = FaultyLink(vehicle, Faults(dead_at=3))
    set_motor(link, 0.0, 1.0)
    assert len(echoes(link, 0.5)) == 1
    set_motor(link, 0.5, 2.0)
    set_motor(link, 0.6, 3.0)
    assert link.advance(5.0) == []
    assert vehicle.parameters["COMPASS_MOT_Y"] == 1.0


def test_the_link_can_die_between_a_set_and_its_echo():
    vehicle = Vehicle(scenario("sweep", 1))
    link = FaultyLink(vehicle, Faults(dead_at=2))
    set_motor(link, 0.0, 1.0)
    assert echoes(link, 0.5) == []
    assert vehicle.parameters["COMPASS_MOT_Y"] == 1.0


def test_heartbeats_and_telemetry_are_not_counted():
    link = linked(Faults())
    link.advance(30.0)
    assert link.counted == 0


@pytest.mark.parametrize(("number", "stored"), [(1, 0.0), (2, 1.0)])
def test_at_the_chosen_message_the_vehicle_reboots_and_keeps_what_it_stored(number, stored):
    vehicle = Vehicle(scenario("sweep", 1))
    link = FaultyLink(vehicle, Faults(reboot_at=number))
    link.advance(1.0)
    set_motor(link, 1.0, 1.0)
    assert echoes(link, 1.5) == []
    assert vehicle.parameters["COMPASS_MOT_Y"] == stored
    later = link.advance(6.0)
    assert message_id(later[0].data) == mavlink.MAVLINK_MSG_ID_HEARTBEAT
    assert later[0].time > 2.4
    set_motor(link, 6.0, 5.0)
    assert len(echoes(link, 6.5)) == 1


def test_faults_are_the_same_for_the_same_seed():
    faults = Faults(loss=0.2, duplication=0.1, reordering=0.1, corruption=0.1, latency_s=0.05)
    first, second, other = (streamed(faults, seed, 5.0) for seed in (1, 1, 2))
    assert first == second != other


@pytest.mark.parametrize(
    "wrong", [{"loss": -0.1}, {"corruption": 1.5}, {"latency_s": -1.0}, {"loss": float("nan")}]
)
def test_impossible_faults_are_refused(wrong):
    with pytest.raises(UsageError, match="instead received"):
        Faults(**wrong)
