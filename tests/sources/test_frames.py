"""Finding frames: every sound one is found, whatever lies between them, and no other."""

from __future__ import annotations

import numpy as np
import pytest
from effort import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.generator.mavcrc import x25crc
from tlog_writer import START_US, Sender, log, record, short_flight

from magcomp.mavlink.checksum import checksums
from magcomp.mavlink.frames import WINDOW, Frames, Scan, scan
from magcomp.mavlink.messages import WANTED, Message, crc_extra, decode, layout


def search(data: bytes, window: int = WINDOW) -> Scan:
    return scan(np.frombuffer(data, dtype=np.uint8), WANTED, crc_extra(), window=window)


def contents(data: bytes, frames: Frames) -> list[tuple[int, int, bytes]]:
    """What identifies a frame to a reader: message, sequence, payload without trailing zeros."""
    return [
        (m, s, data[p : p + n].rstrip(b"\0"))
        for m, s, p, n in zip(
            frames.message.tolist(),
            frames.sequence.tolist(),
            frames.payload.tolist(),
            frames.length.tolist(),
            strict=True,
        )
    ]


@st.composite
def sound_frames(draw: st.DrawFn) -> bytes:
    sender = Sender(
        system=draw(st.integers(1, 255)),
        component=draw(st.integers(0, 255)),
        version=draw(st.sampled_from([1, 2])),
        signed=draw(st.booleans()),
    )
    sender.link.seq = draw(st.integers(0, 255))
    number = st.integers(-32768, 32767)
    return draw(
        st.one_of(
            st.builds(sender.attitude, st.integers(0, 2**32 - 1)),
            st.builds(sender.raw_imu, st.integers(0, 2**63), st.tuples(number, number, number)),
            st.builds(sender.heartbeat),
            st.builds(sender.throttle, st.integers(0, 100)),
            st.builds(sender.parameter, st.text("ABCXYZ_", max_size=16), st.floats(width=32)),
            st.builds(sender.text, st.text("abc ", max_size=50)),
        )
    )


# 0xFD and 0xFE begin frames, 0x00 begins their times.
garbage = st.one_of(
    st.binary(max_size=60), st.lists(st.sampled_from([0, 1, 5, 0xFD, 0xFE]), max_size=60).map(bytes)
)


@settings(max_examples=examples(100), deadline=None)
@given(st.lists(st.tuples(garbage, sound_frames()), max_size=12), garbage)
def test_every_sound_frame_is_found_between_any_garbage(
    pieces: list[tuple[bytes, bytes]], tail: bytes
) -> None:
    data = b"".join(g + record(START_US + n, f) for n, (g, f) in enumerate(pieces)) + tail
    expected = [contents(alone, search(alone).frames)[0] for _, f in pieces if (alone := log([f]))]
    found = search(data)
    assert contents(data, found.frames) == expected
    assert found.verified == len(pieces)
    assert found.frames.arrival.tolist() == [START_US + n for n in range(len(pieces))]


@settings(max_examples=examples(70), deadline=None)
@given(
    st.lists(st.one_of(garbage, sound_frames().map(lambda f: record(START_US, f))), max_size=20),
    st.integers(1, 400),
)
def test_the_size_of_the_search_window_makes_no_difference(
    pieces: list[bytes], window: int
) -> None:
    data = b"".join(pieces)
    whole, parts = search(data), search(data, window)
    assert contents(data, parts.frames) == contents(data, whole.frames)
    assert (parts.verified, parts.skipped) == (whole.verified, whole.skipped)


@settings(max_examples=examples(50), deadline=None)
@given(st.binary(min_size=1, max_size=600), st.data())
def test_checksums_are_those_of_mavlink(data: bytes, draw: st.DataObject) -> None:
    spans = draw.draw(
        st.lists(
            st.integers(0, len(data)).flatmap(
                lambda a: st.tuples(st.just(a), st.integers(0, len(data) - a), st.integers(0, 255))
            ),
            max_size=20,
        )
    )
    start, length, extra = (np.array([s[k] for s in spans], dtype=np.int64) for k in range(3))
    computed = checksums(np.frombuffer(data, dtype=np.uint8), start, length, extra.astype(np.uint8))
    expected = [x25crc(bytearray(data[a : a + n]) + bytes([x])).crc for a, n, x in spans]
    assert computed.tolist() == expected


@pytest.mark.parametrize("version", [1, 2])
def test_one_flipped_bit_in_a_frame_never_passes_for_a_value(version: int) -> None:
    frames = short_flight(Sender(version=version), seconds=1)
    clean = log(frames)
    expected = contents(clean, search(clean).frames)
    victim = frames[4]
    at = clean.index(victim)
    for bit in range(len(victim) * 8):
        damaged = bytearray(clean)
        damaged[at + bit // 8] ^= 1 << bit % 8
        found = search(bytes(damaged))
        assert contents(bytes(damaged), found.frames) == expected[:4] + expected[5:]


def test_a_damaged_frame_is_counted_when_its_neighbours_confirm_that_it_was_one() -> None:
    data = bytearray(log(short_flight(Sender(), seconds=1)))
    clean = search(bytes(data))
    data[clean.frames.payload[7] + 5] ^= 0xFF
    found = search(bytes(data))
    assert found.bad_checksum == 1
    assert (found.total, found.verified) == (clean.total, clean.total - 1)
    assert found.skipped == 0


def test_bytes_that_belong_to_no_frame_are_counted() -> None:
    sender = Sender()
    noise = b"\xfd\xfe garbage \x00\x00\x05"
    data = noise + log([sender.heartbeat()]) + noise + log([sender.heartbeat()])
    assert search(data).skipped == 2 * len(noise)


def test_a_frame_of_an_unknown_message_is_passed_over_whole() -> None:
    sender = Sender()
    unknown = bytearray(sender.heartbeat())
    unknown[7:10] = (61_234).to_bytes(3, "little")
    found = search(log([sender.heartbeat(), bytes(unknown), sender.heartbeat()]))
    assert (found.total, found.verified, found.skipped) == (3, 2, 0)


def test_a_frame_with_flags_that_nobody_knows_is_not_decoded() -> None:
    frame = bytearray(Sender().heartbeat())
    frame[2] = 0x02
    crc = x25crc(bytearray(frame[1:-2]) + bytes([crc_extra()[Message.HEARTBEAT]])).crc
    frame[-2:] = crc.to_bytes(2, "little")
    assert search(log([bytes(frame)])).verified == 0


def test_a_whole_log_inside_a_frame_is_not_taken_for_frames() -> None:
    sender = Sender()
    inner = log([sender.heartbeat()])
    found = search(log([_carrying(inner), sender.heartbeat()]))
    assert found.verified == 2
    assert found.frames.message.tolist() == [Message.STATUSTEXT, Message.HEARTBEAT]


def _carrying(payload: bytes) -> bytes:
    """A STATUSTEXT whose text is arbitrary bytes."""
    body = bytes([6]) + payload.ljust(50, b"\1")
    head = bytes([len(body), 0, 0, 9, 1, 1]) + int(Message.STATUSTEXT).to_bytes(3, "little")
    crc = x25crc(bytearray(head + body) + bytes([crc_extra()[Message.STATUSTEXT]])).crc
    return b"\xfd" + head + body + crc.to_bytes(2, "little")


def test_the_zeros_that_mavlink_2_cuts_off_come_back() -> None:
    frame = Sender().servos(0, 1100)
    data = np.frombuffer(log([frame]), dtype=np.uint8)
    found = scan(data, WANTED, crc_extra()).frames
    assert int(found.length[0]) < layout(Message.SERVO_OUTPUT_RAW).itemsize
    table = decode(data, found, Message.SERVO_OUTPUT_RAW)
    assert [table[f"servo{n}_raw"].tolist() for n in (1, 2, 8, 9, 16)] == [[1100], *[[0]] * 4]


@pytest.mark.parametrize("size", [3, 20, 60])
def test_a_mavlink_1_payload_of_another_size_is_cut_or_continued_with_zeros(size: int) -> None:
    payload = (77_000).to_bytes(4, "little").ljust(size, b"\1")[:size]
    head = bytes([size, 0, 1, 1, Message.ATTITUDE])
    crc = x25crc(bytearray(head + payload) + bytes([crc_extra()[Message.ATTITUDE]])).crc
    data = np.frombuffer(
        log([b"\xfe" + head + payload + crc.to_bytes(2, "little")]), dtype=np.uint8
    )
    table = decode(data, scan(data, WANTED, crc_extra()).frames, Message.ATTITUDE)
    width = layout(Message.ATTITUDE).itemsize
    assert table.tobytes() == payload[:width].ljust(width, b"\0")


def test_progress_ends_at_one_and_never_goes_back() -> None:
    seen: list[float] = []
    data = np.frombuffer(log(short_flight(Sender())), dtype=np.uint8)
    scan(data, WANTED, crc_extra(), seen.append, window=500)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
