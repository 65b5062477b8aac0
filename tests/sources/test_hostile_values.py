"""Frames whose checksums are right and whose values are anything at all."""

from __future__ import annotations

import numpy as np
from effort import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect
from pymavlink.generator.mavcrc import x25crc
from tlog_writer import START_US, Sender, record

from magcomp.errors import MagcompError
from magcomp.mavlink.messages import Message, layout
from magcomp.model import Series
from magcomp.sources.assemble import recording_from_bytes

# Ends of every integer; 0, 1, huge, infinite, a quiet and a signalling NaN as floats.
PATTERNS = [b"\0" * 8, b"\xff" * 8, b"\x80" + b"\0" * 7, b"\x7f" + b"\xff" * 7] + [
    word * 2
    for word in (
        b"\0\0\x80\x3f",
        b"\x76\x96\x96\x7e",
        b"\0\0\x80\x7f",
        b"\0\0\xc0\x7f",
        b"\1\0\x80\xff",
    )
]


def framed(message: int, payload: bytes, sequence: int) -> bytes:
    payload = payload.rstrip(b"\0") or b"\0"
    head = bytes([len(payload), 0, 0, sequence % 256, 1, 1]) + message.to_bytes(3, "little")
    extra = bytes([dialect.mavlink_map[message].crc_extra])
    return b"\xfd" + head + payload + x25crc(head + payload + extra).crc.to_bytes(2, "little")


@st.composite
def hostile(draw: st.DrawFn) -> tuple[int, bytes]:
    message = int(draw(st.sampled_from(list(Message))))
    size = layout(message).itemsize
    content = draw(
        st.one_of(
            st.binary(min_size=size, max_size=size),
            st.lists(st.sampled_from(PATTERNS), min_size=32, max_size=32).map(b"".join),
        )
    )
    return message, content[:size]


times = st.one_of(st.just(0), st.integers(0, 1 << 60), st.integers(START_US, START_US + 10**9))


@settings(max_examples=examples(120))
@given(st.lists(st.tuples(times, hostile()), max_size=40))
def test_any_values_are_read_without_a_warning_or_refused_in_words(
    said: list[tuple[int, tuple[int, bytes]]],
) -> None:
    data = record(START_US, Sender().heartbeat())
    data += b"".join(record(t % (1 << 60), framed(m, p, n)) for n, (t, (m, p)) in enumerate(said))
    try:
        recording = recording_from_bytes(data, "x.tlog")
    except MagcompError:
        return
    assert np.isfinite(recording.duration_s)
    series = [recording.attitude, recording.current, recording.throttle, recording.armed]
    for one in (*series, *recording.field.values(), *recording.other_currents.values()):
        if isinstance(one, Series):
            assert len(one.time) == len(one.value) > 0
            assert np.isfinite(one.time).all()
            assert np.isfinite(one.value).all()
            assert (np.diff(one.time) >= 0).all()
