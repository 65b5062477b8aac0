"""Frames of both versions, cut and read as pymavlink makes them."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.generator.mavcrc import x25crc

from magcomp.mavlink import header
from magcomp.mavlink.records import STAMP_SIZE, chain, record, records
from magcomp.mavlink.splitter import Splitter
from magcomp.mavlink.stream import is_sound, is_unstamped

KEY = bytes(range(32))
STAMP_US = 1_700_000_000_000_000


def made(
    system: int, component: int, sequence: int, version: int, signed: bool, message: Any
) -> bytes:
    sender = mavlink.MAVLink(None, system, component)
    sender.seq = sequence
    if signed:
        sender.signing.secret_key, sender.signing.sign_outgoing = KEY, True
        sender.signing.link_id, sender.signing.timestamp = 7, 12_345_678_901
    return bytes(message.pack(sender, force_mavlink1=version == 1))


byte = st.integers(0, 255)
messages = st.one_of(
    st.builds(mavlink.MAVLink_heartbeat_message, byte, byte, byte, st.just(0), byte, byte),
    st.builds(
        mavlink.MAVLink_attitude_message,
        st.integers(0, 2**32 - 1),
        *[st.floats(width=32, allow_nan=False)] * 6,
    ),
    st.builds(mavlink.MAVLink_statustext_message, byte, st.binary(max_size=50)),
)
frames = st.builds(made, byte, byte, byte, st.sampled_from([1, 2]), st.booleans(), messages)
noise = st.one_of(st.binary(max_size=30), st.lists(st.sampled_from([0, 0xFD, 0xFE])).map(bytes))


@given(frames)
def test_a_header_says_what_pymavlink_reads_in_it(frame: bytes) -> None:
    theirs = mavlink.MAVLink(None).decode(bytearray(frame))
    assert header.message_id(frame) == theirs.get_msgId()
    assert header.source(frame) == (theirs.get_srcSystem(), theirs.get_srcComponent())
    assert header.sequence(frame) == theirs.get_seq()
    assert header.is_signed(frame) == bool(theirs.get_header().incompat_flags & 1)
    assert header.frame_length(frame, 0) == len(frame)
    assert header.is_version_1(frame) == (frame[0] == 0xFE)


@given(frames)
def test_the_payload_is_what_lies_between_header_and_checksum(frame: bytes) -> None:
    extra = mavlink.mavlink_map[header.message_id(frame)].crc_extra
    payload = header.payload(frame)
    begin = frame.index(payload, 6 if frame[0] == 0xFE else 10)
    covered = frame[1 : begin + len(payload)]
    crc = x25crc(bytearray(covered) + bytes([extra])).crc.to_bytes(2, "little")
    assert frame[begin + len(payload) :][:2] == crc
    assert len(payload) == frame[1]


@given(frames.filter(header.is_signed))
def test_a_signature_is_taken_apart(frame: bytes) -> None:
    signature = header.signature(frame)
    assert (signature.link, signature.time) == (7, 12_345_678_901)
    assert signature.covered + signature.digest == frame
    assert len(signature.digest) == 6


@pytest.mark.parametrize(
    ("data", "length"),
    [
        (b"", None),
        (b"\xfd\x09", None),
        (b"\xfe\x09\x00", 17),
        (b"\xfd\x09\x00", 21),
        (b"\xfd\x09\x01", 34),
        (b"\xfd\x09\x02", 0),
        (b"\xfd\x09\x81", 0),
        (b"\x55\x09\x00", 0),
        (b"\xff\x09\x00", 0),
        (b"\xfc\x09\x00", 0),
    ],
)
def test_the_length_of_a_frame_stands_in_its_first_three_bytes(
    data: bytes, length: int | None
) -> None:
    assert header.frame_length(data, 0) == length
    assert header.frame_length(b"??" + data, 2) == length


@given(st.lists(frames), st.data())
def test_a_stream_is_cut_into_its_frames_however_it_arrives(
    sent: list[bytes], draw: st.DataObject
) -> None:
    splitter, data, got = Splitter(), b"".join(sent), []
    while data:
        size = draw.draw(st.integers(1, len(data)))
        got += splitter.push(data[:size])
        data = data[size:]
    assert got == sent


@given(frames, st.binary(max_size=40).filter(lambda b: not {0xFD, 0xFE} & {*b}))
def test_a_stream_passes_over_what_is_no_frame(frame: bytes, between: bytes) -> None:
    unknown_flag = b"\xfd\x01\x02"
    data = between + unknown_flag + between + frame + between + frame
    assert Splitter().push(data) == [frame, frame]


@given(st.lists(frames))
def test_records_come_back_as_they_were_written(sent: list[bytes]) -> None:
    data = b"".join(record(STAMP_US + n, frame) for n, frame in enumerate(sent))
    assert list(records(data)) == [(STAMP_US + n, frame) for n, frame in enumerate(sent)]
    assert [frame for _, frame in chain(data)] == sent
    assert b"".join(whole for whole, _ in chain(data)) == data


@given(frames, frames, st.binary(max_size=40).filter(lambda b: not {0xFD, 0xFE} & {*b}))
def test_records_are_found_behind_noise_and_half_a_record_is_none(
    first: bytes, second: bytes, before: bytes
) -> None:
    data = before + record(STAMP_US, first) + record(STAMP_US, second)[:-1]
    assert list(records(data)) == [(STAMP_US, first)]


@given(st.lists(noise).map(b"".join))
def test_whatever_is_cut_out_of_any_bytes_stands_in_them_in_this_order(data: bytes) -> None:
    for pieces in (Splitter().push(data), [record(*found) for found in records(data)]):
        position = 0
        for piece in pieces:
            position = data.index(piece, position) + len(piece)
    assert is_unstamped(data) is False


@given(frames, st.data())
def test_a_frame_is_sound_until_a_bit_of_it_turns(frame: bytes, draw: st.DataObject) -> None:
    assert is_sound(frame)
    end = len(frame) - (13 if header.is_signed(frame) else 0)
    bit = draw.draw(st.integers(8 * 3, 8 * end - 1))
    damaged = bytearray(frame)
    damaged[bit // 8] ^= 1 << bit % 8
    assert not is_sound(bytes(damaged))


@given(st.lists(frames, min_size=3, max_size=8))
def test_frames_without_times_between_them_are_told_from_a_log(sent: list[bytes]) -> None:
    assert is_unstamped(b"".join(sent))
    assert not is_unstamped(b"".join(sent[:2]))
    assert not is_unstamped(b"".join(record(STAMP_US, frame) for frame in sent))


def test_the_stamp_is_eight_bytes_big_endian() -> None:
    assert record(0x0102030405060708, b"") == bytes(range(1, 9))
    assert STAMP_SIZE == 8
