"""Bytes to frames and back, whatever lies between the frames, and signatures."""

from __future__ import annotations

import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_vehicle import UNIX_US, FakeVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.errors import ExitCode, InputError
from magcomp.link.framing import Framer
from magcomp.link.signing import read_signing_key

KEY = bytes(range(32))
OTHER_KEY = bytes(32)
MINUTE_US = 60_000_000


def heartbeats(count, **options):
    vehicle = FakeVehicle(**options)
    return [vehicle.heartbeat() for _ in range(count)]


def raw(frames):
    return [frame.raw for frame in frames]


def version_1():
    codec = mavlink.MAVLink(None, 7, 1)
    message = mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3)
    return message.pack(codec, force_mavlink1=True)


class TestReceiving:
    @given(st.lists(st.integers(1, 40), max_size=20))
    def test_frames_are_the_same_however_the_bytes_are_cut(self, cuts):
        sent = heartbeats(12)
        stream = b"".join(sent)
        framer, got = Framer(), []
        for cut in cuts:
            got += framer.receive(stream[:cut], 0.0)
            stream = stream[cut:]
        got += framer.receive(stream, 0.0)
        assert raw(got) == sent
        assert framer.counts.skipped == 0

    def test_both_versions_of_the_protocol_are_read(self):
        framer = Framer()
        (frame,) = framer.receive(version_1(), 0.0)
        assert frame.source == (7, 1)
        assert frame.message.get_type() == "HEARTBEAT"

    def test_source_and_sequence_are_the_senders(self):
        first, second = Framer().receive(b"".join(heartbeats(2, system=9, component=3)), 0.0)
        assert first.source == second.source == (9, 3)
        assert (first.sequence, second.sequence) == (0, 1)

    @given(st.binary(max_size=600))
    def test_garbage_before_a_frame_does_not_cost_the_frame(self, garbage):
        framer = Framer()
        found = framer.receive(garbage, 0.0)
        # What a false marker pretends to begin is at most 280 bytes long.
        sent = heartbeats(20)
        found += framer.receive(b"".join(sent), 0.0)
        assert raw(found)[-20:] == sent

    def test_a_false_marker_does_not_swallow_the_frame_behind_it(self):
        sent = heartbeats(30)
        framer = Framer()
        # Pretends a payload of 200 bytes: seven good frames would be in it.
        found = framer.receive(b"\xfd\xc8\x00" + b"".join(sent), 0.0)
        assert raw(found) == sent
        assert framer.counts.skipped == 3

    def test_a_damaged_frame_is_skipped_and_the_next_is_read(self):
        first, second, third = heartbeats(3)
        damaged = bytearray(second)
        damaged[12] ^= 0x10
        framer = Framer()
        assert raw(framer.receive(first + damaged + third, 0.0)) == [first, third]
        assert framer.counts.skipped == len(second)

    def test_a_false_marker_on_a_quiet_line_does_not_wait_for_ever(self):
        first, second = heartbeats(2)
        framer = Framer()
        assert framer.receive(b"\xfd\xff\x00" + first, 0.0) == []
        assert raw(framer.receive(second, 2.0)) == [first, second]

    def test_unknown_incompatible_features_are_no_frame(self):
        (frame,) = heartbeats(1)
        framer = Framer()
        assert framer.receive(frame[:2] + b"\x02" + frame[3:], 0.0) == []

    def test_a_message_of_another_dialect_is_kept_where_frames_surround_it(self):
        first, second = heartbeats(2)
        unknown = b"\xfd\x01\x00\x00\x05\x01\x01\xff\xff\x0f\x00\xaa\xbb"
        framer = Framer()
        found = framer.receive(first + unknown + second, 0.0)
        assert raw(found) == [first, unknown, second]
        assert raw(Framer().receive(unknown + b"\x00" + first, 0.0)) == [first]

    def test_half_a_frame_is_forgotten_with_its_connection(self):
        first, second = heartbeats(2)
        framer = Framer()
        framer.receive(first[:9], 0.0)
        framer.reset()
        assert raw(framer.receive(second, 0.0)) == [second]

    def test_a_hundred_thousand_markers_are_no_frames_and_take_no_memory(self):
        framer = Framer()
        for _ in range(100):
            assert framer.receive(b"\xfd" * 1000, 0.0) == []
        assert framer.counts.skipped >= 99_000


class TestSending:
    def test_a_message_comes_from_a_ground_station_with_growing_numbers(self):
        framer = Framer()
        message = mavlink.MAVLink_timesync_message(0, 1)
        frames = Framer().receive(framer.pack(message, 0) + framer.pack(message, 0), 0.0)
        assert [frame.source for frame in frames] == [(255, 190)] * 2
        assert [frame.sequence for frame in frames] == [0, 1]

    def test_without_a_key_nothing_is_signed(self):
        framer = Framer()
        packed = framer.pack(mavlink.MAVLink_timesync_message(0, 1), UNIX_US)
        Framer().receive(packed, 0.0)
        assert packed[2] == 0


class TestSigning:
    def test_what_is_sent_is_signed_and_understood_with_the_key(self):
        ours = Framer(KEY, UNIX_US)
        packed = ours.pack(mavlink.MAVLink_timesync_message(0, 1), UNIX_US)
        theirs = mavlink.MAVLink(None, 1, 1)
        theirs.signing.secret_key = KEY
        (message,) = theirs.parse_buffer(packed)
        assert message.get_signed()

    def test_the_right_key_is_accepted(self):
        sent = heartbeats(3, key=KEY)
        framer = Framer(KEY, UNIX_US)
        assert raw(framer.receive(b"".join(sent), 0.0)) == sent
        assert framer.counts.signed == 3

    @pytest.mark.parametrize("key", [None, OTHER_KEY])
    def test_no_key_or_another_is_refused_and_counted(self, key):
        framer = Framer(KEY, UNIX_US)
        assert framer.receive(b"".join(heartbeats(3, key=key)), 0.0) == []
        assert framer.counts.refused == 3

    def test_a_recorded_frame_sent_again_is_refused(self):
        sent = b"".join(heartbeats(2, key=KEY))
        framer = Framer(KEY, UNIX_US)
        assert len(framer.receive(sent, 0.0)) == 2
        assert framer.receive(sent, 0.0) == []

    def test_a_stream_more_than_a_minute_old_is_refused(self):
        sent = b"".join(heartbeats(1, key=KEY))
        assert Framer(KEY, UNIX_US + MINUTE_US + 10).receive(sent, 0.0) == []
        assert len(Framer(KEY, UNIX_US + MINUTE_US).receive(sent, 0.0)) == 1

    def test_a_forged_time_does_not_lock_the_true_sender_out(self):
        forger = FakeVehicle(key=OTHER_KEY)
        forger._mav.signing.timestamp += 10**12
        sent = heartbeats(1, key=KEY)
        framer = Framer(KEY, UNIX_US)
        assert raw(framer.receive(forger.heartbeat() + sent[0], 0.0)) == sent

    def test_what_is_sent_is_never_older_than_what_the_vehicle_proved(self):
        ahead = FakeVehicle(key=KEY)
        ahead._mav.signing.timestamp += 10**9
        framer = Framer(KEY, UNIX_US)
        framer.receive(ahead.heartbeat(), 0.0)
        packed = framer.pack(mavlink.MAVLink_timesync_message(0, 1), UNIX_US)
        assert int.from_bytes(packed[-12:-6], "little") >= ahead._mav.signing.timestamp - 1

    def test_two_messages_never_share_a_time(self):
        framer = Framer(KEY, UNIX_US)
        message = mavlink.MAVLink_timesync_message(0, 1)
        times = [framer.pack(message, UNIX_US)[-12:-6] for _ in range(3)]
        assert len(set(times)) == 3


class TestKeyFiles:
    def test_thirty_two_bytes_are_the_key(self, tmp_path):
        path = tmp_path / "key"
        path.write_bytes(KEY)
        assert read_signing_key(path) == KEY

    def test_a_passphrase_is_hashed_as_ground_stations_do(self, tmp_path):
        path = tmp_path / "key"
        path.write_text("open sesame\n")
        assert read_signing_key(path) == hashlib.sha256(b"open sesame").digest()

    @pytest.mark.parametrize(
        "content", [b"", b" \n", b"\xff" * 31, b"x" * 5000], ids=["empty", "blank", "noise", "long"]
    )
    def test_anything_else_is_refused_naming_the_file(self, tmp_path, content):
        path = tmp_path / "key"
        path.write_bytes(content)
        with pytest.raises(InputError, match="32 bytes or a passphrase") as refusal:
            read_signing_key(path)
        assert str(path) in str(refusal.value)
        assert refusal.value.exit_code is ExitCode.USAGE

    def test_a_missing_file_is_named(self, tmp_path):
        with pytest.raises(InputError, match="no-key"):
            read_signing_key(tmp_path / "no-key")
