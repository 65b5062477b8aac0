"""Whatever arrives: no exception escapes, and nothing is written to a vehicle because of it."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from effort import examples
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from link_vehicle import FakeVehicle, play
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.buffer import Buffer
from magcomp.link.replay import records
from magcomp.link.state import LinkState

FIXTURE = Path(__file__).parents[2] / "sitl_fixtures" / "flight.tlog"
FRAMES = 120_000
HARMLESS = {"HEARTBEAT", "TIMESYNC", "PARAM_REQUEST_READ"}
STREAMS = {"REQUEST_DATA_STREAM"}
QUESTIONS = {mavlink.MAV_CMD_REQUEST_MESSAGE}
INTERVALS = {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_GET_MESSAGE_INTERVAL}


def assert_planned(messages, *, streams=False):
    """Only heartbeats, questions and, where asked for, stream rates may ever go out."""
    for message in messages:
        kind = message.get_type()
        if kind == "COMMAND_LONG":
            assert message.command in (QUESTIONS | INTERVALS if streams else QUESTIONS)
        else:
            assert kind in (HARMLESS | STREAMS if streams else HARMLESS)


def random_message(chance):
    """A message of any kind, its fields filled with any bytes that fit."""
    kind = chance.choice(list(mavlink.mavlink_map.values()))
    payload = chance.randbytes(kind.unpacker.size)
    return kind, payload


class AnyFrame:
    """Sound frames of random messages: right checksum, any content, any sender."""

    def __init__(self, seed):
        self.chance = random.Random(seed)
        self.sequence = 0

    def __call__(self):
        chance = self.chance
        kind, payload = random_message(chance)
        self.sequence = (self.sequence + chance.choice((1, 1, 1, 2, 200))) % 256
        system, component = chance.choice(((1, 1), (1, 1), (1, 154), (2, 1), (255, 190)))
        header = bytes((len(payload), 0, 0, self.sequence, system, component))
        body = header + kind.id.to_bytes(3, "little") + payload
        crc = mavlink.x25crc(body)
        crc.accumulate(bytes((kind.crc_extra,)))
        return b"\xfd" + body + crc.crc.to_bytes(2, "little")


def mutated(chance, frame):
    """A frame with bits turned, bytes lost or put in, or another one's tail."""
    data = bytearray(frame)
    for _ in range(chance.randint(0, 3)):
        at = chance.randrange(len(data))
        action = chance.randrange(4)
        if action == 0:
            data[at] ^= 1 << chance.randrange(8)
        elif action == 1:
            del data[at:]
        elif action == 2:
            data[at:at] = chance.randbytes(chance.randint(1, 9))
        else:
            data[at] = chance.choice((0xFD, 0xFE, 0x00, 0xFF))
        if not data:
            return b""
    return bytes(data)


@pytest.fixture(scope="module")
def recorded():
    return [frame for _, frame in records(FIXTURE.read_bytes())]


@pytest.mark.parametrize("streams", [False, True], ids=["listening", "streaming"])
def test_a_hundred_thousand_random_and_damaged_frames_do_no_harm(recorded, streams):
    chance = random.Random(20)
    any_frame = AnyFrame(21)
    state, buffer = LinkState(system=1), Buffer("fuzz", limit=1 << 18)
    play(state, [FakeVehicle()], 0.0, 2.0)
    if streams:
        state.request_streams({"RAW_IMU": 50.0, "ATTITUDE": 50.0}, 2.0)
    now, frames, understood = 2.0, 0, 0
    while frames < FRAMES // 2:
        burst = b"".join(
            any_frame() if chance.random() < 0.5 else mutated(chance, chance.choice(recorded))
            for _ in range(50)
        )
        frames += 50
        now += 0.05
        for received in state.receive(burst, now):
            buffer.add(round(now * 1e6), received.frame.raw)
            understood += 1
        assert_planned(state.due(now), streams=streams)
        state.statistics(now)
        state.take_events()
    assert understood > FRAMES // 4
    assert buffer.size < 1 << 20
    buffer.coverage()


@settings(max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.lists(st.one_of(st.binary(max_size=300), st.integers(0, 2**32)), max_size=30),
    st.sampled_from([None, bytes(32)]),
    st.sampled_from([None, 1, 7]),
)
def test_any_bytes_in_any_pieces_do_no_harm(pieces, key, system):
    state, now = LinkState(system=system, key=key), 0.0
    for piece in pieces:
        data = piece if isinstance(piece, bytes) else AnyFrame(piece)()
        now += 0.3
        state.receive(data, now)
        assert_planned(state.due(now))
    state.reopened(now)
    state.closed(now, "test")
    assert_planned(state.due(now + 10))


@settings(max_examples=examples(70), deadline=None)
@given(st.integers(0, 2**32), st.integers(0, 60))
def test_any_content_of_an_answer_is_an_identity(seed, length):
    vehicle, state = FakeVehicle(), LinkState(system=1)
    state.receive(vehicle.heartbeat(), 0.0)
    chance = random.Random(seed)
    for kind in ("AUTOPILOT_VERSION", "PARAM_VALUE", "STATUSTEXT", "HEARTBEAT", "TIMESYNC"):
        message = getattr(mavlink, f"MAVLink_{kind.lower()}_message")
        (number,) = [n for n, m in mavlink.mavlink_map.items() if m is message]
        payload = chance.randbytes(min(length, message.unpacker.size) or 1)
        body = bytes((len(payload), 0, 0, 1, 1, 1)) + number.to_bytes(3, "little") + payload
        crc = mavlink.x25crc(body + bytes((message.crc_extra,)))
        state.receive(b"\xfd" + body + crc.crc.to_bytes(2, "little"), 1.0)
    assert state.vehicle.system == 1
    assert all(number for number in state.vehicle.device_ids)
